"""The tree of arrays in a variable: numbers, texts, structures and cells."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod

from ..stream import damaged
from .content import Content

MATRIX, COMPRESSED = 14, 15
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Types of numbers as they lie in the file."""
CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
"""Classes of numeric arrays."""
CELL, STRUCT, OBJECT, CHAR, SPARSE = 1, 2, 3, 4, 5
_NAMES = {SPARSE: "a sparse matrix", OBJECT: "an object", 16: "a function", 17: "an opaque object", 18: "an object"}
_DEEPEST, _MOST = 32, 100_000


@dataclass(frozen=True)
class Element:
    """Type of a piece of data, and where its bytes lie in the content."""

    kind: int
    begin: int
    count: int
    next: int


@dataclass(frozen=True)
class Array:
    """A numeric or text array: path, class, dimensions, real part and imaginary part."""

    path: str
    kind: int
    dimensions: tuple[int, ...]
    parts: tuple[Element, ...]
    content: Content

    @property
    def size(self) -> int:
        """Number of values."""
        return prod(self.dimensions)


@dataclass(frozen=True)
class Other:
    """Something that is no array of numbers or letters, in words."""

    path: str
    what: str


@dataclass
class Walk:
    """Reads the arrays of one variable; ``order`` is the byte order."""

    content: Content
    order: str
    seen: int = 0

    def element(self, offset: int) -> Element:
        """The tag at ``offset``; small data lie inside their tag."""
        first, second = struct.unpack(f"{self.order}II", self.content.read(offset, 8, "a tag"))
        if first >> 16:
            return Element(first & 0xFFFF, offset + 4, min(first >> 16, 4), offset + 8)
        return Element(first, offset + 8, second, offset + 8 + second + (-second % 8))

    def raw(self, element: Element, limit: int = 1 << 20) -> bytes:
        """The bytes of an element that is short."""
        if element.count > limit:
            raise damaged(self.content.path, f"{element.count} bytes at byte {element.begin} of a variable's header")
        return self.content.read(element.begin, element.count, "a variable's header")

    def arrays(self, offset: int, path: str | None = None, depth: int = 0) -> Iterator[Array | Other]:
        """All arrays of the matrix whose tag is at ``offset``; below a name, ``path`` is what they are called."""
        matrix = self.element(offset)
        self.seen += 1
        if matrix.kind != MATRIX or depth > _DEEPEST or self.seen > _MOST:
            message = f"type {matrix.kind} at depth {depth}, array {self.seen}; expected a matrix"
            raise damaged(self.content.path, f"{path or 'a variable'}: {message}")
        if not matrix.count:
            return
        flags = self.element(matrix.begin)
        dimensions = self.element(flags.next)
        name = self.element(dimensions.next)
        said = self.raw(flags)
        if len(said) < 4:
            raise damaged(self.content.path, f"{path or 'a variable'}: flags of {len(said)} bytes")
        kind, is_complex = (said[0], said[1] & 8) if self.order == "<" else (said[3], said[2] & 8)
        sizes = struct.unpack(
            f"{self.order}{dimensions.count // 4}i", self.raw(dimensions)[: dimensions.count // 4 * 4]
        )
        path = self.raw(name).decode("latin-1") if path is None else path
        if any(size < 0 for size in sizes):
            raise damaged(self.content.path, f"{path}: dimensions {sizes}")
        if kind in CLASSES or kind == CHAR:
            yield self._array(path, kind, sizes, name.next, bool(is_complex))
        elif kind == CELL:
            yield from self._items(path, sizes, name.next, depth)
        elif kind == STRUCT:
            yield from self._fields(path, sizes, name.next, depth)
        else:
            yield Other(path, _NAMES.get(kind, f"an array of class {kind}"))

    def _array(self, path: str, kind: int, sizes: tuple[int, ...], offset: int, is_complex: bool) -> Array:
        array = Array(path, kind, sizes, (), self.content)
        if not array.size:
            return array
        parts = [self.element(offset)]
        if is_complex:
            parts.append(self.element(parts[0].next))
        return Array(path, kind, sizes, tuple(parts), self.content)

    def _items(self, path: str, sizes: tuple[int, ...], offset: int, depth: int) -> Iterator[Array | Other]:
        for i in range(prod(sizes)):
            yield from self.arrays(offset, f"{path}{{{i + 1}}}", depth + 1)
            offset = self.element(offset).next

    def _fields(self, path: str, sizes: tuple[int, ...], offset: int, depth: int) -> Iterator[Array | Other]:
        length_of_names = self.element(offset)
        listed = self.element(length_of_names.next)
        (length,) = struct.unpack(f"{self.order}i", self.raw(length_of_names)[:4].ljust(4, b"\0"))
        text = self.raw(listed)
        if length < 1:
            raise damaged(self.content.path, f"{path}: names of fields of {length} letters")
        names = [text[i : i + length].split(b"\0")[0].decode("latin-1") for i in range(0, len(text), length)]
        offset, several = listed.next, prod(sizes) > 1
        for i in range(prod(sizes)):
            for name in names:
                yield from self.arrays(offset, f"{path}{f'({i + 1})' if several else ''}.{name}", depth + 1)
                offset = self.element(offset).next
