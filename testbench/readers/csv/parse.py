"""Text of regular rows into float64 columns, in the bits that ``float()`` gives."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO

import numpy as np

from ...recording import Samples
from .dialect import Dialect
from .lines import count_lines
from .quotes import unquoted

_NEVER_WRITTEN = "\x1f"  # a separator that no log holds, so that a mark in a number or text is never taken for one
_NO_NUMBER = b"\x1a"


@dataclass(frozen=True)
class Form:
    """How rows are cut into cells once :meth:`plain` has made them plain: by one byte, with one decimal mark.

    ``rewriting`` spells cells such as times of day as numbers, and keeps the lines.
    """

    dialect: Dialect
    fields: int
    padded: bool = False
    rewriting: Callable[[bytes], bytes] | None = None

    @property
    def separator(self) -> str:
        """The one byte between cells of plain text."""
        if self.dialect.quoted and self.dialect.delimiter != " ":
            return _NEVER_WRITTEN  # so that no mark inside quotes is taken for one between cells
        return self.dialect.delimiter or _NEVER_WRITTEN

    def plain(self, text: bytes) -> bytes:
        """The same rows without quotes round numbers and blanks that only fill up, all numbers spelled as such."""
        text = self._bare(text)
        return text if self.rewriting is None else self.rewriting(text)

    def _bare(self, text: bytes) -> bytes:
        if self.dialect.quoted:
            text = unquoted(text, self.dialect.delimiter.encode(), self.separator.encode())
        if self.separator == " ":
            return re.sub(rb"[ \t]+", b" ", re.sub(rb"(?m)^[ \t]++|(?<![ \t])[ \t]++(?=\r?$)", b"", text))
        if self.padded:
            text = re.sub(rb"(?<![ \t])[ \t]++(?=[%b\r\n])" % re.escape(self.separator.encode()), b"", text)
        return text

    def columns(self, plain: bytes) -> list[Samples] | None:
        """The columns of rows, cells that are no number as NaN; None if a row has too many cells or too few."""
        if self.dialect.decimal == ",":
            plain = plain.replace(b".", _NO_NUMBER).replace(b",", b".")  # else 1.5 would pass for one and a half
        if not plain.strip():  # NumPy passes over empty rows
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
