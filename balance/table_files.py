"""Tables of numbers as CSV and as Parquet, without a library of 180 MB for it.

Parquet is written as its specification has it (https://parquet.apache.org/docs/file-format): one plain uncompressed
page a column and row group, metadata in Thrift's compact protocol, no empty values.
"""

import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

_ROWS = 1 << 15
"""Rows of CSV that are spelled at once."""
_GROUP_ROWS = 1 << 18
"""Rows of a row group of Parquet."""
_MAGIC = b"PAR1"
_PHYSICAL = {"i4": 1, "i8": 2, "f4": 4, "f8": 5}
"""Physical types of Parquet by those of NumPy."""
_REQUIRED, _PLAIN, _RLE, _DATA_PAGE, _UNCOMPRESSED = 0, 0, 3, 0, 0
Column = NDArray[Any]
Value = int | str | list[Any] | dict[int, Any]


def write_csv(
    stream: IO[bytes],
    columns: Sequence[Column],
    separator: str = ",",
    decimals: int | None = None,
    decimal_comma: bool = False,
) -> None:
    """Write rows of columns (n,) each, with so many decimals, or the shortest text that reads back to the number."""
    form = separator.join([f"%.{decimals}f" if decimals is not None else "%r"] * len(columns)) + "\n"
    for begin in range(0, len(columns[0]) if columns else 0, _ROWS):
        rows = zip(*(column[begin : begin + _ROWS].tolist() for column in columns), strict=True)
        text = "".join([form % row for row in rows])
        stream.write((text.replace(".", ",") if decimal_comma else text).encode())


def write_csv_file(path: str | Path, columns: Mapping[str, Column], comment: str = "") -> None:
    """Write columns (n,) under their names, below a comment line if there is one."""
    with Path(path).open("wb") as stream:
        stream.write((comment + ",".join(columns) + "\n").encode())
        write_csv(stream, list(columns.values()))


def write_parquet(path: str | Path, columns: Mapping[str, Column], metadata: Mapping[str, str] | None = None) -> None:
    """Write columns (n,) of floats or integers under their names, with texts by key in the metadata of the file."""
    plain = {name: _plain(values) for name, values in columns.items()}
    rows = len(next(iter(plain.values()))) if plain else 0
    schema: list[Value] = [{4: "schema", 5: len(plain)}]
    schema += [{1: _PHYSICAL[values.dtype.str[1:]], 3: _REQUIRED, 4: name} for name, values in plain.items()]
    with Path(path).open("wb") as stream:
        stream.write(_MAGIC)
        groups = [_row_group(stream, plain, begin) for begin in range(0, rows, _GROUP_ROWS)]
        pairs: list[Value] = [{1: key, 2: text} for key, text in (metadata or {}).items()]
        footer = _struct({1: 1, 2: schema, 3: _Long(rows), 4: groups, 5: pairs, 6: "counterpoise"})
        stream.write(footer + struct.pack("<I", len(footer)) + _MAGIC)


class _Long(int):
    """An integer of 64 bits, which Thrift marks as such."""


def _plain(values: Column) -> Column:
    """The values as Parquet stores them: floats and integers of 4 or 8 bytes, little-endian."""
    kind = "i" if values.dtype.kind in "biu" else "f"
    return np.ascontiguousarray(values, dtype=f"<{kind}{4 if values.dtype.itemsize == 4 else 8}")


def _row_group(stream: IO[bytes], columns: Mapping[str, Column], begin: int) -> dict[int, Value]:
    """Write the rows from ``begin`` on, a page a column; what the footer says of them."""
    chunks: list[Value] = []
    total, count = 0, 0
    for name, column in columns.items():
        values = column[begin : begin + _GROUP_ROWS]
        page: dict[int, Value] = {
            1: _DATA_PAGE,
            2: values.nbytes,
            3: values.nbytes,
            5: {1: len(values), 2: _PLAIN, 3: _RLE, 4: _RLE},
        }
        offset, header = stream.tell(), _struct(page)
        stream.write(header)
        stream.write(values.data)
        size, count = _Long(len(header) + values.nbytes), len(values)
        about = {1: _PHYSICAL[values.dtype.str[1:]], 2: [_PLAIN], 3: [name], 4: _UNCOMPRESSED, 5: _Long(count)}
        chunks.append({2: _Long(offset), 3: {**about, 6: size, 7: size, 9: _Long(offset)}})
        total += size
    return {1: chunks, 2: _Long(total), 3: _Long(count)}


_INT, _LONG, _BINARY, _LIST, _STRUCT = 5, 6, 8, 9, 12


def _kind(value: Value) -> int:
    if isinstance(value, int):
        return _LONG if isinstance(value, _Long) else _INT
    return _BINARY if isinstance(value, str) else _LIST if isinstance(value, list) else _STRUCT


def _struct(fields: Mapping[int, Value]) -> bytes:
    """A struct of Thrift by the numbers of its fields, in their order."""
    return b"".join(_fields(fields)) + b"\0"


def _fields(fields: Mapping[int, Value]) -> Iterator[bytes]:
    last = 0
    for number, value in fields.items():
        yield bytes([(number - last) << 4 | _kind(value)]) + _encoded(value)
        last = number


def _encoded(value: Value) -> bytes:
    if isinstance(value, int):
        return _varint(value << 1 ^ value >> 63)
    if isinstance(value, str):
        raw = value.encode()
        return _varint(len(raw)) + raw
    if isinstance(value, list):
        kind = _kind(value[0]) if value else _STRUCT
        return bytes([0xF0 | kind]) + _varint(len(value)) + b"".join(map(_encoded, value))
    return _struct(value)


def _varint(number: int) -> bytes:
    """Seven bits a byte, the lowest first."""
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*out, number])
