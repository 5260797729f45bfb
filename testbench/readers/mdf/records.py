"""What both versions of MDF come to: data groups of records, channels in records, conversions to physical values.

A data group is a stream of bytes. It holds records of one kind, or of several, each after its identifier (an unsorted
file). A channel is a run of bits of each record: gathered from its bytes, shifted, masked, its sign extended.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...recording import Finding, Samples, StartTime
from ..byte_source import BLOCK_BYTES
from ..format_findings import damaged
from .conversions import Conversion

Pieces = Callable[[], Iterator[bytes]]
Bytes = NDArray[np.uint8]
B = TypeVar("B")

LONGEST_FRAME, LONGEST_TEXT = 64, 128
"""Bytes of the longest frame of a bus (CAN FD), and of a text whose records lie among others."""
_ROUND = (8, 16, 32, 64)
_BITS_OF_FLOAT = 53


@dataclass(frozen=True)
class Member:
    """A channel: where its bits lie in a record, and the conversion that makes its number physical.

    ``kind``: unsigned, signed or floating-point number, or ``index``, the number of the record. ``invalid_bit`` is
    the bit behind the record's data that marks a sample as invalid, -1 for always; None if there is none.
    """

    name: str
    unit: str | None
    kind: Literal["u", "i", "f", "index"]
    order: Literal["<", ">"]
    byte: int
    bit: int
    bits: int
    conversion: Conversion | None = None
    is_time: bool = False
    invalid_bit: int | None = None
    within: tuple[int, int] | None = None
    """Of a byte of a frame: which byte says how long the frame is, and its number; NaN where that is shorter."""

    @property
    def may_be_rounded(self) -> bool:
        """Whether it holds whole numbers as they are, with more bits than float64 has."""
        return self.kind in ("u", "i") and self.bits > _BITS_OF_FLOAT and self.conversion is None

    def fits(self, size: int) -> bool:
        """Whether its bits lie within a record of ``size`` bytes, and are a number that can be read."""
        if self.kind == "index":
            return True
        if not 0 < self.bits <= 64 or not 0 <= self.bit < 8 or self.byte < 0:
            return False
        if self.kind == "f" and (self.bits not in (16, 32, 64) or self.bit):
            return False
        return self.byte + -(-(self.bit + self.bits) // 8) <= size

    def values(self, rows: Bytes, first: int, data: int) -> tuple[Samples, NDArray[np.bool_] | None]:
        """Physical values (n,) [unit of the channel] in ``rows`` (n, size), of which the first is record ``first``.

        And which samples the file marks as invalid, (n,) [-]; None if it marks none. ``data`` is where the bits of
        that begin in a record.
        """
        with np.errstate(all="ignore"):
            values = self.raw_values(rows, first)
            if self.conversion is not None:
                values = np.asarray(self.conversion(values), dtype=np.float64)
        if self.invalid_bit is None:
            return values, None
        if self.invalid_bit < 0:
            return values, np.ones(len(rows), dtype=bool)
        at = data + self.invalid_bit // 8
        if at >= rows.shape[1]:
            return values, None
        return values, np.asarray((rows[:, at] >> (self.invalid_bit % 8)) & 1, dtype=bool)

    def raw_values(self, rows: Bytes, first: int) -> Samples:
        """Raw numbers (n,) [-] in ``rows`` (n, size) as float64; the first is record ``first``."""
        if self.kind == "index":
            return np.arange(first, first + len(rows), dtype=np.float64)
        if self.kind == "f" or (self.bit == 0 and self.bits in _ROUND):
            kind = np.dtype(f"{self.order}{self.kind}{self.bits // 8}")
            view = np.ndarray((len(rows),), kind, rows, offset=self.byte, strides=(rows.strides[0],))
            values = np.asarray(view.astype(np.float64))
            return values if self.within is None else np.where(rows[:, self.within[0]] > self.within[1], values, np.nan)
        # a number of any count of bits: its bytes in two words, shifted down, and by its length up and down again
        count = -(-(self.bit + self.bits) // 8)
        words = np.zeros((len(rows), 16), dtype=np.uint8)
        words[:, :count] = rows[:, self.byte : self.byte + count][:, :: -1 if self.order == ">" else 1]
        low, high = words.view("<u8").T
        number = low >> np.uint64(self.bit)
        if count == 9:
            number |= high << np.uint64(64 - self.bit)
        unused = np.uint64(64 - self.bits)
        signed = "<i8" if self.kind == "i" else "<u8"
        return ((number << unused).view(signed) >> unused.astype(signed)).astype(np.float64)


@dataclass(frozen=True)
class TextMember:
    """A channel of text: where its letters lie in a record, filled up with zeros; or their place in ``signal``.

    There each text stands behind its length in bytes, 32 bits; the record has its place, 64 bits, little-endian.
    """

    name: str
    byte: int
    size: int
    encoding: str
    signal: Callable[[], bytes] | None = None

    def changes(self, rows: Bytes) -> Iterator[tuple[int, str]]:
        """The rows (n, size) in which another text begins, and it."""
        cells = rows[:, self.byte : self.byte + self.size]
        for i in map(int, np.flatnonzero(np.r_[True, (cells[1:] != cells[:-1]).any(axis=1)])):
            raw = cells[i].tobytes()
            if self.signal is not None:
                place, letters = int.from_bytes(raw, "little") + 4, self.signal()
                raw = letters[place : place + int.from_bytes(letters[place - 4 : place], "little")]
            yield i, raw.decode(self.encoding, "replace").partition("\0")[0]


@dataclass(frozen=True)
class Frames:
    """Frames of varying length, such as those of a bus: channel, place among the members, and their own records.

    Each is joined to its record, behind a byte that says how long it is, filled up to the ``longest``. Letters have
    their ``encoding``, and are a text.
    """

    name: str
    place: int
    address: int
    longest: int = 0
    encoding: str = ""


@dataclass(frozen=True)
class Records:
    """Records of one kind: their size without identifier [bytes], the size of their data, how many are declared.

    ``size`` is None for records of varying length: frames, or texts. ``master`` is the address
    of the records that hold their time, 0 if they do themselves.
    """

    name: str
    identifier: int
    size: int | None
    data: int
    declared: int | None
    members: tuple[Member, ...]
    address: int = 0
    master: int = 0
    frames: Frames | None = None
    texts: tuple[TextMember, ...] = ()


@dataclass(frozen=True)
class DataGroup:
    """Records in one stream of bytes, each after its identifier (and before it again: ``trailing``) if it has one."""

    identifier_size: int
    trailing: bool
    order: Literal["<", ">"]
    records: tuple[Records, ...]
    pieces: Pieces
    bytes: int


@dataclass
class File:
    """All that a file declares."""

    version: str
    groups: list[DataGroup] = field(default_factory=list)
    metadata: dict[str, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    """Channels of text that are not kept."""
    converted: int = 0
    """Channels with a conversion."""
    zero: StartTime | None = None
    """When the times of all groups are zero."""


def linked(
    path: Path, address: int, kind: str, block: Callable[[int], B], following: Callable[[B], int]
) -> Iterator[B]:
    """The blocks of a list, each linking to the ``following``; a list that comes back to itself is refused."""
    seen: set[int] = set()
    while address:
        if address in seen or len(seen) > 1_000_000:
            raise damaged(path, f"the list of blocks {kind} comes back to byte {address}")
        seen.add(address)
        yield (found := block(address))
        address = following(found)


class UnknownIdentifier(Exception):
    """An identifier that no channel group has: from there on nothing can be read."""


def record_parts(group: DataGroup) -> Iterator[tuple[Records, Bytes]]:
    """Successive records of one kind of a data group, (n, size), or (n, 0) where all of it is virtual.

    What is no whole record at its end is dropped.
    """
    if group.identifier_size:
        yield from _by_identifier(group)
        return
    records = group.records[0]
    if not records.size:
        if records.declared and records.size == 0:
            yield records, np.empty((records.declared, 0), dtype=np.uint8)
        return
    keep = b""
    for piece in group.pieces():
        data = keep + piece if keep else piece
        count = len(data) // records.size
        keep = data[count * records.size :]
        if count:
            yield records, np.frombuffer(data, np.uint8, count * records.size).reshape(count, records.size)


def _by_identifier(group: DataGroup) -> Iterator[tuple[Records, Bytes]]:
    """Records of several kinds, sorted within each piece of bytes; frames are joined to theirs, in their order."""
    by_identifier = {records.identifier: records for records in group.records}
    identifiers = {records.address: records.identifier for records in group.records}
    waiting: dict[int, list[bytes]] = {records.identifier: [] for records in group.records}
    for found in sorted_records(group):
        for identifier, rows in found.items():
            waiting[identifier] += rows
        for identifier, records in by_identifier.items():
            rows, frames = waiting[identifier], records.frames
            if not records.size:
                continue
            if frames is not None and frames.longest:
                parts = waiting[identifiers[frames.address]]
                count = min(len(rows), len(parts))
                joined = [
                    row + bytes((len(part),)) + part.ljust(frames.longest, b"\0")
                    for row, part in zip(rows[:count], parts[:count], strict=True)
                ]
                del rows[:count], parts[:count]
                rows = joined
            else:
                waiting[identifier] = []
            if rows:
                yield records, np.frombuffer(b"".join(rows), dtype=np.uint8).reshape(len(rows), -1)


def sorted_records(group: DataGroup) -> Iterator[dict[int, list[bytes]]]:
    """The records of each piece of bytes by identifier, each in its order; what is no whole one at the end is dropped.

    Records of varying length that no channel takes for frames or texts are passed over.
    """
    by_identifier = {records.identifier: records for records in group.records}
    frames = {records.frames.address for records in group.records if records.frames is not None}
    order = "little" if group.order == "<" else "big"
    head, tail = group.identifier_size, group.identifier_size if group.trailing else 0
    keep = b""
    for piece in group.pieces():
        data, at = keep + piece, 0
        found: dict[int, list[bytes]] = {}
        while at + head <= len(data):
            identifier = int.from_bytes(data[at : at + head], order)  # type: ignore[arg-type]
            records = by_identifier.get(identifier)
            if records is None:
                raise UnknownIdentifier(f"a record has the identifier {identifier}, which no channel group has")
            begin, size = at + head, records.size
            if size is None:
                if begin + 4 > len(data):
                    break
                begin, size = begin + 4, int.from_bytes(data[begin : begin + 4], order)  # type: ignore[arg-type]
            if begin + size + tail > len(data):
                break
            if records.size or records.address in frames:
                found.setdefault(identifier, []).append(data[begin : begin + size])
            at = begin + size + tail
        keep = data[at:]
        if len(keep) > 64 * BLOCK_BYTES:
            raise UnknownIdentifier(f"a record of more than {64 * BLOCK_BYTES >> 20} MiB")
        yield found
