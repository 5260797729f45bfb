"""The numbers of an array in blocks: a vector is one channel, a matrix one for each of its short side."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...recording import Channel, Samples
from ..series import Series
from ..stream import as_float64, block_samples, damaged
from .elements import CHAR, CLASSES, NUMBERS, Array, Element

MOST_CHANNELS = 4096
_EXACT = 2.0**53
_WIDE = (14, 15)
_SINGLE = 7


@dataclass(frozen=True)
class Columns:
    """A real or imaginary part as columns: side by side (``along`` false), or one number of each in turn."""

    array: Array
    part: Element
    order: str
    width: int
    length: int
    along: bool

    def block(self, begin: int, end: int) -> list[Samples]:
        """Samples ``begin`` to before ``end`` of all columns."""
        if self.along:
            numbers = self._numbers(begin * self.width, end * self.width)
            return [numbers[i :: self.width] for i in range(self.width)]
        return [self._numbers(i * self.length + begin, i * self.length + end) for i in range(self.width)]

    def _numbers(self, begin: int, end: int) -> Samples:
        stored = np.dtype(self.order + NUMBERS[self.part.kind])
        count = (end - begin) * stored.itemsize
        raw = self.array.content.read(self.part.begin + begin * stored.itemsize, count, self.array.path)
        numbers = np.frombuffer(raw, dtype=stored)
        return as_float64(numbers.astype(np.float32) if self.array.kind == _SINGLE else numbers)


def columns(array: Array, order: str) -> tuple[tuple[str, ...], tuple[Columns, ...]] | None:
    """Names of the columns and the parts that hold them; None for an array that is no series of samples."""
    sides = [size for size in array.dimensions if size != 1]
    if len(sides) > 2 or not sides or min([*sides, MOST_CHANNELS]) > MOST_CHANNELS or array.kind not in CLASSES:
        return None
    length = max(sides)
    width, along = array.size // length, len(sides) == 2 and sides[0] < sides[1]
    if width > MOST_CHANNELS:
        return None
    checked(array)
    pattern = "({i},:)" if along else "(:,{i})"
    names = [array.path + (pattern.format(i=i + 1) if width > 1 else "") for i in range(width)]
    parts = tuple(Columns(array, part, order, width, length, along) for part in array.parts)
    if len(parts) == 2:
        return tuple(f"{name} ({side})" for side in ("real", "imag") for name in names), parts
    return tuple(names), parts


def checked(array: Array) -> None:
    """Refuse an array whose dimensions and bytes do not agree."""
    for part in array.parts:
        size = np.dtype(NUMBERS[part.kind]).itemsize if part.kind in NUMBERS else 0
        if not size or part.count != array.size * size:
            message = f"{array.path}: {array.dimensions} values of type {part.kind} in {part.count} bytes"
            raise damaged(array.content.path, message)
        array.content.read(part.begin + part.count - 1, 1, array.path)


def series(array: Array, order: str) -> Series | None:
    """The array as a series of samples."""
    found = columns(array, order)
    if found is None:
        return None
    names, parts = found

    def block(begin: int, end: int) -> Sequence[Samples]:
        return [column for part in parts for column in part.block(begin, end)]

    root = array.path.split(".")[0].split("{")[0].split("(")[0]
    return Series(
        root if root != array.path else "",
        tuple(Channel(name) for name in names),
        parts[0].length,
        block,
        may_be_time=len(parts) == 1,
    )


def is_beyond_exact(array: Array, series: Series) -> bool:
    """Whether integers of 64 bits are too large for float64."""
    if array.kind not in _WIDE:
        return False
    step = block_samples(len(series.channels))
    return any(
        (np.abs(column) >= _EXACT).any()
        for begin in range(0, series.length, step)
        for column in series.block(begin, min(begin + step, series.length))
    )


def scalar(array: Array, order: str) -> float | complex | None:
    """The only number of an array; None if it has more, or none."""
    if array.size != 1 or array.kind not in CLASSES or not array.parts:
        return None
    checked(array)
    values = [float(Columns(array, part, order, 1, 1, False).block(0, 1)[0][0]) for part in array.parts]
    return values[0] if len(values) == 1 else complex(*values)


def text(array: Array, order: str) -> str | None:
    """The text of an array of letters of one row."""
    if array.kind != CHAR or (array.parts and array.parts[0].count > 1 << 16):
        return None
    if not array.parts:
        return ""
    raw = array.content.read(array.parts[0].begin, array.parts[0].count, array.path)
    encodings = {1: "latin-1", 2: "latin-1", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
    encoding = encodings.get(array.parts[0].kind, "utf-16")
    if encoding in ("utf-16", "utf-32"):
        encoding += "-le" if order == "<" else "-be"
    return raw.decode(encoding, "replace")
