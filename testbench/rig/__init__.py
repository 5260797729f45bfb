"""What is measured where on a test bench: the rig file, checked once, in SI."""

from .columns import Column
from .rig import Rig, load

__all__ = ["Column", "Rig", "load"]
