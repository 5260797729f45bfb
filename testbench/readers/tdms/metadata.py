"""What a segment declares: its objects, their properties, and how their raw data lie."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field

from . import types

Property = str | int | float | bool
_NONE, _SAME = 0xFFFFFFFF, 0
_DAQMX_FORMAT, _DAQMX_LINES = 0x1269, (0x126A, 0x1369)
_SIMPLE = {1: "b", 2: "h", 3: "i", 4: "q", 5: "B", 6: "H", 7: "I", 8: "Q", 9: "f", 10: "d", 0x19: "f", 0x1A: "d"}


@dataclass(frozen=True)
class Scaler:
    """One raw number of a DAQmx channel: its type, buffer, place in a row of the buffer, and scale."""

    kind: int
    buffer: int
    offset: int
    scale: int


@dataclass(frozen=True)
class Index:
    """How the raw data of an object lie in each chunk: type, number of values, bytes if they are no numbers."""

    kind: int
    values: int
    bytes: int = 0
    scalers: tuple[Scaler, ...] = ()
    widths: tuple[int, ...] = ()


@dataclass
class Declared:
    """The objects of one segment: raw data by path (None: none), and new properties by path."""

    indexes: dict[str, Index | None] = field(default_factory=dict)
    properties: dict[str, dict[str, Property]] = field(default_factory=dict)


class Unreadable(Exception):
    """Metadata that are not what they should be; the text says how."""


class Cursor:
    """Reads values one after the other from the bytes of a segment's metadata."""

    def __init__(self, raw: bytes, order: str) -> None:
        self.raw, self.order, self.at = raw, order, 0

    def take(self, form: str) -> tuple[int | float, ...]:
        """Values of a ``struct`` format."""
        try:
            values = struct.unpack_from(self.order + form, self.raw, self.at)
        except struct.error as error:
            raise Unreadable(f"they end inside a value at their byte {self.at}") from error
        self.at += struct.calcsize(self.order + form)
        return values

    def integer(self) -> int:
        """An unsigned integer of 32 bits."""
        return int(self.take("I")[0])

    def text(self) -> str:
        """A length and as many bytes of UTF-8."""
        length = self.integer()
        raw = self.raw[self.at : self.at + length]
        if len(raw) < length:
            raise Unreadable(f"a text of {length} bytes at their byte {self.at} goes beyond them")
        self.at += length
        return raw.decode("utf-8", "replace")


def parse(raw: bytes, order: str, known: Mapping[str, Index | None]) -> Declared:
    """The objects that the bytes ``raw`` declare; ``known`` holds the raw data that each had before."""
    cursor, declared = Cursor(raw, order), Declared()
    for _ in range(cursor.integer()):
        path = cursor.text()
        header = cursor.integer()
        if header == _NONE:
            declared.indexes[path] = None
        elif header == _SAME:
            if path not in known:
                raise Unreadable(f"{path} has raw data as before, but there was nothing before")
            declared.indexes[path] = known[path]
        elif header == _DAQMX_FORMAT:
            declared.indexes[path] = _daqmx(cursor)
        elif header in _DAQMX_LINES:
            raise Unreadable(f"{path} holds lines of digital DAQmx data, which are not read")
        else:
            declared.indexes[path] = _index(cursor)
        properties = declared.properties.setdefault(path, {})
        for _ in range(cursor.integer()):
            name = cursor.text()
            properties[name] = _property(cursor, name)
    return declared


def _index(cursor: Cursor) -> Index:
    kind, dimension, values = (int(x) for x in cursor.take("IIQ"))
    if dimension != 1:
        raise Unreadable(f"an array of {dimension} dimensions; expected 1")
    size = int(cursor.take("Q")[0]) if kind == types.STRING else 0
    return Index(kind, values, size)


def _daqmx(cursor: Cursor) -> Index:
    kind, dimension, values, count = (int(x) for x in cursor.take("IIQI"))
    if dimension != 1:
        raise Unreadable(f"an array of {dimension} dimensions; expected 1")
    scalers = []
    for _ in range(count):
        number, buffer, offset, _, scale = (int(x) for x in cursor.take("5I"))
        scalers.append(Scaler(number, buffer, offset, scale))
    widths = tuple(cursor.integer() for _ in range(cursor.integer()))
    if any(scaler.buffer >= len(widths) for scaler in scalers):
        raise Unreadable("a DAQmx channel lies in a buffer that there is not")
    return Index(kind, values, 0, tuple(scalers), widths)


def _property(cursor: Cursor, name: str) -> Property:
    kind = cursor.integer()
    if kind == types.STRING:
        return cursor.text()
    if kind == types.BOOLEAN:
        return bool(cursor.take("B")[0])
    if kind == types.TIME:
        first, second = cursor.take("Qq") if cursor.order == "<" else cursor.take("qQ")[::-1]
        return float(second + types.EPOCH_1904) + float(first) * 2.0**-64
    if kind in _SIMPLE:
        return cursor.take(_SIMPLE[kind])[0]
    raise Unreadable(f"property {name!r} is of type {kind:#x}, which is not known")
