"""Reader of enDAQ recordings, by idelib in a process of its own."""

from pathlib import Path

from ...recording import Recording
from ..registry import Reader, ReadOptions, needs
from ..subprocess_reader import open_in_subprocess
from .elements import MAGIC


def open_ide(path: Path, options: ReadOptions) -> Recording:
    """Open the recording; its data are read when asked for."""
    return open_in_subprocess(path, "testbench.readers.ide.library", extra="ide")


READER = Reader(
    name="enDAQ IDE",
    extensions=(".ide",),
    identify=lambda head: head.startswith(MAGIC) and b"mide" in head[:64].lower(),
    open=open_ide,
    needs=needs("ide"),
)
