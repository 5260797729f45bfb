"""Delimiter and decimal mark, detected once from the first lines; never guessed from one cell."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from .cell_syntax import (
    decimal_mark,
    is_ambiguous,
    is_missing,
    is_number_like,
    may_be_thousands,
    plain_number,
    read_timestamp,
)

COMMENT_SIGNS = ("#", "%", "//")
DELIMITERS = {"tab": "\t", "semicolon": ";", "bar": "|", "comma": ",", "blanks": " "}
"""By what a person calls them, in the order in which they are tried."""
_SPECIAL, _LONGEST_CELL = frozenset('"\r\n\0'), 100_000
"""What a line has that the reader of the standard library treats as more than cells between delimiters; and lengths."""
_HALF_OF_DECIMAL = re.compile(r"-0|[+-]?0\d+")
"""Whole numbers as written before or behind a decimal comma, and seldom alone."""
_BLANKS = re.compile(r"(?<=\w)\s++(?![(\[][^\s()[\]]*[^\W\d][^\s()[\]]*[)\]])|(?<=[^\w\s])\s++")
"""Blanks between cells, but for those of ``Force (N)``."""
_NAMES = {delimiter: name for name, delimiter in DELIMITERS.items()} | {"": "none (one column)"}


class UnclearDialect(Exception):
    """First lines that allow more than one reading; the text says which."""


@dataclass(frozen=True)
class Dialect:
    """Delimiter (``" "``: any run of blanks, ``""``: one column), decimal mark, quotes round numbers.

    ``doubt`` holds a reason why the decimal mark may be another one; ``mark_seen``: it is in the first lines, or a
    person stated it.
    """

    delimiter: str
    decimal: str
    quoted: bool = False
    doubt: str = ""
    mark_seen: bool = True

    def __str__(self) -> str:
        mark = "comma" if self.decimal == "," else "point"
        return f"delimiter {_NAMES.get(self.delimiter, repr(self.delimiter))}, decimal {mark}"

    def split(self, line: str) -> list[str]:
        """The cells of a line, blanks round them and quotes removed."""
        return split_line(line, self.delimiter)


def split_line(line: str, delimiter: str) -> list[str]:
    """The cells of a line at ``delimiter``, blanks round them and quotes removed."""
    if delimiter == "":
        return [line.strip().strip('"')]
    if delimiter == " ":
        return _BLANKS.split(line.strip()) if line.strip() else []
    if line and len(line) < _LONGEST_CELL and not _SPECIAL & set(line):
        return [cell.strip() for cell in line.split(delimiter)]  # as the reader gives it, in half the time
    try:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [""])
    except csv.Error:  # a cell longer than any number or name
        return [line]
    return [cell.strip() for cell in cells]


def is_comment(line: str) -> bool:
    """Whether the line is a comment."""
    return line.lstrip().startswith(COMMENT_SIGNS)


def is_data(cells: Sequence[str]) -> bool:
    """Whether cells are a row of data: a number among them, and at least half of them numbers, times or missing.

    A row of nothing but times of day is one too, as of events.
    """
    others = [cell for cell in cells if decimal_mark(cell) is None]
    times = [moment for cell in others if (moment := read_timestamp(cell)) is not None]
    numbers = len(cells) - len(others) + sum(is_number_like(cell) and read_timestamp(cell) is None for cell in others)
    if not numbers:
        return 0 < len(times) == len(cells) and any(moment.notation.clock for moment in times)
    return numbers + len(times) + sum(map(is_missing, others)) >= 0.5 * len(cells)


def detect_dialect(lines: Sequence[str], delimiter: str | None = None, decimal: str | None = None) -> Dialect:
    """The dialect of a file that begins with ``lines``; what the caller gives is not detected."""
    lines = [line for line in lines if line.strip() and not is_comment(line)]
    if delimiter is None:
        delimiter = _delimiter(lines, decimal)
    rows = [cells for line in lines if is_data(cells := split_line(line, delimiter))]
    quoted = any('"' in line and is_data(split_line(line, delimiter)) for line in lines)
    if decimal is not None:
        return Dialect(delimiter, decimal, quoted)
    mark, doubt = (".", "") if delimiter == "," and not quoted else _decimal(rows)
    seen = any(decimal_mark(cell) == mark for cells in rows for cell in cells)
    return Dialect(delimiter, mark, quoted, doubt, seen)


def _delimiter(lines: Sequence[str], decimal: str | None) -> str:
    for delimiter in DELIMITERS.values():
        if delimiter != " " and not any(delimiter in line for line in lines):
            continue
        rows = [split_line(line, delimiter) for line in lines]
        data = [cells for cells in rows if len(cells) > 1 and is_data(cells)]
        if len(data) <= 0.5 * (len(rows) - _first_data(rows)):
            continue
        if delimiter == "," and not _all_numbers(data) and _all_numbers([row.split() for row in map(",".join, data)]):
            continue  # 0,1  2,5: blanks between decimal commas
        if delimiter == ",":
            return _comma_or_one_column(lines, rows, data, decimal)
        return delimiter
    return ""


def _all_numbers(rows: Sequence[Sequence[str]]) -> bool:
    return all(is_number_like(cell) or is_missing(cell) for cells in rows for cell in cells)


def _first_data(rows: Sequence[Sequence[str]]) -> int:
    """Index of the first row of data; lines above it are header and preamble and have no say."""
    return next((i for i, cells in enumerate(rows) if is_data(cells)), len(rows) - 1)


def _comma_or_one_column(
    lines: Sequence[str], rows: Sequence[Sequence[str]], data: Sequence[Sequence[str]], decimal: str | None
) -> str:
    """Commas between numbers: between columns, or the decimal comma of one column? The header decides."""
    if any(line.count('"') % 2 for line in lines):
        raise UnclearDialect("a quote is opened and not closed in its line; mend it, or say --delimiter and --decimal")
    if any('"' in line and is_data(split_line(line, ",")) for line in lines):
        return ","
    fields = Counter(map(len, data)).most_common(1)[0][0]
    first = _first_data(rows)
    header = len(rows[first - 1]) if first else 0
    if fields == 2 and (decimal == "," or header == 1):
        return ""
    if header in (fields, fields - 1, fields + 1) or any("." in cell for cells in data for cell in cells):
        return ","
    if header == 0 and fields % 2 and not any(_HALF_OF_DECIMAL.fullmatch(cell) for cells in data for cell in cells):
        return ","
    raise UnclearDialect(
        f"commas may part the columns or be decimal marks (row {','.join(data[0])!r}, {header} names above it); "
        "say --delimiter and --decimal"
    )


_MAY_SETTLE = re.compile(r"(?<![\d.,])0?[.,]\d|[.,](?:\d{1,2}|\d{4,})(?![\d.,])|\d{4,}[.,]\d{3}(?!\d)", re.ASCII)
"""What a line without any ``1.234`` alone may hold, sought before its cells are looked at."""


def settles(line: str, delimiter: str) -> bool:
    """Whether a line of data has a number whose mark is one of decimals, and of thousands in no notation."""
    if not _MAY_SETTLE.search(line) or not is_data(cells := split_line(line, delimiter)):
        return False
    return any(decimal_mark(cell) and not may_be_thousands(cell) for cell in map(plain_number, cells))


def _decimal(rows: Sequence[Sequence[str]]) -> tuple[str, str]:
    """The mark of the first number that leaves no doubt, and what doubt there is."""
    numbers = [plain_number(cell) for cells in rows for cell in cells if is_number_like(cell)]
    for cell in numbers:
        if (mark := decimal_mark(cell)) and not may_be_thousands(cell):
            return mark, ""
    for cell in numbers:
        if is_ambiguous(cell) and {".", ","} <= set(cell):
            return max(".,", key=cell.rfind), ""
    for cell in numbers:
        if mark := decimal_mark(cell):
            return mark, f"{cell!r} and all other numbers have exactly three digits behind the mark"
    return ".", ""
