"""A text file in blocks of whole lines, as ASCII-compatible bytes with line feeds."""

import codecs
from collections.abc import Iterator
from dataclasses import dataclass
from io import FileIO
from pathlib import Path

import numpy as np

from ...findings import Finding, Refusal
from .encoding import Encoding

BLOCK_BYTES = 8 << 20
"""Size of a block: large enough to parse on all cores, small enough for many blocks in memory [bytes]."""
_LOOK_BACK = 4096
LONGEST_LINE = 4 << 20
"""A line longer than this is no row of a log [bytes]."""


@dataclass(frozen=True)
class Lines:
    """Whole lines, each with its line feed; the file's line of the first; the rest after the last one.

    ``rest`` is empty but in the file's last block, and there only if the last line has no end. Where nobody counts the
    lines, ``first`` is that of the first block.
    """

    text: bytes
    first: int
    rest: bytes = b""
    bytes_read: int = 0


def in_blocks(
    path: Path, encoding: Encoding, first_line: int, block_bytes: int | None = None, counted: bool = True
) -> Iterator[Lines]:
    """The lines from ``first_line`` (counted from 1) on, in blocks; not ``counted`` where the caller does it."""
    line, rest, bytes_read = 1, b"", 0
    for raw in _chunks(path, encoding, block_bytes or BLOCK_BYTES):
        bytes_read += len(raw)
        if raw.endswith(b"\n") and not rest:
            whole = raw
        else:
            data = rest + raw
            end = data.rfind(b"\n") + 1
            whole, rest = data[:end], data[end:]
        if len(rest) > LONGEST_LINE:
            raise too_long(path, line + count_lines(whole))
        skipped = 0
        while line < first_line and (at := whole.find(b"\n", skipped)) >= 0:
            line, skipped = line + 1, at + 1
        if skipped < len(whole):
            text = whole[skipped:] if skipped else whole
            yield Lines(text, line, bytes_read=bytes_read)
            line += count_lines(text) if counted else 0
    if rest:
        yield Lines(b"", line, rest, bytes_read)


def count_lines(text: bytes) -> int:
    """How many line feeds there are; five times as fast as ``bytes.count``."""
    return int(np.count_nonzero(np.frombuffer(text, dtype=np.uint8) == ord("\n")))


def too_long(path: Path, line: int) -> Refusal:
    """The refusal of a file with a line that no logger writes."""
    message = f"a line longer than {LONGEST_LINE >> 20} MiB; this is no log with one row a line"
    return Refusal(path.name, Finding("line_too_long", None, f"line {line}", message))


def _chunks(path: Path, encoding: Encoding, size: int) -> Iterator[bytes]:
    """The file's content after its mark; other encodings than ASCII's kin as UTF-8, line ends as line feeds."""
    decoder = None if encoding.keeps_ascii else codecs.getincrementaldecoder(encoding.name)("replace")
    returns_only: bool | None = None
    with path.open("rb", buffering=0) as stream:
        stream.seek(encoding.mark)
        while raw := stream.read(_to_line_end(stream, size)):
            if decoder is not None:
                raw = decoder.decode(raw).encode("utf-8", "replace")
            if returns_only is None:
                returns_only = b"\r" in raw and b"\n" not in raw
            yield raw.replace(b"\r", b"\n") if returns_only else raw
    if decoder is not None and (tail := decoder.decode(b"", final=True)):
        yield tail.encode("utf-8", "replace")


def _to_line_end(stream: FileIO, size: int) -> int:
    """How much of the next ``size`` bytes ends with a line feed: no line need be put together from two reads then."""
    at = stream.tell()
    stream.seek(max(at, at + size - _LOOK_BACK))
    found = stream.tell() - at + stream.read(min(size, _LOOK_BACK)).rfind(b"\n") + 1
    stream.seek(at)
    return found if found > max(0, size - _LOOK_BACK) else size
