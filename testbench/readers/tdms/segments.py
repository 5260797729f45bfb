"""The segments of a TDMS file, one after the other, and whether the last of them is whole."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from ..stream import ByteSource, damaged

LEAD_IN = 28
_METADATA, _NEW_LIST, _RAW, _INTERLEAVED, _BIG_ENDIAN = 1 << 1, 1 << 2, 1 << 3, 1 << 5, 1 << 6
_UNFINISHED = 0xFFFFFFFFFFFFFFFF
_LONGEST_METADATA = 256 << 20


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
        return ">" if self.flags & _BIG_ENDIAN else "<"

    @property
    def has_metadata(self) -> bool:
        """Whether it declares anything."""
        return bool(self.flags & _METADATA)

    @property
    def is_new_list(self) -> bool:
        """Whether its objects replace those before."""
        return bool(self.flags & _NEW_LIST)

    @property
    def has_raw_data(self) -> bool:
        """Whether it holds samples."""
        return bool(self.flags & _RAW)

    @property
    def is_interleaved(self) -> bool:
        """Whether samples of all channels follow one another."""
        return bool(self.flags & _INTERLEAVED)

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
        if flags & _BIG_ENDIAN:
            _, size, raw = struct.unpack(">I2Q", source.read(begin + 8, LEAD_IN - 8, "a lead-in"))
        declared = None if size == _UNFINISHED else begin + LEAD_IN + size
        end = source.size if declared is None else min(declared, source.size)
        if raw > size:
            raise damaged(source.path, f"segment {number} at byte {begin}: its raw data begin behind its end")
        yield Segment(number, begin, begin + LEAD_IN + raw, end, declared, flags)
        begin, number = end, number + 1
