"""The segments of a TDMS file, and the spans of bytes in which the raw numbers of a channel lie, read in windows."""

import struct
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..byte_source import ByteSource
from ..format_findings import damaged

LEAD_IN = 28
METADATA, NEW_LIST, RAW_DATA, INTERLEAVED, BIG_ENDIAN = 1 << 1, 1 << 2, 1 << 3, 1 << 5, 1 << 6
"""What a segment has, or how it lies: flags of its lead-in."""
_UNFINISHED = 0xFFFFFFFFFFFFFFFF
_LONGEST_METADATA = 256 << 20
_WINDOW = 16 << 20
"""Bytes of the file that are read at once."""
_SPARSE = 64
"""Spans that fill less than one part in so many of the file are read one by one."""


@dataclass(frozen=True)
class Segment:
    """One segment: where it begins, where its metadata and raw data lie, and where it ends by its lead-in.

    ``end`` is that of the file where it is cut; ``declared_end`` is None where the writer never finished it.
    """

    number: int
    begin: int
    raw: int
    end: int
    declared_end: int | None
    flags: int

    @property
    def order(self) -> str:
        """Byte order."""
        return ">" if self.flags & BIG_ENDIAN else "<"

    @property
    def raw_bytes(self) -> int:
        """Bytes of its raw data that are there; in a file that is cut they may begin beyond its end."""
        return max(0, self.end - self.raw)

    @property
    def is_whole(self) -> bool:
        """Whether the file holds all of it."""
        return self.declared_end == self.end

    def metadata(self, source: ByteSource) -> bytes:
        """The bytes of its metadata, as far as they are there."""
        begin = self.begin + LEAD_IN
        count = min(self.raw, self.end) - begin
        if count > _LONGEST_METADATA:
            raise damaged(source.path, f"segment {self.number} has {count} bytes of metadata")
        return source.read(begin, max(count, 0), f"the metadata of segment {self.number}")


def segments(source: ByteSource) -> Iterator[Segment]:
    """All segments; one that is cut is the last."""
    begin, number = 0, 1
    while begin < source.size:
        if begin + LEAD_IN > source.size:
            yield Segment(number, begin, source.size, source.size, begin + LEAD_IN, 0)
            return
        tag, flags, _, size, raw = struct.unpack("<4s2I2Q", source.read(begin, LEAD_IN, "a lead-in"))
        if tag != b"TDSm":
            raise damaged(source.path, f"byte {begin}: {tag!r}; expected the next segment to begin with b'TDSm'")
        if flags & BIG_ENDIAN:
            _, size, raw = struct.unpack(">I2Q", source.read(begin + 8, LEAD_IN - 8, "a lead-in"))
        declared = None if size == _UNFINISHED else begin + LEAD_IN + size
        end = source.size if declared is None else min(declared, source.size)
        if raw > size:
            raise damaged(source.path, f"segment {number} at byte {begin}: its raw data begin behind its end")
        yield Segment(number, begin, begin + LEAD_IN + raw, end, declared, flags)
        begin, number = end, number + 1


@dataclass
class Spans:
    """Numbers of one kind: for each span its first byte, how many numbers, and the bytes from one to the next."""

    kind: np.dtype[Any]
    offsets: "array[int]" = field(default_factory=lambda: array("q"))
    counts: "array[int]" = field(default_factory=lambda: array("q"))
    strides: "array[int]" = field(default_factory=lambda: array("q"))
    length: int = 0

    def add(self, offset: int, count: int, stride: int, chunks: int, chunk_bytes: int) -> None:
        """``chunks`` spans, each ``chunk_bytes`` behind the other; those that touch become one."""
        if chunks > 1 and count * stride == chunk_bytes:
            count, chunks = count * chunks, 1
        if not count or not chunks:
            return
        self.offsets.extend(range(offset, offset + chunks * chunk_bytes, chunk_bytes) if chunks > 1 else (offset,))
        self.counts.extend([count] * chunks)
        self.strides.extend([stride] * chunks)
        self.length += count * chunks


class Reading:
    """The numbers of spans, read from first to last."""

    def __init__(self, source: ByteSource, spans: Spans, what: str) -> None:
        self._source, self._kind, self._what = source, spans.kind, what
        self._offsets = np.frombuffer(spans.offsets, dtype=np.int64)
        self._counts = np.frombuffer(spans.counts, dtype=np.int64)
        self._strides = np.frombuffer(spans.strides, dtype=np.int64)
        self._span, self._within = 0, 0

    def next(self, count: int) -> NDArray[Any]:
        """The next ``count`` numbers (count,) [as stored], which must be there."""
        pieces = list(self._pieces(count))
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)

    def _pieces(self, count: int) -> Iterator[NDArray[Any]]:
        while count:
            here = int(self._counts[self._span]) - self._within
            if self._within or here > count:
                taken = min(here, count)
                yield from self._part(self._span, self._within, taken)
                self._within = self._within + taken if taken < here else 0
                self._span += taken == here
            else:
                taken, stop = self._regular(count)
                yield self._together(self._span, stop)
                self._span = stop
            count -= taken

    def _regular(self, count: int) -> tuple[int, int]:
        """How many numbers, and up to which span, lie in whole spans of one size and distance within a window."""
        i, size, stride = self._span, int(self._counts[self._span]), int(self._strides[self._span])
        most = min(count // size, len(self._counts) - i, 1 << 20)
        offsets = self._offsets[i : i + most]
        same = (self._counts[i : i + most] == size) & (self._strides[i : i + most] == stride)
        steps = np.diff(offsets)
        if len(steps):
            same[1:] &= (steps == steps[0]) & (offsets[1:] - offsets[0] + size * stride <= _WINDOW)
            if steps[0] < size * stride or steps[0] > _SPARSE * size * stride:
                same[1:] = False
        number = int(np.argmin(same)) if not same.all() else len(same)
        number = max(number, 1)
        return number * size, i + number

    def _together(self, first: int, stop: int) -> NDArray[Any]:
        """Whole spans of one size and distance."""
        size, stride = int(self._counts[first]), int(self._strides[first])
        if stop - first == 1:
            return np.concatenate(list(self._part(first, 0, size)))
        begin, step = int(self._offsets[first]), int(self._offsets[first + 1] - self._offsets[first])
        extent = int(self._offsets[stop - 1]) - begin + (size - 1) * stride + self._kind.itemsize
        raw = self._source.read(begin, extent, self._what)
        table = np.ndarray((stop - first, size), self._kind, raw, strides=(step, stride))
        return table.reshape(-1)

    def _part(self, span: int, skip: int, count: int) -> Iterator[NDArray[Any]]:
        """``count`` numbers of one span, behind its first ``skip``."""
        stride = int(self._strides[span])
        begin, most = int(self._offsets[span]) + skip * stride, max(1, _WINDOW // stride)
        for done in range(0, count, most):
            number = min(most, count - done)
            extent = (number - 1) * stride + self._kind.itemsize
            raw = self._source.read(begin + done * stride, extent, self._what)
            yield np.ndarray((number,), self._kind, raw, strides=(stride,))
