"""The named ways of balancing, side by side on one motion."""
