"""Readers of log files: one format a file, found by content first and extension second.

A package of its own adds a format through the entry point group ``counterpoise.readers``, whose entries are
:class:`Reader` objects.
"""

from .registry import Reader, ReadOptions, find_reader, open_recording, readers

__all__ = ["ReadOptions", "Reader", "find_reader", "open_recording", "readers"]
