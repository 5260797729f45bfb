"""Reader of MATLAB files, version 4: matrices one behind the other, each with a header of its own."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..findings import Finding, Refusal
from ..recording import Block, Recording
from .mat5 import arrays
from .mat5.content import Content
from .mat5.elements import NUMBERS, Array, Element
from .nonfinite import watched
from .registry import Reader, ReadOptions
from .series import Gathering, Series, gather
from .stream import ByteSource, damaged

_HEADER = struct.calcsize("5i")
_NUMBERS = {0: 9, 1: 7, 2: 5, 3: 3, 4: 4, 5: 2}
"""Types of numbers as version 5 has them, by the third digit of the type."""
_CLASS = 6
_FULL, _TEXT, _SPARSE = 0, 1, 2
_LONGEST_NAME, _LONGEST_TEXT, _MOST = 256, 1 << 16, 100_000


@dataclass(frozen=True)
class _Matrix:
    """A matrix: its name, what it holds, its sides, its parts, and where the next one begins."""

    name: str
    kind: int
    sides: tuple[int, int]
    parts: tuple[Element, ...]
    next: int


def open_mat4(path: Path, options: ReadOptions) -> Recording:
    """Walk through the matrices; their numbers are read when asked for."""
    with ByteSource(path) as source:
        found, metadata, left, findings = _understood(source)
    if not found.groups:
        raise Refusal(path.name, next(iter(findings), Finding("no_data", None, None, "no array of numbers in it")))
    if left:
        message = f"no series of samples: {', '.join(left[:10])}{' and more' if len(left) > 10 else ''}"
        findings.append(Finding("left_out", None, None, message))
    return Recording(
        path=path,
        format="MATLAB v4",
        reader=__name__,
        groups=tuple(gathered.group for gathered in found.groups),
        read=lambda report: watched(_blocks(path), report),
        metadata=metadata,
        stated_rate_hz=found.stated_rate_hz,
        findings=tuple(findings),
    )


def _blocks(path: Path) -> Iterator[Block]:
    with ByteSource(path) as source:
        for gathered in _understood(source)[0].groups:
            yield from gathered.blocks()


def _understood(source: ByteSource) -> tuple[Gathering, dict[str, str], list[str], list[Finding]]:
    """The groups of the file, its numbers and texts beside them, what is left out, and what is odd."""
    order, findings = _order(source), list[Finding]()
    series: list[Series] = []
    scalars: dict[str, float] = {}
    metadata: dict[str, str] = {}
    left: list[str] = []
    content = Content(source, 0, source.size)
    for matrix in _matrices(source, order, findings):
        array = Array(matrix.name, _CLASS, matrix.sides, matrix.parts, content)
        if matrix.kind == _SPARSE:
            left.append(f"{matrix.name} (a sparse matrix)")
        elif matrix.kind == _TEXT:
            metadata[matrix.name] = _text(array, order)
        elif (number := arrays.scalar(array, order)) is not None:
            metadata[matrix.name] = repr(number)
            scalars |= {matrix.name: number} if isinstance(number, float) else {}
        elif array.size and (one := arrays.series(array, order)) is not None:
            series.append(one)
        elif array.size:
            left.append(f"{matrix.name} (an array of {matrix.sides[0]} x {matrix.sides[1]})")
    return gather(source.path.stem, series, scalars), metadata, left, findings


def _matrices(source: ByteSource, order: str, findings: list[Finding]) -> Iterator[_Matrix]:
    """The matrices; a cut file ends them with a finding."""
    offset, last = 0, ""
    for _ in range(_MOST):
        if offset == source.size:
            return
        matrix = _matrix(source, order, offset) if offset + _HEADER <= source.size else None
        if matrix is None or matrix.next > source.size:
            inside = f"matrix {matrix.name!r}" if matrix else "the header of a matrix"
            message = f"the file ends inside {inside}, which begins at byte {offset}; "
            message += f"the last whole one is {last!r}" if last else "none before it is whole"
            findings.append(Finding("cut_file", matrix.name if matrix else None, f"byte {offset}", message))
            return
        offset, last = matrix.next, matrix.name
        yield matrix
    raise damaged(source.path, f"more than {_MOST} matrices")


def _matrix(source: ByteSource, order: str, offset: int) -> _Matrix | None:
    """The matrix whose header lies at ``offset``; None if the file ends inside its header."""
    head = source.read(offset, _HEADER, "a header")
    kind, rows, columns, is_complex, length = struct.unpack(f"{order}5i", head)
    number, what = kind // 10 % 10, kind % 10
    sound = kind // 1000 == (order == ">") and kind // 100 % 10 == 0 and number in _NUMBERS and what <= _SPARSE
    if not sound or rows < 0 or columns < 0 or is_complex not in (0, 1) or not 0 < length <= _LONGEST_NAME:
        message = f"byte {offset}: a matrix of type {kind}, {rows} x {columns}, with a name of {length} letters"
        raise damaged(source.path, message)
    begin = offset + _HEADER + length
    if begin > source.size:
        return None
    name = source.read(offset + _HEADER, length, "a name").split(b"\0")[0].decode("latin-1")
    size = rows * columns * np.dtype(NUMBERS[_NUMBERS[number]]).itemsize
    places = range(begin, begin + (1 + is_complex) * size, size) if size else ()
    parts = tuple(Element(_NUMBERS[number], at, size, at + size) for at in places)
    return _Matrix(name, what, (rows, columns), parts, begin + (1 + is_complex) * size)


def _text(array: Array, order: str) -> str:
    """A matrix of letters, each a number, its rows one below the other."""
    if not array.size or array.size > _LONGEST_TEXT:
        return ""
    numbers = arrays.Columns(array, array.parts[0], order, 1, array.size, False).block(0, array.size)[0]
    letters = "".join(chr(int(n)) if 0 < n < 0xD800 else " " for n in numbers)
    rows = array.dimensions[0]
    return "\n".join(letters[i::rows].rstrip() for i in range(rows))


def _order(source: ByteSource) -> str:
    return "<" if source.read(0, 4, "the first type")[2:] == b"\0\0" else ">"


def _identify(head: bytes) -> bool:
    """A header of version 4: small sides, and a name that MATLAB takes."""
    for order in "<>":
        if len(head) < _HEADER:
            return False
        kind, rows, columns, is_complex, length = struct.unpack_from(f"{order}5i", head)
        name = head[_HEADER : _HEADER + max(0, min(length, _LONGEST_NAME))]
        sound = kind // 1000 == (order == ">") and 0 <= kind % 1000 <= 52 and kind % 10 <= _SPARSE
        if sound and min(rows, columns) >= 0 and is_complex in (0, 1) and length > 1:
            plain = name[:-1].decode("latin-1")
            return name[-1:] == b"\0" and plain.isidentifier() and plain.isascii()
    return False


READER = Reader(name="MATLAB v4", extensions=(".mat",), identify=_identify, open=open_mat4)
