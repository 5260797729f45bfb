"""What is measured where on a test bench: the rig file, checked once, in SI."""

from .columns import Column
from .rig import Rig, from_text, load

__all__ = ["Column", "Rig", "from_text", "load"]
