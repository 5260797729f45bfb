"""Text of rows into plain rows, and regular ones into float64 columns, in the bits that ``float()`` gives."""

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO

import numpy as np

from ...recording import Samples
from .dialect import Dialect
from .text_blocks import count_lines

_NEVER_WRITTEN = "\x1f"  # a separator that no log holds, so that a mark in a number or text is never taken for one
_NO_NUMBER = b"\x1a"


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
    such a column takes up become 0. ``encoding`` is that of the rows.
    """

    dialect: Dialect
    fields: int
    padded: bool = False
    rewritten: tuple[RewrittenColumn, ...] = ()
    dates: frozenset[int] = frozenset()
    encoding: str = "utf-8"

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
        text = self._bare(text)
        if not self.rewritten:
            return text
        if len(self.rewritten) == 1 and (block := self.rewritten[0].block(text, self)) is not None:
            return block
        lines = text.decode(self.encoding, "surrogateescape").split("\n")
        return "\n".join(map(self._rewritten_line, lines)).encode(self.encoding, "surrogateescape")

    def _bare(self, text: bytes) -> bytes:
        if self.dialect.quoted:
            text = _unquoted(text, self.dialect.delimiter.encode(), self.separator.encode())
        if self.separator == " ":
            return re.sub(rb"[ \t]+", b" ", re.sub(rb"(?m)^[ \t]++|(?<![ \t])[ \t]++(?=\r?$)", b"", text))
        if self.padded:
            text = re.sub(rb"(?<![ \t])[ \t]++(?=[%b\r\n])" % re.escape(self.separator.encode()), b"", text)
        return text

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
        return list(table.T.copy()) if table.shape == (count_lines(plain), self.fields) else None

    def _cell_by_cell(self, plain: bytes) -> list[Samples] | None:
        rows = [line.split(self.separator.encode()) for line in plain.removesuffix(b"\n").split(b"\n")]
        if any(len(row) != self.fields for row in rows):
            return None
        return [np.array([_number(cell) for cell in column]) for column in zip(*rows, strict=True)]


def _number(cell: bytes) -> float:
    """The number of a cell; NaN where it is none, as 1_000."""
    try:
        return float(cell) if b"_" not in cell else np.nan
    except ValueError:
        return np.nan


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
