"""Cells that are no plain number: found again in the text, named with their line, never guessed."""

from bisect import insort
from dataclasses import dataclass, field

import numpy as np

from ...findings import Finding
from ...recording import Report, Samples
from . import marks
from .parse import Form
from .rows import SHOWN, Piece, listed, shown

_KINDS = {
    "decimal_mark_changes": (
        "decimal_mark_changes",
        "the decimal mark changes: the first lines have a decimal {mark}, and {n} numbers here have the other one, the "
        "first is {first}",
    ),
    "thousands": (
        "ambiguous_number",
        "marks that may be of thousands or of decimals in {n} numbers, the first is {first}; export without marks of "
        "thousands",
    ),
    "hexadecimal": (
        "ambiguous_number",
        "hexadecimal numbers without 0x, it seems, in {n} cells, the first is {first}: then those of digits alone are "
        "read wrongly too; export decimal numbers, or write 0x before them",
    ),
    "notation": (
        "ambiguous_number",
        "numbers in another notation than those of the first lines, in {n} cells, the first is {first}; export all of "
        "a column in one notation, without quotes, brackets or units beside the digits",
    ),
    "nul_bytes": (
        "nul_bytes",
        "NUL bytes in {n} cells, as after a power failure of the logger, the first is {first}",
    ),
}
"""Contradictions, each with its code and message."""


@dataclass
class _Places:
    """The first cells of a kind, line and text, and how many there are."""

    cells: list[tuple[int, str]] = field(default_factory=list)
    total: int = 0

    def add(self, line: int, token: str) -> None:
        self.total += 1
        if len(self.cells) < SHOWN or line < self.cells[-1][0]:
            insort(self.cells, (line, token))
            del self.cells[SHOWN:]


@dataclass
class CellFilter:
    """Judges every cell that did not parse to a finite number."""

    form: Form
    names: tuple[str, ...]
    encoding: str
    by_channel: dict[int, _Places] = field(default_factory=dict)
    by_kind: dict[str, _Places] = field(default_factory=dict)

    def judge(self, piece: Piece, columns: list[Samples], examined: list[int]) -> None:
        """Look at the cells of the ``examined`` columns that are not finite; fill in those that are a number.

        ``piece`` must be regular: a separator or a line feed ends each cell.
        """
        data = np.frombuffer(piece.text, dtype=np.uint8)
        ends = np.flatnonzero((data == ord(self.form.separator)) | (data == ord("\n")))
        begins = np.concatenate(([0], ends[:-1] + 1))
        for j in examined:
            odd = ~np.isfinite(columns[j])
            odd[list(piece.emptied)] = False
            rows = np.flatnonzero(odd)
            cells = rows * self.form.fields + j
            length = ends[cells] - begins[cells]
            empty = (length == 0) | ((length == 1) & (data[begins[cells]] == ord("\r")))
            self._count_empty(j, [int(piece.lines[row]) for row in rows[empty][:SHOWN]], int(empty.sum()))
            for row, cell in zip(rows[~empty], cells[~empty], strict=True):
                token = self._text(piece.text[begins[cell] : ends[cell]])
                value = self._judge(j, int(piece.lines[row]), token)
                if value is not None:
                    columns[j] = _writable(columns[j])
                    columns[j][row] = value

    def _judge(self, column: int, line: int, token: str) -> float | None:
        """Note the cell under its kind; the value of one that is a number between blanks."""
        mark = marks.mark_of(token)
        if mark in ("", self.form.dialect.decimal) and np.isfinite(value := float(token.strip().replace(",", "."))):
            return value
        if "\0" in token:
            self._note("nul_bytes", line, token)
        elif mark in (".", ",") and mark != self.form.dialect.decimal:
            self._note("thousands" if marks.may_be_thousands(token) else "decimal_mark_changes", line, token)
        elif marks.is_ambiguous(token):
            self._note("thousands", line, token)
        elif marks.is_bare_hexadecimal(token):
            self._note("hexadecimal", line, token)
        elif mark is None and marks.is_dressed(token):
            self._note("notation", line, token)
        self.by_channel.setdefault(column, _Places()).add(line, token)
        return None

    def _count_empty(self, column: int, first_lines: list[int], total: int) -> None:
        """Note empty cells; there may be very many, as of a slow sensor beside a fast one."""
        if total:
            places = self.by_channel.setdefault(column, _Places())
            for line in first_lines:
                places.add(line, "")
            places.total += total - len(first_lines)

    def _note(self, kind: str, line: int, token: str) -> None:
        self.by_kind.setdefault(kind, _Places()).add(line, token)

    def _text(self, token: bytes) -> str:
        return token.strip(b" \t\r").decode(self.encoding, "backslashreplace")

    def report(self, report: Report) -> None:
        """Report what was found: once for each kind of contradiction, and once for each channel."""
        other = "comma" if self.form.dialect.decimal == "," else "point"
        for kind, (code, message) in _KINDS.items():
            if places := self.by_kind.get(kind):
                text = message.format(n=places.total, first=shown(places.cells[0][1]), mark=other)
                report(Finding(code, None, _where(places), text))
        for column, places in sorted(self.by_channel.items()):
            seen = ", ".join(f"{shown(token)} in line {line}" for line, token in places.cells)
            more = ", ..." if places.total > len(places.cells) else ""
            message = f"no finite number in {places.total} of its cells: {seen}{more}"
            where = _where(places)
            report(Finding("not_a_number", self.names[column], where, message))


def _where(places: _Places) -> str:
    lines = list(dict.fromkeys(str(line) for line, _ in places.cells))
    return listed(lines, places.total - len(places.cells))


def _writable(column: Samples) -> Samples:
    return column if column.flags.writeable else column.copy()
