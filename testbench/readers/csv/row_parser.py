"""Text of rows into plain rows, and regular ones into float64 columns, in the bits that ``float()`` gives.

Rows of a long log go through a compiled loop, which is worth its start only there; all others through NumPy.
"""

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from balance.compiled_kernels import BYTE, INTEGER, PLACE, Kernel, Preparing

from ...recording import Samples
from .cell_syntax import as_number
from .dialect import Dialect
from .text_blocks import count_lines

_NEVER_WRITTEN = "\x1f"  # a separator that no log holds, so that a mark in a number or text is never taken for one
_NO_NUMBER = b"\x1a"
Places = NDArray[np.int64]


@dataclass(frozen=True)
class RewrittenColumn(ABC):
    """The column ``field``, whose cells are numbers to a person and not to ``float()``."""

    field: int

    @abstractmethod
    def number(self, cells: Sequence[str]) -> str | None:
        """The number of its cell in a row, with a decimal point; None if the cell stays as it is."""

    def block(self, plain: bytes, parser: "RowParser") -> bytes | None:
        """The rows with the numbers of this column, all at once; None where they are rewritten one by one."""
        return None


@dataclass(frozen=True)
class RowParser:
    """How rows are cut into cells once :meth:`plain` has made them plain: by one byte, with one decimal mark.

    ``padded``: blanks fill up the cells. The ``rewritten`` columns become numbers, and cells of the ``dates`` that
    such a column takes up become 0. ``encoding`` is that of the rows. ``missing`` are words for no value.
    """

    dialect: Dialect
    fields: int
    padded: bool = False
    rewritten: tuple[RewrittenColumn, ...] = ()
    dates: frozenset[int] = frozenset()
    encoding: str = "utf-8"
    missing: frozenset[str] = frozenset()

    @property
    def separator(self) -> str:
        """The one byte between cells of plain text."""
        if self.dialect.quoted and self.dialect.delimiter != " ":
            return _NEVER_WRITTEN  # so that no mark inside quotes is taken for one between cells
        return self.dialect.delimiter or _NEVER_WRITTEN

    def plain(self, text: bytes) -> bytes:
        """The same rows without quotes round numbers and blanks that only fill up, all numbers written as such.

        Each line keeps its end, and the number of lines does not change.
        """
        if self.dialect.quoted:
            text = _unquoted(text, self.dialect.delimiter.encode(), self.separator.encode())
        if self.separator == " ":
            text = re.sub(rb"[ \t]+", b" ", re.sub(rb"(?m)^[ \t]++|(?<![ \t])[ \t]++(?=\r?$)", b"", text))
        elif self.padded:
            text = re.sub(rb"(?<![ \t])[ \t]++(?=[%b\r\n])" % re.escape(self.separator.encode()), b"", text)
        if not self.rewritten:
            return text
        if len(self.rewritten) == 1 and (block := self.rewritten[0].block(text, self)) is not None:
            return block
        lines = text.decode(self.encoding, "surrogateescape").split("\n")
        return "\n".join(map(self._rewritten_line, lines)).encode(self.encoding, "surrogateescape")

    def _rewritten_line(self, line: str) -> str:
        """A row with its numbers; a line that is no row stays as it is."""
        cells = line.removesuffix("\r").split(self.separator)
        if len(cells) != self.fields:
            return line
        stripped = [cell.strip() for cell in cells]
        numbers = [column.number(stripped) for column in self.rewritten]
        for column, number in zip(self.rewritten, numbers, strict=True):
            if number is not None:
                cells[column.field] = number.replace(".", self.dialect.decimal)
        if None not in numbers:
            for field in self.dates:
                cells[field] = "0"
        return self.separator.join(cells) + ("\r" if line.endswith("\r") else "")

    def columns(self, plain: bytes) -> list[Samples] | None:
        """The columns of rows, cells that are no number as NaN; None if a row has too many cells or too few."""
        if self.dialect.decimal == ",":
            plain = plain.replace(b".", _NO_NUMBER).replace(b",", b".")  # else 1.5 would pass for one and a half
        if not plain.strip():  # empty cells alone, which NumPy takes for blank lines
            return self._cell_by_cell(plain)
        try:
            table = np.loadtxt(BytesIO(plain), delimiter=self.separator, comments=None, ndmin=2, encoding="latin-1")
        except ValueError:  # some cell is no number: it becomes NaN, and is looked at by itself
            return self._cell_by_cell(plain)
        if table.shape == (count_lines(plain), self.fields):
            return list(table.T.copy())
        return self._cell_by_cell(plain)  # an emptied row of one field is a blank line, which NumPy leaves out

    def cells(self, plain: bytes) -> tuple[Places, Places]:
        """Where each cell of regular rows begins and ends, row by row; a separator or a line feed ends it."""
        data = np.frombuffer(plain, dtype=np.uint8)
        ends = np.flatnonzero((data == ord(self.separator)) | (data == ord("\n")))
        return np.concatenate(([0], ends[:-1] + 1)), ends

    def _cell_by_cell(self, plain: bytes) -> list[Samples] | None:
        rows = [line.split(self.separator.encode()) for line in plain.removesuffix(b"\n").split(b"\n")]
        if any(len(row) != self.fields for row in rows):
            return None
        columns = ([None if b"_" in cell else as_number(cell) for cell in column] for column in zip(*rows, strict=True))
        return [np.array(column, dtype=np.float64) for column in columns]  # None is NaN


def _unquoted(text: bytes, delimiter: bytes, separator: bytes) -> bytes:
    """Rows with ``separator`` between cells and without the quotes that enclose cells.

    A row whose quotes are not in order stays as it is; it will not parse, and so nothing is glued together.
    """
    if b'"' not in text:
        return text.replace(delimiter, separator)
    parts = text.split(b'"')
    if _quotes_enclose_cells(parts, delimiter):
        parts[::2] = [part.replace(delimiter, separator) for part in parts[::2]]
        return b"".join(parts)
    if text.count(b"\n") <= 1:
        return text
    return b"".join(_unquoted(line, delimiter, separator) for line in text.splitlines(keepends=True))


def _quotes_enclose_cells(parts: list[bytes], delimiter: bytes) -> bool:
    """Whether every other part, which is outside quotes, begins and ends at a border of cells."""
    outside, inside = set(parts[2:-1:2]), parts[1::2]
    return (
        len(parts) % 2 == 1
        and (not parts[0] or parts[0].endswith((delimiter, b"\n")))
        and parts[-1].startswith((delimiter, b"\n", b"\r"))
        and all(p.startswith((delimiter, b"\n", b"\r")) and p.endswith((delimiter, b"\n")) for p in outside)
        and b"\n" not in b"".join(inside)
    )


_PATIENCE_S = 1.0
"""How long the first block waits for a loop that is kept; one that is compiled anew is not waited for."""
_FEW = 32
"""One cell in so many may be deferred to ``float()``; where there are more, the block goes the usual way."""
_FULL = -2
"""What the loop gives where there are more rows than room."""
_MORE = 1.05
"""Room for rows, times that of a block whose rows are as long as those of the block before."""
_TEXT, _COLUMNS, _DEFERRED, _SHAPES = (PLACE, INTEGER), (PLACE, INTEGER), (PLACE, INTEGER), (PLACE, PLACE)
_ARGUMENTS = (*_TEXT, BYTE, BYTE, PLACE, INTEGER, *_COLUMNS, *_DEFERRED, *_SHAPES)
ROWS = Kernel("testbench.readers.csv.fast_parser_kernel", "rows", _ARGUMENTS)


class FastParser:
    """Parses blocks whose rows are plain numbers throughout; made ready in a thread meanwhile."""

    def __init__(self, parser: RowParser, kept: tuple[int, ...]) -> None:
        self._parser = parser
        self._kept = np.isin(np.arange(parser.fields), kept).astype(np.uint8)
        self._density = 0.0  # rows a byte in the block before
        self._compiled = Preparing(ROWS)

    def columns(self, text: bytes) -> list[Samples] | None:
        """The columns of whole lines, NaN in fields that are not kept; None if some cell is no plain number."""
        self._compiled.decided.wait(_PATIENCE_S)
        loop = self._compiled.loop
        if loop is None or not text.endswith(b"\n"):
            return None
        count, columns, deferred = self._rows(loop, text, int(_MORE * self._density * len(text)))
        if count == _FULL:
            count, columns, deferred = self._rows(loop, text, count_lines(text))
        if count < 0:
            return None
        self._density = count / len(text)
        columns[self._kept == 0] = np.nan
        for begin, end, field, row in deferred:
            columns[field, row] = value = float(text[begin:end].replace(b",", b"."))
            if not math.isfinite(value):
                return None
        return list(columns[:, :count])

    def _rows(
        self, loop: Callable[..., int], text: bytes, capacity: int
    ) -> tuple[int, NDArray[np.float64], NDArray[np.int64]]:
        """How many rows the loop found if there are no more than ``capacity``; the columns; what it deferred."""
        fields = self._parser.fields
        columns = np.empty((fields, capacity))
        deferred = np.empty((1 + columns.size // _FEW, 4), np.int64)
        deferred[0] = 0
        separator, mark = ord(self._parser.separator), ord(self._parser.dialect.decimal)
        decimals, stops = np.zeros(fields, np.int64), np.zeros(fields, np.uint8)
        count = loop(
            np.frombuffer(text, dtype=np.uint8).ctypes.data, len(text), separator, mark, self._kept.ctypes.data, fields,
            columns.ctypes.data, capacity, deferred.ctypes.data, len(deferred) - 1, decimals.ctypes.data,
            stops.ctypes.data,
        )  # fmt: skip
        return count, columns, deferred[1 : 1 + deferred[0, 0]]
