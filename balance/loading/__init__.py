"""Mechanisms from files: MJCF, URDF and SDF, and what of them is refused."""

from .loading import load, load_text, pinocchio_model

__all__ = ["load", "load_text", "pinocchio_model"]
