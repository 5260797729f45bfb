"""Readers of MATLAB files of version 4 and 5 (also 6 and 7), by scipy in a process of its own."""

import struct
from pathlib import Path

from ..recording import Recording
from .registry import Reader, ReadOptions
from .subprocess_reader import open_in_subprocess

_HEADER_4 = struct.calcsize("5i")
_LONGEST_NAME = 256


def open_matlab(path: Path, options: ReadOptions) -> Recording:
    """Look at all variables; their numbers are sent when asked for."""
    return open_in_subprocess(path, "testbench.readers.matlab_worker")


def _identify_5(head: bytes) -> bool:
    return head.startswith(b"MATLAB 5.0") or (len(head) >= 128 and head[124:128] == b"\x00\x01IM")


def _identify_4(head: bytes) -> bool:
    """A header of version 4: small sides, and a name that MATLAB takes."""
    for order in "<>":
        if len(head) < _HEADER_4:
            return False
        kind, rows, columns, is_complex, length = struct.unpack_from(f"{order}5i", head)
        name = head[_HEADER_4 : _HEADER_4 + max(0, min(length, _LONGEST_NAME))]
        known = kind // 1000 == (order == ">") and 0 <= kind % 1000 <= 52 and kind % 10 <= 2
        if known and min(rows, columns) >= 0 and is_complex in (0, 1) and length > 1:
            plain = name[:-1].decode("latin-1")
            return name[-1:] == b"\0" and plain.isidentifier() and plain.isascii()
    return False


MATLAB_5 = Reader(name="MATLAB v5", extensions=(".mat",), identify=_identify_5, open=open_matlab)
MATLAB_4 = Reader(name="MATLAB v4", extensions=(".mat",), identify=_identify_4, open=open_matlab)
