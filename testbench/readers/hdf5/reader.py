"""Readers of HDF5 and of MATLAB 7.3, by h5py in a process of its own."""

from pathlib import Path

from ...recording import Recording
from ..registry import Reader, ReadOptions
from ..subprocess_reader import open_in_subprocess

_MARK = b"\x89HDF\r\n\x1a\n"
_PLACES = (0, 512, 1024, 2048)
"""Where HDF5 may begin: other content may lie before it."""


def open_hdf5(path: Path, options: ReadOptions) -> Recording:
    """Walk through the file; the numbers are read when asked for."""
    return open_in_subprocess(path, "testbench.readers.hdf5.library")


def identify(head: bytes) -> bool:
    """Whether HDF5 begins at one of the places where it may."""
    return any(head[place : place + len(_MARK)] == _MARK for place in _PLACES)


READER = Reader(
    name="HDF5, NeXus, netCDF 4, MATLAB v7.3",
    extensions=(".h5", ".hdf5", ".nxs", ".nc", ".mat"),
    identify=identify,
    open=open_hdf5,
)
