"""A decimal point that no number of the first lines has: of decimals, or of thousands, as numbers grow past 999?"""

from dataclasses import dataclass

import numpy as np

from ...findings import Finding
from ...recording import Report
from . import marks
from .parse import Form
from .rows import SHOWN, Piece, listed

_LOOKED_AT = 4096
"""Cells of a block that are looked at, one by one."""


@dataclass
class LateMarks:
    """Watches the ``kept`` fields of a text whose first lines hold whole numbers alone.

    Once a number leaves no doubt, such as ``0.5``, the point is of decimals; where all are like ``1.000`` it may be of
    thousands.
    """

    form: Form
    kept: tuple[int, ...]
    total: int = 0
    first: str = ""

    def __post_init__(self) -> None:
        self._settled = self.form.dialect.mark_seen or self.form.dialect.decimal != "."
        self._lines: list[str] = []

    def look(self, piece: Piece) -> None:
        """Look at the numbers with a point in regular rows."""
        if self._settled or b"." not in piece.text:
            return
        data = np.frombuffer(piece.text, dtype=np.uint8)
        ends = np.flatnonzero((data == ord(self.form.separator)) | (data == ord("\n")))
        cells = np.unique(np.searchsorted(ends, np.flatnonzero(data == ord("."))))
        cells = cells[np.isin(cells % self.form.fields, self.kept)]
        self.total += len(cells)
        for cell in map(int, cells[:_LOOKED_AT]):
            text = piece.text[int(ends[cell - 1]) + 1 if cell else 0 : int(ends[cell])].decode("latin-1").strip()
            if marks.mark_of(text) == "." and not marks.may_be_thousands(text):
                self._settled = True
                return
            self.first = self.first or text
            if len(self._lines) < SHOWN:
                self._lines.append(str(piece.lines[cell // self.form.fields]))

    def report(self, report: Report) -> None:
        """Report numbers of which it cannot be told what the point is."""
        if self.total and not self._settled:
            message = (
                f"{self.total} numbers have a point and three digits behind it, the first is {self.first!r}, and those "
                "of the first lines have no point: decimals, or thousands? say --decimal, or export without marks of "
                "thousands"
            )
            report(Finding("ambiguous_number", None, listed(self._lines, self.total - len(self._lines)), message))
