"""What is measured where on a test bench: the rig file, checked once, in SI."""

from .rig import Rig, load_rig, rig_from_text
from .sensor_channels import Column

__all__ = ["Column", "Rig", "load_rig", "rig_from_text"]
