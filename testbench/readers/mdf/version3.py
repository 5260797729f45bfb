"""MDF version 3 (and 2): blocks with 32-bit links, data groups, channel groups, channels and their conversions."""

import math
import struct
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from ...recording import Finding, StartTime, point_in_time
from .. import header_claims
from ..byte_source import BLOCK_BYTES, ByteSource
from ..format_findings import damaged
from . import conversions
from .conversions import Conversion
from .records import DataGroup, File, Member, Records, TextMember, linked

_LETTERS, _BYTES = 7, 8
_KINDS: tuple[Literal["u", "i", "f"], ...] = ("u", "i", "f", "f")
_FORMULA, _TEXTS, _NONE = 10, (11, 12), 0xFFFF


def _polynomial(p: list[float]) -> Conversion | None:
    is_none = p == [0.0, -1.0, -1.0, 0.0, 0.0, 0.0] or not all(map(math.isfinite, p))
    return None if is_none else conversions.polynomial(p)


_LAWS: Mapping[int, tuple[int, Callable[[list[float]], Conversion | None]]] = {
    0: (2, lambda p: conversions.linear(p[0], p[1])),
    1: (0, lambda p: conversions.table(p[::2], p[1::2], interpolate=True)),
    2: (0, lambda p: conversions.table(p[::2], p[1::2], interpolate=False)),
    6: (6, _polynomial),
    7: (7, lambda p: conversions.logarithmic(p, np.log)),
    8: (7, lambda p: conversions.logarithmic(p, np.exp)),
    9: (6, conversions.rational),
}
"""How many numbers a conversion of each type has (0: as many pairs as it counts), and its law."""


class Walk:
    """Reads the blocks of one file; ``order`` is its byte order."""

    def __init__(self, source: ByteSource, unfinished: bool) -> None:
        self.source, self.unfinished = source, unfinished
        (little,) = struct.unpack("<H", source.read(24, 2, "the byte order"))
        self.order: Literal["<", ">"] = ">" if little else "<"
        self.file = File(source.read(8, 8, "the version").decode("latin-1").strip(" \0"))

    def block(self, address: int, kind: bytes) -> bytes:
        """The block at ``address``."""
        mark, size = struct.unpack(f"{self.order}2sH", self.source.read(address, 4, "a block"))
        if mark != kind or size < 4:
            message = f"byte {address}: {mark!r} of {size} bytes; expected a block {kind.decode()}"
            raise damaged(self.source.path, message)
        return self.source.read(address, size, f"the block {kind.decode()}")

    def take(self, form: str, raw: bytes, at: int) -> tuple[int, ...]:
        """Values of a ``struct`` format."""
        try:
            return struct.unpack_from(self.order + form, raw, at)
        except struct.error as error:
            raise damaged(self.source.path, f"a block {raw[:2]!r} of {len(raw)} bytes is too short") from error

    def chain(self, address: int, kind: bytes) -> Iterator[bytes]:
        """The blocks of a list, each linking to the next."""
        path, block = self.source.path, partial(self.block, kind=kind)
        return linked(path, address, kind.decode(), block, lambda raw: self.take("I", raw, 4)[0])

    def text(self, address: int) -> str:
        """The text of a TX block; empty if there is none."""
        return _text(self.block(address, b"TX")[4:]) if address else ""


def read_version3(source: ByteSource, unfinished: bool) -> File:
    """All blocks of the file but its samples."""
    walk = Walk(source, unfinished)
    header = walk.block(64, b"HD")
    first, comment = walk.take("II", header, 4)
    if text := walk.text(comment):
        walk.file.metadata["comment"] = text
    walk.file.metadata["start"] = f"{_text(header[18:28])} {_text(header[28:36])}"
    walk.file.zero = _start(walk, header)
    for name, at in (("author", 36), ("organisation", 68), ("project", 100), ("subject", 132)):
        if text := _text(header[at : at + 32]):
            walk.file.metadata[name] = text
    for i, raw in enumerate(walk.chain(first, b"DG"), 1):
        _data_group(walk, raw, i)
    return walk.file


def _start(walk: Walk, header: bytes) -> StartTime | None:
    """The start: in nanoseconds of local time and hours from UTC, since version 3.20, else the date and time of day."""
    if len(header) >= 176 and (local := walk.take("Q", header, 164)[0]):
        (hours,) = walk.take("h", header, 172)
        return point_in_time(local - hours * 3600 * 10**9, "start time of the header", 1e-9, 60 * hours)
    day, month, year = (_text(header[18:28]).split(":") + ["", "", ""])[:3]
    return header_claims.start_at(f"{year}-{month}-{day} {_text(header[28:36])}", "start time of the header")


def _data_group(walk: Walk, raw: bytes, number: int) -> None:
    first, _, begin = walk.take("III", raw, 8)
    _, identifiers = walk.take("HH", raw, 20)
    if identifiers > 2:
        raise damaged(walk.source.path, f"data group {number}: {identifiers} identifiers a record")
    records = tuple(_records(walk, group, number, i) for i, group in enumerate(walk.chain(first, b"CG"), 1))
    if not records or not any(r.members for r in records):
        return
    size = (records[0].size or 0) + identifiers
    total = sum(((r.size or 0) + identifiers) * (r.declared or 0) for r in records)
    there = max(0, walk.source.size - begin)
    if not walk.unfinished:
        there = min(total, there) if begin else 0
    if there < total and not walk.unfinished:
        message = f"the file is cut: {total - there} of {total} bytes of data group {number} are missing"
        if len(records) == 1:
            message += f"; {there // max(size, 1)} of {records[0].declared} samples are there"
        walk.file.findings.append(Finding("cut_file", None, f"byte {begin}", message))
    pieces = partial(_pieces, walk.source.path, begin, begin + there)
    identifier_size = 1 if identifiers else 0
    walk.file.groups.append(DataGroup(identifier_size, identifiers == 2, walk.order, records, pieces, there))


def _pieces(path: Path, begin: int, end: int) -> Iterator[bytes]:
    with ByteSource(path) as source:
        for at in range(begin, end, BLOCK_BYTES):
            yield source.read(at, min(BLOCK_BYTES, end - at), "samples")


def _records(walk: Walk, raw: bytes, number: int, i: int) -> Records:
    first, comment = walk.take("II", raw, 8)
    identifier, _, size, declared = walk.take("HHHI", raw, 16)
    name = walk.text(comment) or f"group {number}" + (f".{i}" if i > 1 else "")
    members = [m for block in walk.chain(first, b"CN") if (m := _member(walk, block, size)) is not None]
    texts = tuple(m for m in members if isinstance(m, TextMember))
    numbers = tuple(m for m in members if isinstance(m, Member))
    return Records(name, identifier, size, size, declared, numbers, texts=texts)


def _member(walk: Walk, raw: bytes, size: int) -> Member | TextMember | None:
    (address,) = walk.take("I", raw, 8)
    kind, start, bits, form = walk.take("H", raw, 24) + walk.take("3H", raw, 186)
    long_name = walk.take("I", raw, 218)[0] if len(raw) >= 222 else 0
    extra = walk.take("H", raw, 226)[0] if len(raw) >= 228 else 0
    name = walk.text(long_name) or _text(raw[26:58])
    if form == _LETTERS and start % 8 == 0 and 0 < bits // 8 <= size - extra - start // 8:
        return TextMember(name, extra + start // 8, bits // 8, "latin-1")
    if form in (_LETTERS, _BYTES):
        walk.file.texts.append(name)
        return None
    # 0 to 3 are in the file's byte order, 9 to 12 big-endian, 13 to 16 little-endian
    own: tuple[tuple[int, Literal["<", ">"]], ...] = ((0, walk.order), (9, ">"), (13, "<"))
    known = next(((_KINDS[form - base], order) for base, order in own if base <= form <= base + 3), None)
    if known is None:
        walk.file.left_out.append(f"{name} (of data type {form})")
        return None
    conversion, unit = _conversion(walk, address, name)
    member = Member(name, unit, known[0], known[1], extra + start // 8, start % 8, bits, conversion, kind == 1)
    if not member.fits(size):
        message = f"channel {name!r}: {bits} bits from bit {start} of {size} bytes a record"
        raise damaged(walk.source.path, message)
    return member


def _conversion(walk: Walk, address: int, name: str) -> tuple[Conversion | None, str | None]:
    if not address:
        return None, None
    raw = walk.block(address, b"CC")
    unit = _text(raw[22:42]) or None
    kind, count = walk.take("HH", raw, 42)
    if kind in _TEXTS or kind == _NONE:
        return None, unit
    try:
        if kind == _FORMULA:
            converted: Conversion | None = conversions.formula(_text(raw[46:]))
        else:
            if kind not in _LAWS or not (size := _LAWS[kind][0] or 2 * count):
                raise ValueError(f"{count} values; it is not known, or empty")
            converted = _LAWS[kind][1]([float(v) for v in walk.take(f"{size}d", raw, 46)])
    except ValueError as error:
        raise damaged(walk.source.path, f"channel {name!r}: its conversion of type {kind}: {error}") from error
    walk.file.converted += converted is not None
    return converted, unit


def _text(raw: bytes) -> str:
    return raw.split(b"\0")[0].decode("latin-1").strip()
