"""Motions of the platform or of joints (``datasets/motions``): moves of limited jerk, polygons, samples of a file."""

from .motion import DEFAULT_RATE_HZ, Motion, Samples

__all__ = ["DEFAULT_RATE_HZ", "Motion", "Samples"]
