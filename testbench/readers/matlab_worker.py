"""MATLAB files of version 4 and 5 (also 6 and 7): scipy reads the variables, one after the other.

What scipy does not say is found here: where a cut file ends and which variable is the last whole one; that a
compressed variable is damaged, or unpacks to far more than it should; variables of one name. Objects, functions and
sparse matrices are left out by name and never given to scipy. Files of version 4 scipy gets part by part: of complex
numbers whose imaginary part is no finite number it would make NaN of the real part.
"""

import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from io import BytesIO
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque, MatReadError
from scipy.sparse import issparse

from ..recording import Finding, Recording, Refusal
from .array_grouping import MATLAB_INDEX, Contents, array_series
from .byte_source import ByteSource
from .format_findings import cut, damaged, refusing

_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OPAQUE = 1, 2, 17
_LEFT_OUT = {3: "an object", 5: "a sparse matrix", 16: "a function", _OPAQUE: "an opaque object", 18: "an object"}
_HEADER_4, _HEADER_5 = struct.calcsize("5i"), 128
_SIZES_4 = {0: 8, 1: 4, 2: 4, 3: 2, 4: 2, 5: 1}
"""Bytes of a number of version 4, by the third digit of its type."""
_SPARSE_4 = 2
_MOST_VARIABLES, _LONGEST_NAME, _LONGEST_TEXT = 100_000, 256, 1 << 16
_MOST_RATIO, _ALWAYS_ALLOWED, _MOST_BYTES = 200, 64 << 20, 2 << 30
"""A variable may unpack to so many times its bytes, or to so many; all of a file to so many."""
_ERRORS = (ValueError, TypeError, KeyError, IndexError, OSError, OverflowError, AttributeError, struct.error,
           zlib.error, MatReadError)  # fmt: skip


@dataclass(frozen=True)
class _Variable:
    """A variable: its name, why it is not read if so, and each part as a file that scipy reads."""

    name: str
    left_out: str | None
    files: tuple[bytes, ...]


def open_library(path: Path) -> Recording:
    """Read all variables; arrays of one length are a group, single numbers and texts are metadata."""
    found, total = Contents(), 0
    with ByteSource(path) as source:
        head = source.read(0, min(source.size, _HEADER_5), "the header")
        is_5 = head[124:128] in (b"\x00\x01IM", b"\x01\x00MI") or head.startswith(b"MATLAB 5.0")
        for variable in (_variables_5 if is_5 else _variables_4)(source, found):
            total += sum(map(len, variable.files))
            if total > _MOST_BYTES:
                message = f"its variables take more than {_MOST_BYTES >> 30} GiB; save them as version 7.3"
                raise Refusal(path.name, Finding("too_large", variable.name, None, message))
            if variable.left_out is not None:
                found.left_out.append(f"{variable.name} ({variable.left_out})")
            elif variable.name:
                try:
                    _take(variable.name, _loaded(path, variable), found)
                except Refusal as refusal:  # of this one variable
                    found.findings.append(replace(refusal.finding, channel=variable.name))
    return found.recording(path, f"MATLAB v{5 if is_5 else 4}", "testbench.readers.matlab")


def _loaded(path: Path, variable: _Variable) -> object:
    """The value that scipy gives; of complex numbers of version 4, made of both parts."""
    values: list[Any] = []
    with refusing(path, f"variable {variable.name!r}", *_ERRORS), np.errstate(all="ignore"):
        for file in variable.files:
            stream: Any = BytesIO(file)  # which scipy takes, and its stubs do not
            content = loadmat(stream, struct_as_record=True, squeeze_me=False, chars_as_strings=True)
            values.append(next(value for name, value in content.items() if not name.startswith("__")))
    if len(values) == 1:
        return values[0]
    whole = np.empty(values[0].shape, np.complex128, order="F")
    whole.real, whole.imag = values
    return whole


def _take(name: str, value: Any, found: Contents) -> None:  # noqa: ANN401
    """Sort a value: a series of samples, a number, a text, fields, cells, or something else."""
    others = ((MatlabFunction, "a function"), (MatlabOpaque | MatlabObject, "an object"))
    what = next(
        (what for kind, what in others if isinstance(value, kind)), "a sparse matrix" if issparse(value) else ""
    )
    if what or not isinstance(value, np.ndarray):
        found.left_out.append(f"{name} ({what or type(value).__name__})")
    elif value.dtype.names:
        for i, element in enumerate(value.ravel(order="F"), 1):
            for key in value.dtype.names:
                _take(f"{name}{f'({i})' if value.size > 1 else ''}.{key}", element[key], found)
    elif value.dtype == object:
        for i, element in enumerate(value.ravel(order="F"), 1):
            _take(f"{name}{{{i}}}", element, found)
    elif value.dtype.kind == "U":
        text = "\n".join(row.rstrip("\0") for row in value.ravel(order="F"))
        found.metadata[name] = text if len(text) <= _LONGEST_TEXT else ""
    elif value.size == 1:
        number = complex(value.item()) if value.dtype.kind == "c" else float(value.item())
        found.metadata[name] = repr(number)
        found.scalars |= {name: number} if isinstance(number, float) else {}
    elif value.size:
        root = name.split(".")[0].split("{")[0].split("(")[0]
        series = array_series(name, root if root != name else "", value.shape, value.dtype, lambda: value, MATLAB_INDEX)
        if series is None:
            found.left_out.append(f"{name} (an array of {' x '.join(map(str, value.shape))})")
        else:
            found.keep(series, value.dtype, name)


def _variables_5(source: ByteSource, found: Contents) -> Iterator[_Variable]:
    """The variables of a file of version 5; a cut file ends them with a finding."""
    head = source.read(0, _HEADER_5, "the header")
    if head[126:128] not in (b"IM", b"MI"):
        raise damaged(source.path, f"byte order {head[126:128]!r} at byte 126; expected IM or MI")
    order = "<" if head[126:128] == b"IM" else ">"
    if (version := head[125 if order == "<" else 124]) != 1:
        raise damaged(source.path, f"version {version} at byte 124; expected 1, of a file of version 5, 6 or 7")
    found.metadata["header"] = head[:116].decode("latin-1").strip(" \0")
    offset, last = _HEADER_5, ""
    for _ in range(_MOST_VARIABLES):
        if offset == source.size:
            return
        is_cut, begin, kind, count = offset + 8 > source.size, offset + 8, 0, 0
        if not is_cut:
            kind, count = struct.unpack(f"{order}II", source.read(offset, 8, "a tag"))
            if kind not in (_MATRIX, _COMPRESSED):
                raise damaged(source.path, f"byte {offset}: an element of type {kind}; expected a variable")
        if is_cut or begin + count > source.size:
            name = ""
            with suppress(Refusal):
                name = _header_5(source.path, source.read(offset, min(512, source.size - offset), "a header"), order)[0]
            found.findings.append(_cut("variable", name, source.size, offset, last))
            return
        content = source.read(offset, 8 + count, "a variable")
        if kind == _COMPRESSED:
            content = _unpacked(source.path, content[8:], offset)
        offset = min(begin + count + (-count % 8 if kind == _MATRIX else 0), source.size)
        if len(content) > 8 and content[4:8] != bytes(4):
            name, left_out = _header_5(source.path, content, order)
            last = name or last
            yield _Variable(name, left_out, () if left_out else (head + content,))
    raise damaged(source.path, f"more than {_MOST_VARIABLES} variables")


def _header_5(path: Path, content: bytes, order: str) -> tuple[str, str | None]:
    """Name of the variable whose tag ``content`` begins with, and why it is not read if so."""
    with refusing(path, "the header of a variable", struct.error):
        kind, _, flags_kind, flags_size, flags = struct.unpack_from(f"{order}5I", content)
        what, at, sides_kind, sides = flags & 0xFF, 24, 5, tuple[int, ...]()
        if what != _OPAQUE:  # which has no dimensions
            sides_kind, sides_size = struct.unpack_from(f"{order}II", content, at)
            sides = struct.unpack_from(f"{order}{min(sides_size, 256) // 4}i", content, 32)
            at = 32 + sides_size + -sides_size % 8
        name_kind, size = struct.unpack_from(f"{order}II", content, at)
        at, size = (at + 4, name_kind >> 16) if name_kind >> 16 else (at + 8, size)
    if (kind, flags_kind, flags_size) != (_MATRIX, 6, 8) or sides_kind not in (5, 6) or size > _LONGEST_NAME:
        raise damaged(path, f"a variable begins with elements of type {kind}, {flags_kind}, {sides_kind}")
    name = content[at : at + size].decode("latin-1")
    if any(side < 0 for side in sides) or (what in (_CELL, _STRUCT) and 8 * prod(sides) > len(content)):
        raise damaged(path, f"{name}: dimensions {sides} in {len(content)} bytes")
    known = what in (_CELL, _STRUCT, 4) or 6 <= what <= 15
    return name, None if known else _LEFT_OUT.get(what, f"an array of class {what}")


def _unpacked(path: Path, packed: bytes, offset: int) -> bytes:
    unpack, most = zlib.decompressobj(), max(_ALWAYS_ALLOWED, _MOST_RATIO * len(packed))
    try:
        content = unpack.decompress(packed, most + 1)
    except zlib.error as error:
        raise damaged(path, f"the compressed variable at byte {offset + 8} cannot be unpacked ({error})") from error
    if len(content) > most:
        message = f"{len(packed)} bytes at byte {offset + 8} unpack to more than {_MOST_RATIO} times as many"
        raise Refusal(path.name, Finding("too_large", None, f"byte {offset + 8}", message))
    if not unpack.eof:
        raise cut(path, f"the compressed variable at byte {offset + 8} ends too early")
    return content


def _variables_4(source: ByteSource, found: Contents) -> Iterator[_Variable]:
    """The matrices of a file of version 4, which lie one behind the other; a cut file ends them with a finding."""
    order = "<" if source.read(0, 4, "the first type")[2:] == b"\0\0" else ">"
    offset, last = 0, ""
    for _ in range(_MOST_VARIABLES):
        if offset == source.size:
            return
        if offset + _HEADER_4 > source.size:
            found.findings.append(_cut("matrix", "", source.size, offset, last))
            return
        head = source.read(offset, _HEADER_4, "a header")
        kind, rows, columns, is_complex, length = struct.unpack(f"{order}5i", head)
        number, what = kind // 10 % 10, kind % 10
        known = kind // 1000 == (order == ">") and kind // 100 % 10 == 0 and number in _SIZES_4 and what <= _SPARSE_4
        if not known or rows < 0 or columns < 0 or is_complex not in (0, 1) or not 0 < length <= _LONGEST_NAME:
            message = f"byte {offset}: a matrix of type {kind}, {rows} x {columns}, with a name of {length} letters"
            raise damaged(source.path, message)
        begin, size = offset + _HEADER_4 + length, rows * columns * _SIZES_4[number]
        end = begin + (1 + is_complex) * size
        name = source.read(offset + _HEADER_4, min(length, source.size - offset - _HEADER_4), "a name")
        last_whole, last = last, name.split(b"\0")[0].decode("latin-1")
        if end > source.size:
            found.findings.append(_cut("matrix", last if begin <= source.size else "", source.size, offset, last_whole))
            return
        offset = end
        if what == _SPARSE_4:
            yield _Variable(last, "a sparse matrix", ())
        elif size:
            front = struct.pack(f"{order}5i", kind, rows, columns, 0, length) + name
            parts = (source.read(at, size, f"matrix {last!r}") for at in range(begin, end, size))
            yield _Variable(last, None, tuple(front + part for part in parts))
    raise damaged(source.path, f"more than {_MOST_VARIABLES} matrices")


def _cut(what: str, name: str, size: int, offset: int, last: str) -> Finding:
    """That the file ends inside a variable, which one if its name is there, and which is the last whole one."""
    whole = f"the last whole {what} is {last!r}" if last else f"no {what} is whole"
    inside = f"{what} {name!r}" if name else f"a {what}"
    message = f"the file ends at byte {size} inside {inside}, which begins at byte {offset}; {whole}"
    return Finding("cut_file", name or None, f"byte {offset}", message)
