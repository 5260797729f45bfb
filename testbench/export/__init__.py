"""Stored runs in other people's forms: values with units and time, and where they come from.

One file a target. Nothing is ever overwritten; a file has its name only once it is whole.
"""

from .sep005 import sep005
from .target import TARGETS, Exported, export

__all__ = ["TARGETS", "Exported", "export", "sep005"]
