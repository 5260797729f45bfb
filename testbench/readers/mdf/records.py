"""Samples that are stored by column (list LD): the bytes of one channel, its invalidation bits apart.

The numbers of a channel from records that lie one behind the other.

Records of each group from the bytes of their data group: of one kind, or of several by their identifiers.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...recording import Samples
from ..byte_source import BLOCK_BYTES, ByteSource, damaged
from .data_model import DataGroup, Member, Records
from .version4_blocks import Stored, unpacked

Bytes = NDArray[np.uint8]
_ROUND = (8, 16, 32, 64)
_BITS_OF_FLOAT = 53


def column(member: Member, rows: Bytes, first: int) -> Samples:
    """Physical values of ``member`` in ``rows`` (n, size of a record), of which the first has the number ``first``."""
    with np.errstate(all="ignore"):
        values = raw(member, rows, first)
        return values if member.law is None else np.asarray(member.law(values), dtype=np.float64)


def raw(member: Member, rows: Bytes, first: int) -> Samples:
    """Raw numbers as float64."""
    if member.kind == "index":
        return np.arange(first, first + len(rows), dtype=np.float64)
    if member.kind == "f" or (member.bit == 0 and member.bits in _ROUND):
        return _plain(rows, np.dtype(f"{member.order}{member.kind}{member.bits // 8}"), member.byte)
    return _bits(member, rows)


def _plain(rows: Bytes, kind: np.dtype[Any], byte: int) -> Samples:
    """Numbers of whole bytes."""
    view = np.ndarray((len(rows),), kind, rows, offset=byte, strides=(rows.strides[0],))
    return np.asarray(view.astype(np.float64))


def _bits(member: Member, rows: Bytes) -> Samples:
    """Numbers of any count of bits: gathered from their bytes, shifted, cut, and their sign extended."""
    count = -(-(member.bit + member.bits) // 8)
    picked = rows[:, member.byte : member.byte + count]
    if member.order == ">":
        picked = picked[:, ::-1]
    gathered = np.zeros(len(rows), dtype=np.uint64)
    for i in range(min(count, 8)):
        gathered |= picked[:, i].astype(np.uint64) << np.uint64(8 * i)
    gathered >>= np.uint64(member.bit)
    if count == 9:
        gathered |= picked[:, 8].astype(np.uint64) << np.uint64(64 - member.bit)
    if member.bits < 64:
        gathered &= np.uint64((1 << member.bits) - 1)
    if member.kind == "u":
        return gathered.astype(np.float64)
    spare = np.uint64(64 - member.bits)
    return ((gathered << spare).view(np.int64) >> np.int64(64 - member.bits)).astype(np.float64)


def may_be_rounded(member: Member) -> bool:
    """Whether a channel holds whole numbers as they are, with more bits than float64 has."""
    return member.kind in ("u", "i") and member.bits > _BITS_OF_FLOAT and member.law is None


def fits(member: Member, size: int) -> bool:
    """Whether the bits of a channel lie within a record of ``size`` bytes, and are a number that can be read."""
    if member.kind == "index":
        return True
    if not 0 < member.bits <= 64 or not 0 <= member.bit < 8 or member.byte < 0:
        return False
    if member.kind == "f" and (member.bits not in (16, 32, 64) or member.bit):
        return False
    return member.byte + -(-(member.bit + member.bits) // 8) <= size


def invalid(member: Member, rows: Bytes, records: Records) -> NDArray[np.bool_] | None:
    """Which samples the file marks as invalid; None if none can be."""
    if member.invalid_bit is None:
        return None
    if member.invalid_bit < 0:
        return np.ones(len(rows), dtype=bool)
    at = records.data + member.invalid_bit // 8
    if at >= rows.shape[1]:
        return None
    return np.asarray((rows[:, at] >> (member.invalid_bit % 8)) & 1, dtype=bool)


def is_by_column(source: ByteSource, address: int) -> bool:
    """Whether the samples at ``address`` are a list LD."""
    return bool(address) and source.read(address, 4, "a block of samples") == b"##LD"


def records(given: Records, stretches: Sequence[Stored]) -> Records:
    """The records as they are stored: without invalidation bytes where the list has none."""
    if given.size is None or any(stretch.beside for stretch in stretches):
        return given
    members = tuple(m if m.invalid_bit == -1 else replace(m, invalid_bit=None) for m in given.members)
    return replace(given, size=given.data, members=members)


def pieces(source: ByteSource, stretches: Sequence[Stored], data: int, invalidation: int) -> Iterator[bytes]:
    """Records of ``data`` bytes, each with its ``invalidation`` bytes behind, in pieces of bounded size."""
    for stretch in stretches:
        count = stretch.unpacked // data if data else 0
        bits = stretch.beside
        if data * count != stretch.unpacked or (bits and bits.unpacked != count * invalidation):
            message = (
                f"byte {stretch.begin}: {stretch.unpacked} bytes are no whole records of {data} bytes with their bits"
            )
            raise damaged(source.path, message)
        step = max(1, BLOCK_BYTES // (data + invalidation))
        values = _whole(source, stretch)
        flags = _whole(source, bits) if bits else None
        for begin in range(0, count, step):
            end = min(begin + step, count)
            table = np.zeros((end - begin, data + invalidation), dtype=np.uint8)
            table[:, :data] = _rows(source, stretch, values, begin, end, data)
            if bits:
                table[:, data:] = _rows(source, bits, flags, begin, end, invalidation)
            yield table.tobytes()


def _whole(source: ByteSource, stretch: Stored) -> bytes | None:
    """All bytes of a stretch that is packed; None if it can be read in parts."""
    return unpacked(source, stretch) if stretch.is_packed else None


def _rows(source: ByteSource, stretch: Stored, whole: bytes | None, begin: int, end: int, width: int) -> Bytes:
    """Rows ``begin`` to before ``end`` of ``width`` bytes."""
    if whole is not None:
        raw = whole[begin * width : end * width]
    else:
        raw = source.read(stretch.begin + begin * width, (end - begin) * width, "samples")
    return np.frombuffer(raw, dtype=np.uint8).reshape(-1, width)


class Torn(Exception):
    """An identifier that is none of the group's: from there on nothing can be told apart."""


@dataclass(frozen=True)
class Part:
    """Successive records of one kind, (n, size), or (n, 0) where all of it is virtual."""

    records: Records
    rows: Bytes


def record_parts(group: DataGroup) -> Iterator[Part]:
    """The records of a data group as they come; what is no whole record at the end is left."""
    if not group.identifier_size:
        yield from _one_kind(group)
    else:
        yield from _several(group)


def _one_kind(group: DataGroup) -> Iterator[Part]:
    records = group.records[0]
    if not records.size:
        if records.declared and records.size == 0:
            yield Part(records, np.empty((records.declared, 0), dtype=np.uint8))
        return
    keep = b""
    for piece in group.pieces():
        data = keep + piece if keep else piece
        count = len(data) // records.size
        keep = data[count * records.size :]
        if count:
            rows = np.frombuffer(data, dtype=np.uint8, count=count * records.size)
            yield Part(records, rows.reshape(count, records.size))


def _several(group: DataGroup) -> Iterator[Part]:
    """Records of several kinds, sorted within each piece of bytes."""
    by_identifier = {records.identifier: records for records in group.records}
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
                raise Torn(f"a record has the identifier {identifier}, which no channel group has")
            begin, size = at + head, records.size
            if size is None:
                if begin + 4 > len(data):
                    break
                begin, size = begin + 4, int.from_bytes(data[begin : begin + 4], order)  # type: ignore[arg-type]
            if begin + size + tail > len(data):
                break
            if records.size:
                found.setdefault(identifier, []).append(data[begin : begin + size])
            at = begin + size + tail
        keep = data[at:]
        if len(keep) > 64 * BLOCK_BYTES:
            raise Torn(f"a record of more than {64 * BLOCK_BYTES >> 20} MiB")
        for identifier, rows in found.items():
            records = by_identifier[identifier]
            yield Part(records, np.frombuffer(b"".join(rows), dtype=np.uint8).reshape(len(rows), -1))
