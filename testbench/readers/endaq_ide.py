"""The elements at the top of an EBML file, one behind the other: are they all there?

enDAQ recordings (``.IDE``). ``elements`` checks that the file is whole, ``library`` reads it with idelib.
"""

from dataclasses import dataclass

from ..recording import Finding
from .byte_source import ByteSource, damaged

MAGIC = b"\x1aE\xdf\xa3"
_DATA_BLOCK = 0xA1
_WINDOW = 12


@dataclass(frozen=True)
class Whole:
    """Up to which byte the elements are whole, and why not to the end."""

    end: int
    findings: tuple[Finding, ...] = ()


def check(source: ByteSource) -> Whole:
    """Walk through the elements; a file that ends inside one is cut."""
    at, number, blocks = 0, 0, 0
    while at < source.size:
        head = source.read(at, min(_WINDOW, source.size - at), "an element")
        if not head.strip(b"\0") or not head.strip(b"\xff"):
            return Whole(at, _filled(source, at))
        identifier, used = _integer(head, keep_mark=True)
        size, more = _integer(head[used:], keep_mark=False)
        if not used or not more:
            if len(head) < _WINDOW:
                return Whole(at, (_cut(source, at, number, blocks),))
            raise damaged(source.path, f"byte {at}: {head[:4].hex()} begins no element")
        end = at + used + more + size
        if end > source.size:
            return Whole(at, (_cut(source, at, number, blocks),))
        at, number, blocks = end, number + 1, blocks + (identifier == _DATA_BLOCK)
    if not blocks:
        message = f"{number} elements, and no block of samples among them"
        return Whole(at, (Finding("no_data", None, None, message),))
    return Whole(at)


def _integer(raw: bytes, keep_mark: bool) -> tuple[int, int]:
    """A number of EBML, whose leading zero bits say its length; and how many bytes it takes, 0 if it is none."""
    if not raw or not raw[0]:
        return 0, 0
    length = 9 - raw[0].bit_length()
    if length > len(raw) or (keep_mark and length > 4):
        return 0, 0
    value = int.from_bytes(raw[:length], "big")
    return (value if keep_mark else value & (1 << 7 * length) - 1), length


def _cut(source: ByteSource, at: int, number: int, blocks: int) -> Finding:
    message = (
        f"the file ends at byte {source.size} inside element {number + 1}, which begins at byte {at}; "
        f"{blocks} whole blocks of samples come before it"
    )
    return Finding("cut_file", None, f"byte {at}", message)


def _filled(source: ByteSource, at: int) -> tuple[Finding, ...]:
    """The rest of the file, if it is all zero or all one, was set aside and never written."""
    for begin in range(at, source.size, 1 << 20):
        piece = source.read(begin, min(1 << 20, source.size - begin), "the end")
        if piece.strip(b"\0") and piece.strip(b"\xff"):
            raise damaged(source.path, f"byte {at}: {source.size - at} bytes that are no element")
    message = f"from byte {at} on the file was set aside and never written: {source.size - at} empty bytes"
    return (Finding("cut_file", None, f"byte {at}", message),)
