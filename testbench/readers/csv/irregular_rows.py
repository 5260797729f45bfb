"""What is no plain row of numbers: odd lines made regular or left out, odd cells named with their line, a cut end.

Nothing is guessed: a cell that is no number is NaN, and each kind of contradiction is a finding.
"""

import re
from bisect import insort
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...recording import Finding, Report, Samples, shown
from .cell_syntax import (
    decimal_mark,
    is_ambiguous,
    is_bare_hexadecimal,
    is_decorated,
    is_missing,
    is_number_like,
    is_word,
    may_be_thousands,
)
from .dialect import COMMENT_SIGNS
from .row_parser import RowParser

_LISTED = 10
"""How many places a finding lists."""
_POINTS_SEEN = 4096
"""Cells of a block that are looked at, one by one."""
_SHAPE = re.compile(rb"[+-]?\d*[.,](\d+)(?:[eE][+-]?(\d+))?")
_ROWS_COMPARED = 1000
_BEGINS_NUMBER = np.frombuffer(b"0123456789+-.,; \tnNiI", dtype=np.uint8)
_COMMENTS = tuple(sign.encode() for sign in COMMENT_SIGNS)
_LINES = {
    "blank_lines": "blank lines between the rows, passed over: {n}",
    "comment_inside": "comment lines between the rows, passed over: {n}",
    "text_row": "lines of text between or under the rows of numbers: {n}, the first is {first}",
    "nul_bytes": "lines of NUL bytes, as after a power failure of the logger: {n}, the first is {first}",
    "ragged_row": "rows with more or fewer fields than {fields}, their values left out: {n}",
}
"""Lines that are no rows: code and message."""


_CELLS: tuple[tuple[str, Callable[[str, str], bool], str], ...] = (
    (
        "decimal_mark_changes",
        lambda text, other: decimal_mark(text) == other and not may_be_thousands(text),
        "the decimal mark changes: the first lines have a decimal {mark}, and {n} numbers here have the other one, the "
        "first is {first}",
    ),
    (
        "ambiguous_number",
        lambda text, other: decimal_mark(text) == other or is_ambiguous(text),
        "marks that may be of thousands or of decimals in {n} numbers, the first is {first}; export without marks of "
        "thousands",
    ),
    (
        "ambiguous_number",
        lambda text, _: is_bare_hexadecimal(text),
        "hexadecimal numbers without 0x, it seems, in {n} cells, the first is {first}: then those of digits alone are "
        "read wrongly too; export decimal numbers, or write 0x before them",
    ),
    (
        "ambiguous_number",
        lambda text, _: decimal_mark(text) is None and is_decorated(text),
        "numbers in another notation than those of the first lines, in {n} cells, the first is {first}; export all of "
        "a column in one notation, without quotes, brackets or units next to the digits",
    ),
    (
        "nul_bytes",
        lambda text, _: "\0" in text,
        "NUL bytes in {n} cells, as after a power failure of the logger, the first is {first}",
    ),
)
"""Cells that contradict the first lines: code, whether one does by its text and the other decimal mark, and message.

The first row that applies to a cell is the one that counts.
"""


@dataclass
class _Places:
    """The first places of a kind, line and text, and how many there are."""

    cells: list[tuple[int, str]] = field(default_factory=list)
    total: int = 0

    def add(self, line: int, text: str) -> None:
        self.total += 1
        if len(self.cells) < _LISTED or line < self.cells[-1][0]:
            insort(self.cells, (line, text), key=lambda cell: cell[0])
            del self.cells[_LISTED:]

    @property
    def first(self) -> str:
        return shown(self.cells[0][1])

    @property
    def where(self) -> str:
        """``line 62``, or ``lines 22, 82`` and how many more."""
        lines, more = list(dict.fromkeys(str(line) for line, _ in self.cells)), self.total - len(self.cells)
        return f"line{'s' if len(lines) > 1 else ''} {', '.join(lines)}{f' and {more} more' if more else ''}"


@dataclass(frozen=True)
class RegularRows:
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

    def parsed(self, parser: RowParser) -> list[Samples]:
        """Its columns, (n,) each [as written], parsed now."""
        columns = parser.columns(self.text)
        assert columns is not None, f"rows from line {self.lines[0]} on are regular, but do not parse"
        return columns


@dataclass
class RowFilter:
    """Makes rows regular, and remembers which were not.

    ``names`` is the header line, ``above`` the other lines that came before the data, all as plain text; ``time`` the
    field of the clock.
    """

    parser: RowParser
    names: bytes | None
    above: frozenset[bytes] = frozenset()
    time: int | None = None
    odd: dict[str, _Places] = field(default_factory=dict)
    _header_line: int = 0

    def pieces(self, text: bytes, first_line: int) -> Iterator[RegularRows]:
        """Plain ``text`` as regular rows: other lines left out, ragged rows emptied, parted at each header."""
        data = np.frombuffer(text, dtype=np.uint8)
        ends = np.flatnonzero(data == ord("\n")) + 1
        starts = np.concatenate(([0], ends[:-1]))
        separators = np.flatnonzero(data == ord(self.parser.separator))
        fields = 1 + np.diff(np.searchsorted(separators, np.append(starts, len(data))))
        suspects = (fields != self.parser.fields) | ~np.isin(data[starts], _BEGINS_NUMBER)
        odd: dict[int, str] = {}
        for i in map(int, np.flatnonzero(suspects)):
            line = text[starts[i] : ends[i]].strip()
            if kind := self._kind(line, int(fields[i])):
                odd[i] = kind
                self.odd.setdefault(kind, _Places()).add(first_line + i, line[:200].decode("utf-8", "replace"))
        headers = [i for i, kind in odd.items() if kind == "repeated_header"]
        offset, empty = np.concatenate(([0], ends)), self.parser.separator.encode() * (self.parser.fields - 1) + b"\n"
        for begin, end in pairwise([0, *headers, len(ends)]):
            if begin in headers:
                self._header_line = first_line + begin
            parts, done, keep = list[bytes](), int(offset[begin]), np.ones(end - begin, dtype=bool)
            here = [i for i in odd if begin <= i < end]
            for i in here:
                ragged = odd[i] == "ragged_row"
                parts += [text[done : offset[i]], empty if ragged else b""]
                done, keep[i - begin] = int(offset[i + 1]), ragged
            parts.append(text[done : offset[end]])
            lines, row_of = first_line + begin + np.flatnonzero(keep), np.cumsum(keep) - 1
            if len(lines):
                emptied = tuple(int(row_of[i - begin]) for i in here if odd[i] == "ragged_row")
                header_line, self._header_line = self._header_line, 0
                yield RegularRows(b"".join(parts), lines, header_line, emptied)

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
        cells = [cell.decode("latin-1") for cell in line.split(self.parser.separator.encode())]
        if not any(is_number_like(cell) or is_missing(cell) for cell in cells):
            return "nul_bytes" if b"\0" in line else "text_row"
        if self.time is not None and is_word(cells[0]) and is_word("".join(cells[self.time : self.time + 1])):
            return "text_row"  # such as a mean under the data: Average;1.25
        return "" if fields == self.parser.fields else "ragged_row"

    def report(self, report: Report) -> None:
        """Report what was not regular."""
        for kind, message in _LINES.items():
            if places := self.odd.get(kind):
                text = message.format(n=places.total, fields=self.parser.fields, first=places.first)
                report(Finding(kind, None, places.where, text))


@dataclass
class CellFilter:
    """Judges every cell that did not parse to a finite number; ``names`` are those of the fields."""

    parser: RowParser
    names: tuple[str, ...]
    encoding: str
    by_channel: dict[int, _Places] = field(default_factory=dict)
    by_rule: dict[str, _Places] = field(default_factory=dict)
    missing: dict[int, _Places] = field(default_factory=dict)

    def judge(self, rows: RegularRows, columns: list[Samples], examined: Iterable[int]) -> None:
        """Look at the cells of the ``examined`` columns that are not finite; fill in those that are a number.

        ``rows`` must be regular: a separator or a line feed ends each cell. ``columns`` are one array a field, (n,).
        """
        begins, ends = self.parser.cells(rows.text)
        for j in examined:
            odd = ~np.isfinite(columns[j])
            odd[list(rows.emptied)] = False
            at = np.flatnonzero(odd)
            cells = at * self.parser.fields + j
            length = ends[cells] - begins[cells]
            returns = np.frombuffer(rows.text, np.uint8)[begins[cells]] == ord("\r")
            empty = (length == 0) | ((length == 1) & returns)
            if empty.any():  # there may be very many, as of a slow sensor next to a fast one
                places = self.by_channel.setdefault(j, _Places())
                for row in at[empty][:_LISTED]:
                    places.add(int(rows.lines[row]), "")
                places.total += max(0, int(empty.sum()) - _LISTED)
            for row, cell in zip(at[~empty], cells[~empty], strict=True):
                text = rows.text[begins[cell] : ends[cell]].strip(b" \t\r").decode(self.encoding, "backslashreplace")
                if (value := self._judge(j, int(rows.lines[row]), text)) is not None:
                    columns[j] = columns[j] if columns[j].flags.writeable else columns[j].copy()
                    columns[j][row] = value

    def _judge(self, column: int, line: int, text: str) -> float | None:
        """Note the cell under its rule; the value of one that is a number between blanks."""
        decimal = self.parser.dialect.decimal
        if text in self.parser.missing:
            self.missing.setdefault(column, _Places()).add(line, text)
            return None
        if decimal_mark(text) in ("", decimal) and np.isfinite(value := float(text.strip().replace(",", "."))):
            return value
        other = "." if decimal == "," else ","
        if (rule := next((message for _, applies, message in _CELLS if applies(text, other)), None)) is not None:
            self.by_rule.setdefault(rule, _Places()).add(line, text)
        self.by_channel.setdefault(column, _Places()).add(line, text)
        return None

    def report(self, report: Report) -> None:
        """Report what was found: once for each kind of contradiction, and once for each channel."""
        mark = "comma" if self.parser.dialect.decimal == "," else "point"
        for code, _, message in _CELLS:
            if places := self.by_rule.get(message):
                text = message.format(n=places.total, first=places.first, mark=mark)
                report(Finding(code, None, places.where, text))
        for column, places in sorted(self.missing.items()):
            text = f"{places.total} cells are words that the import description calls missing, the first is "
            report(Finding("missing_values", self.names[column], places.where, text + places.first))
        for column, places in sorted(self.by_channel.items()):
            seen = ", ".join(f"{shown(text)} in line {line}" for line, text in places.cells)
            more = ", ..." if places.total > len(places.cells) else ""
            text = f"no finite number in {places.total} of its cells: {seen}{more}"
            report(Finding("not_a_number", self.names[column], places.where, text))


@dataclass
class LateDecimalMark:
    """Watches the ``kept`` fields of a text whose first lines hold whole numbers alone.

    Once a number leaves no doubt, such as ``0.5``, the point is of decimals; where all are like ``1.000``, as numbers
    grow past 999, it may be of thousands.
    """

    parser: RowParser
    kept: tuple[int, ...]
    places: _Places = field(default_factory=_Places)

    def __post_init__(self) -> None:
        self._settled = self.parser.dialect.mark_seen or self.parser.dialect.decimal != "."

    def look(self, rows: RegularRows) -> None:
        """Look at the numbers with a point in regular rows."""
        if self._settled or b"." not in rows.text:
            return
        begins, ends = self.parser.cells(rows.text)
        points = np.flatnonzero(np.frombuffer(rows.text, np.uint8) == ord("."))
        cells = np.unique(np.searchsorted(ends, points))
        cells = cells[np.isin(cells % self.parser.fields, self.kept)]
        for cell in map(int, cells[:_POINTS_SEEN]):
            text = rows.text[begins[cell] : ends[cell]].decode("latin-1").strip()
            if decimal_mark(text) == "." and not may_be_thousands(text):
                self._settled = True
                return
            self.places.add(int(rows.lines[cell // self.parser.fields]), text)
        self.places.total += len(cells[_POINTS_SEEN:])

    def report(self, report: Report) -> None:
        """Report numbers whose point may be of decimals or of thousands."""
        if self.places.total and not self._settled:
            message = (
                f"{self.places.total} numbers have a point and three digits behind it, the first is "
                f"{self.places.cells[0][1]!r}, and those of the first lines have no point: decimals, or thousands? say "
                "--decimal, or export without marks of thousands"
            )
            report(Finding("ambiguous_number", None, self.places.where, message))


def last_row(
    parser: RowParser, rest: bytes, before: bytes, line: int, time: int | None = None
) -> tuple[bytes, Finding | None]:
    """The last row of the file as far as it is whole; and the finding on it.

    ``rest`` is the text after the last line feed, ``before`` rows above it, both plain, ``time`` the clock's field.
    A number that may be cut is never used: the last one is whole only if it has as many decimals as most above, and
    none has more, or if something comes after it. The cells before it are kept, unless it is the row's time.
    """
    text, separator = rest.rstrip(b"\x1a"), parser.separator.encode()
    cells = text.split(separator)
    rows = [row.split(separator) for row in before.split(b"\n")[-1 - _ROWS_COMPARED : -1]]
    kept = b""
    if not text.strip():
        return kept, None
    shape, above = _shape(cells[-1]), [_shape(row[-1]) for row in rows if len(row) == parser.fields]
    code = "cut_last_row"
    if b"\0" in text:
        code = "nul_bytes"
        message = f"the file ends in {text.count(0)} NUL bytes, as after a power failure of the logger"
    elif len(cells) != parser.fields:
        message = f"{len(cells)} of {parser.fields} fields and no line end: the file ends inside the row; "
        message += "it is left out"
    elif text.endswith(b"\r"):
        return text + b"\n", None
    elif shape is not None and 2 * above.count(shape) > len(above) and shape == max(filter(None, above)):
        code, kept = "no_final_newline", text + b"\n"
        message = "no line end; the row is whole, since its last number has as many decimals as those above"
    elif parser.fields > 1 and time != parser.fields - 1:
        kept = separator.join([*cells[:-1], b""]) + b"\n"
        number = shown(cells[-1].decode("latin-1").strip())
        message = f"no line end, so that the last number, {number}, may be cut: it is left out, the "
        message += "cells before it are kept; if the file is whole, end its last line"
    else:
        message = "no line end, so that the last number may be cut; the row is left out"
    return kept, Finding(code, None, f"line {line}", message)


def _shape(cell: bytes) -> tuple[int, int] | None:
    """How many decimals a number has, and digits of the exponent; (0, 0) if the cell is empty, None for any other."""
    match = _SHAPE.fullmatch(cell.strip())
    if not cell.strip():
        return (0, 0)
    return None if match is None else (len(match[1]), len(match[2] or b""))
