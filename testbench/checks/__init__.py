"""What the data themselves show: numbers of each channel and clock, and findings about them, in one pass."""

from .groups import GroupCheck, RecordingCheck

__all__ = ["GroupCheck", "RecordingCheck"]
