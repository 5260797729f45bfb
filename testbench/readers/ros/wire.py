"""The wire format of Protocol Buffers: the fields of a message by their number, their bytes not yet understood.

https://protobuf.dev/programming-guides/encoding
"""

from .decode import Unreadable

VARINT, EIGHT, BYTES, FOUR = 0, 1, 2, 5
"""Kinds of a field on the wire."""
Raw = int | bytes
_MOST_FIELDS = 100_000


def fields(raw: bytes) -> dict[int, list[tuple[int, Raw]]]:
    """Number of each field, and every value of it with its kind: an integer, or the bytes."""
    found: dict[int, list[tuple[int, Raw]]] = {}
    at = seen = 0
    while at < len(raw):
        key, at = varint(raw, at)
        value, at = _value(raw, at, key & 7)
        seen += 1
        if not key >> 3 or seen > _MOST_FIELDS:
            raise Unreadable(f"field {key >> 3}, the {seen}th of a message of {len(raw)} bytes")
        found.setdefault(key >> 3, []).append((key & 7, value))
    return found


def varint(raw: bytes, at: int) -> tuple[int, int]:
    """The integer at ``at``, seven bits a byte, the lowest first; and where it ends."""
    value = 0
    for i, byte in enumerate(raw[at : at + 10]):
        value |= (byte & 0x7F) << 7 * i
        if not byte & 0x80:
            return value & 0xFFFF_FFFF_FFFF_FFFF, at + i + 1
    raise Unreadable(f"an integer at byte {at} of a message of {len(raw)} bytes does not end")


def _value(raw: bytes, at: int, kind: int) -> tuple[Raw, int]:
    if kind == VARINT:
        return varint(raw, at)
    if kind == BYTES:
        count, at = varint(raw, at)
    elif kind in (EIGHT, FOUR):
        count = 8 if kind == EIGHT else 4
    else:
        raise Unreadable(f"a field of kind {kind} at byte {at}")
    if at + count > len(raw):
        raise Unreadable(f"{count} bytes at byte {at} go beyond the {len(raw)} bytes of a message")
    return raw[at : at + count], at + count
