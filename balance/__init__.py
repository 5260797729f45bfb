"""Mechanics on paper: models, momentum conditions, counter-masses. Nothing here knows a sensor or a measured file."""
