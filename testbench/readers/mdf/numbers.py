"""The numbers of a channel from records that lie one behind the other."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...recording import Samples
from .model import Member, Records

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
