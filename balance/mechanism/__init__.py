"""Mechanisms from files: MJCF, URDF and SDF, and what of them is refused."""
