"""Text of regular rows into float64 columns, in the bits that ``float()`` gives."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...recording import Samples
from .dialect import Dialect
from .lines import count_lines
from .quotes import unquoted

if TYPE_CHECKING:
    import polars

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
        comma = self.dialect.decimal == ","
        if comma and b"." in plain:
            plain = plain.replace(b".", _NO_NUMBER)  # else 1.5 would pass for one and a half
        frame = self._frame(plain, comma, strict=True)
        if frame is None:  # some cell is no number: it becomes null, and is looked at by itself
            frame = self._frame(plain, comma, strict=False)
        if frame is None or frame.height != count_lines(plain):
            return None
        return [np.asarray(frame.to_series(i).to_numpy(), dtype=np.float64) for i in range(self.fields)]

    def _frame(self, plain: bytes, decimal_comma: bool, strict: bool) -> "polars.DataFrame | None":
        import polars

        try:
            return polars.read_csv(
                plain,
                has_header=False,
                schema={str(i): polars.Float64 for i in range(self.fields)},
                separator=self.separator,
                decimal_comma=decimal_comma,
                quote_char=None,
                ignore_errors=not strict,
            )
        except polars.exceptions.PolarsError:
            return None
