"""What is measured where on a test bench: the rig file, checked once, in SI."""

from ..calibration.evaluation import Column
from .rig import Rig, load_rig, rig_from_text

__all__ = ["Column", "Rig", "load_rig", "rig_from_text"]
