"""Reader of MCAP, by its library in a process of its own."""

from pathlib import Path

from ...recording import Recording
from ..extras import needs
from ..isolated import open_isolated
from ..registry import Reader, ReadOptions


def open_mcap(path: Path, options: ReadOptions) -> Recording:
    """Look at the topics; the messages are read when asked for."""
    return open_isolated(path, "testbench.readers.mcap.library", "open_library")


READER = Reader(
    name="MCAP",
    extensions=(".mcap",),
    identify=lambda head: head.startswith(b"\x89MCAP0\r\n"),
    open=open_mcap,
    needs=needs("mcap"),
)
