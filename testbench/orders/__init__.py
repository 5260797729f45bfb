"""Vibration at multiples of a shaft's speed: its turns by a tacho, vectors by least squares."""
