"""The parameter section of a C3D file: groups of named values, in one of three byte orders."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..stream import ByteSource, as_float64, damaged

BLOCK = 512
INTEL, DEC, SGI = 84, 85, 86
Values = NDArray[np.float64] | tuple[str, ...]


@dataclass(frozen=True)
class Parameters:
    """Values by ``GROUP:NAME`` in capitals, numbers in Fortran's order; the processor whose numbers the file holds."""

    processor: int
    values: Mapping[str, Values]

    @property
    def order(self) -> str:
        """Byte order of integers."""
        return ">" if self.processor == SGI else "<"

    def numbers(self, name: str) -> NDArray[np.float64]:
        """The numbers of a parameter; none if there is no such one."""
        found = self.values.get(name, ())
        return found if isinstance(found, np.ndarray) else np.empty(0)

    def number(self, name: str) -> float | None:
        """The first number of a parameter."""
        found = self.numbers(name)
        return float(found[0]) if len(found) else None

    def texts(self, name: str) -> tuple[str, ...]:
        """The texts of a parameter and of those that continue it: LABELS, LABELS2, LABELS3, ..."""
        found: tuple[str, ...] = ()
        for key in [name, *(f"{name}{i}" for i in range(2, 100))]:
            value = self.values.get(key)
            if not isinstance(value, tuple):
                break
            found += value
        return found


def floats(raw: bytes, processor: int) -> NDArray[np.float64]:
    """Four-byte floats of a processor.

    DEC's F float has its 16-bit halves swapped and an exponent larger by two: value = IEEE(halves swapped) / 4.
    """
    if processor == DEC:
        swapped = np.frombuffer(raw, dtype="<u2").reshape(-1, 2)[:, ::-1].copy()
        return as_float64(swapped.view("<f4").ravel()) / 4.0
    return as_float64(np.frombuffer(raw, dtype=">f4" if processor == SGI else "<f4"))


def read(source: ByteSource, first_block: int) -> Parameters:
    """The parameter section that begins at block ``first_block`` (from 1)."""
    begin = (first_block - 1) * BLOCK
    head = source.read(begin, 4, "the head of the parameters")
    blocks, processor = head[2], head[3]
    if processor not in (INTEL, DEC, SGI):
        raise damaged(source.path, f"processor {processor} at byte {begin + 3}; expected 84, 85 or 86")
    section = source.read(begin, min(max(1, blocks) * BLOCK, source.size - begin), "the parameters")
    try:
        return Parameters(processor, _parsed(section, processor))
    except (struct.error, IndexError, ValueError) as error:
        raise damaged(source.path, f"the parameters from byte {begin} on cannot be read ({error})") from error


def _parsed(section: bytes, processor: int) -> dict[str, Values]:
    order = ">" if processor == SGI else "<"
    groups: dict[int, str] = {}
    found: list[tuple[int, str, Values]] = []
    at = 4
    while at + 2 <= len(section):
        length, number = struct.unpack_from("bb", section, at)
        if length == 0 or number == 0:
            break
        name = section[at + 2 : at + 2 + abs(length)].decode("latin-1").strip().upper()
        after = at + 2 + abs(length)
        (offset,) = struct.unpack_from(f"{order}H", section, after)
        if number < 0:
            groups[-number] = name
        else:
            found.append((number, name, _value(section, after + 2, processor)))
        if offset < 3:
            break
        at = after + offset
    return {f"{groups.get(number, number)}:{name}": value for number, name, value in found}


def _value(section: bytes, at: int, processor: int) -> Values:
    kind, dimensions = struct.unpack_from("bB", section, at)
    if abs(kind) not in (1, 2, 4):
        raise ValueError(f"type {kind}")
    sizes = [int(size) for size in section[at + 2 : at + 2 + dimensions]]
    count = int(np.prod(sizes, dtype=np.int64)) if sizes else 1
    begin = at + 2 + dimensions
    raw = section[begin : begin + count * abs(kind)]
    if len(sizes) != dimensions or len(raw) != count * abs(kind):
        raise ValueError(f"{count} values at byte {begin} lie beyond its end")
    if kind == -1:
        width = sizes[0] if sizes else 1
        return tuple(text(raw[i : i + width]) for i in range(0, count, width)) if width else ()
    if kind == 4:
        return floats(raw, processor)
    order = ">" if processor == SGI else "<"
    return np.frombuffer(raw, dtype="i1" if abs(kind) == 1 else f"{order}i2").astype(np.float64)


def text(raw: bytes) -> str:
    """A text without the blanks that fill it up; in UTF-8, or else in the letters of Western Europe."""
    try:
        return raw.decode("utf-8").strip(" \0")
    except UnicodeDecodeError:
        return raw.decode("cp1252", "replace").strip(" \0")
