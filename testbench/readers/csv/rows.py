"""Lines that are no rows: blank ones, comments, a second header, text, too many or too few fields."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...findings import Finding
from ...recording import Report, Samples
from . import marks
from .dialect import COMMENT_SIGNS
from .parse import Form

SHOWN = 10
"""How many places a finding lists."""
_BEGINS_NUMBER = np.frombuffer(b"0123456789+-.,; \tnNiI", dtype=np.uint8)
_COMMENTS = tuple(sign.encode() for sign in COMMENT_SIGNS)
_MESSAGES = {
    "blank_lines": "blank lines between the rows, passed over: {n}",
    "comment_inside": "comment lines between the rows, passed over: {n}",
    "text_row": "lines of text between or under the rows of numbers: {n}, the first is {first}",
    "nul_bytes": "lines of NUL bytes, as after a power failure of the logger: {n}, the first is {first}",
    "ragged_row": "rows with more or fewer fields than {fields}, their values left out: {n}",
}


@dataclass(frozen=True)
class Piece:
    """Regular rows and the file's line of each; their columns if parsed already.

    ``header_line`` is the line of a header that came again above them, 0 if none did; ``emptied`` are the rows
    whose cells were replaced by empty ones.
    """

    text: bytes
    lines: "range | NDArray[np.int64]"
    header_line: int = 0
    emptied: tuple[int, ...] = ()
    columns: list[Samples] | None = None
    bytes_read: int = 0


@dataclass
class RowFilter:
    """Makes rows regular, and remembers which were not.

    ``names`` is the header line, ``above`` the other lines that came before the data, all as plain text; ``time`` the
    field of the clock.
    """

    form: Form
    names: bytes | None
    above: frozenset[bytes] = frozenset()
    time: int | None = None
    places: dict[str, list[str]] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    firsts: dict[str, str] = field(default_factory=dict)
    _header_line: int = 0

    def pieces(self, text: bytes, first_line: int) -> Iterator[Piece]:
        """Plain ``text`` as regular rows: other lines left out, ragged rows emptied, parted at each header."""
        data = np.frombuffer(text, dtype=np.uint8)
        ends = np.flatnonzero(data == ord("\n")) + 1
        starts = np.concatenate(([0], ends[:-1]))
        separators = np.flatnonzero(data == ord(self.form.separator))
        fields = 1 + np.diff(np.searchsorted(separators, np.append(starts, len(data))))
        suspects = (fields != self.form.fields) | ~np.isin(data[starts], _BEGINS_NUMBER)
        odd: dict[int, str] = {}
        for i in map(int, np.flatnonzero(suspects)):
            line = text[starts[i] : ends[i]].strip()
            if kind := self._kind(line, int(fields[i])):
                odd[i] = kind
                self._count(kind, first_line + i, line)
        headers = [i for i, kind in odd.items() if kind == "repeated_header"]
        for begin, end in pairwise([0, *headers, len(ends)]):
            if begin in headers:
                self._header_line = first_line + begin
            piece = self._piece(text, ends, range(begin, end), odd, first_line)
            if len(piece.lines):
                self._header_line = 0
                yield piece

    def _piece(
        self, text: bytes, ends: NDArray[np.int64], rows: range, odd: Mapping[int, str], first_line: int
    ) -> Piece:
        """The regular rows among ``rows``, those that are ragged as rows of empty cells."""
        here = [i for i in odd if i in rows]
        offset = np.concatenate(([0], ends))
        parts, done, keep = [], int(offset[rows.start]), np.ones(len(rows), dtype=bool)
        for i in here:
            parts.append(text[done : offset[i]])
            done = int(offset[i + 1])
            if odd[i] == "ragged_row":
                parts.append(self.form.separator.encode() * (self.form.fields - 1) + b"\n")
            else:
                keep[i - rows.start] = False
        parts.append(text[done : offset[rows.stop]])
        lines = first_line + rows.start + np.flatnonzero(keep)
        row_of = np.cumsum(keep) - 1
        emptied = tuple(int(row_of[i - rows.start]) for i in here if odd[i] == "ragged_row")
        return Piece(b"".join(parts), lines, self._header_line, emptied)

    def _kind(self, line: bytes, fields: int) -> str:
        """What a line is; empty if it is a row."""
        if not line.strip(b"\x1a"):
            return "blank_lines"
        if self.names is not None and line == self.names:
            return "repeated_header"
        if line in self.above:
            return "header_rest"
        if line.startswith(_COMMENTS):
            return "comment_inside"
        cells = [cell.decode("latin-1") for cell in line.split(self.form.separator.encode())]
        if not any(marks.is_numberish(cell) or marks.is_missing(cell) for cell in cells):
            return "nul_bytes" if b"\0" in line else "text_row"
        if (
            self.time is not None
            and marks.is_word(cells[0])
            and marks.is_word("".join(cells[self.time : self.time + 1]))
        ):
            return "text_row"  # such as a mean under the data: Average;1.25
        return "" if fields == self.form.fields else "ragged_row"

    def _count(self, kind: str, line: int, text: bytes) -> None:
        self.counts[kind] += 1
        self.firsts.setdefault(kind, shown(text[:200].decode("utf-8", "replace")))
        if len(self.places.setdefault(kind, [])) < SHOWN:
            self.places[kind].append(str(line))

    def report(self, report: Report) -> None:
        """Report what was not regular."""
        for kind, message in _MESSAGES.items():
            if n := self.counts[kind]:
                text = message.format(n=n, fields=self.form.fields, first=self.firsts[kind])
                report(Finding(kind, None, listed(self.places[kind], n - len(self.places[kind])), text))


def shown(token: str) -> str:
    """A cell's text for a message: short, without control characters."""
    if not token:
        return "an empty cell"
    plain = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in token[:40])
    return f"'{plain}{'...' if len(token) > 40 else ''}'"


def listed(lines: Sequence[str], more: int) -> str:
    """``line 62``, or ``lines 22, 82`` and how many more."""
    return f"line{'s' if len(lines) > 1 else ''} {', '.join(lines)}{f' and {more} more' if more else ''}"
