"""Times as text turned to seconds for whole blocks of rows, and times of day counted on after midnight."""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...findings import Finding
from ...recording import Block, Report, Samples
from .cell_syntax import DAY, SECOND, fraction_span
from .row_parser import RowParser
from .time_columns import TimestampColumn

_LONGEST = 1 << 62
"""What nanoseconds of 64 bits hold, with room for a fraction."""
_MOST_DISTINCT = 0.25
"""Where more of the rows have a second of their own, reading row by row is as quick."""
_HALF_A_DAY_S = 43_200.0

Bytes = NDArray[np.uint8]
Places = NDArray[np.int64]


@dataclass(frozen=True)
class _Cells:
    """The cells of one column: where they begin, and their bytes side by side, (rows, width)."""

    begins: Places
    text: Bytes


def rewritten_block(plain: bytes, column: TimestampColumn, parser: RowParser) -> bytes | None:
    """Regular rows with the times of ``column`` as seconds; None where rows or times are of several forms.

    Each distinct second is read once.
    """
    data = np.frombuffer(plain, dtype=np.uint8)
    borders = _borders(data, parser.separator, parser.fields)
    if borders is None:
        return None
    cells = _cells(data, borders, column.field)
    dates = None if column.date_field is None else _cells(data, borders, column.date_field)
    if cells is None or (column.date_field is not None and dates is None):
        return None
    span = fraction_span(cells.text[0].tobytes().decode("latin-1"))
    if span is None or not column.decimals <= span[1] - span[0] <= 9:
        return None
    nanoseconds = _nanoseconds(column, cells, dates, span)
    if nanoseconds is None:
        return None
    return _replaced(data, cells, dates, nanoseconds, span[1] - span[0], parser.dialect.decimal)


def _borders(data: Bytes, separator: str, fields: int) -> Places | None:
    """Where cells end, (rows, fields); None if a row has more or fewer."""
    ends = np.flatnonzero((data == ord(separator)) | (data == ord("\n")))
    if not len(ends) or len(ends) % fields or data[-1] != ord("\n"):
        return None
    borders = ends.reshape(-1, fields)
    regular = (data[borders[:, -1]] == ord("\n")).all() and (data[borders[:, :-1]] != ord("\n")).all()
    return borders if regular else None


def _cells(data: Bytes, borders: Places, field: int) -> _Cells | None:
    """The cells of a column; None if they are not of one width."""
    begins = borders[:, field - 1] + 1 if field else np.concatenate(([0], borders[:-1, -1] + 1))
    widths = borders[:, field] - begins
    width = int(widths[0])
    if not width or (widths != width).any():
        return None
    return _Cells(begins, data[begins[:, None] + np.arange(width)])


def _nanoseconds(column: TimestampColumn, cells: _Cells, dates: _Cells | None, span: tuple[int, int]) -> Places | None:
    """Each row's time since the file's first; None if one is no time, or many have a second of their own."""
    digits = cells.text[:, span[0] : span[1]].astype(np.int64) - ord("0")
    if ((digits < 0) | (digits > 9)).any():
        return None
    scale = 10 ** np.arange(8, 8 - digits.shape[1], -1, dtype=np.int64)
    keys = np.delete(cells.text, np.s_[span[0] : span[1]], axis=1)
    keys = keys if dates is None else np.hstack([keys, dates.text])
    first = np.flatnonzero(np.concatenate(([True], (keys[1:] != keys[:-1]).any(axis=1))))
    if len(first) > max(1.0, _MOST_DISTINCT * len(keys)):
        return None
    whole = np.empty(len(first), dtype=np.int64)
    for i, row in enumerate(first):
        value = _whole(column, cells, dates, int(row), span)
        if value is None or abs(value - column.zero) > _LONGEST:
            return None
        whole[i] = value - column.zero
    return np.repeat(whole, np.diff(np.append(first, len(keys)))) + digits @ scale


def _whole(column: TimestampColumn, cells: _Cells, dates: _Cells | None, row: int, span: tuple[int, int]) -> int | None:
    """Nanoseconds of one row without its fraction; None if it is no time, or its fraction lies elsewhere."""
    text = cells.text[row].tobytes().decode("latin-1")
    if fraction_span(text) != span:
        return None
    row_cells = {column.field: text[: span[0]] + "0" * (span[1] - span[0]) + text[span[1] :]}
    if dates is not None and column.date_field is not None:
        row_cells[column.date_field] = dates.text[row].tobytes().decode("latin-1")
    return column.nanoseconds(row_cells)


def _replaced(
    data: Bytes, cells: _Cells, dates: _Cells | None, nanoseconds: Places, decimals: int, decimal: str
) -> bytes | None:
    """The rows with numbers in place of times, right-aligned, what they do not need of the cell cut out."""
    scaled = nanoseconds // 10 ** (9 - decimals)
    negative, rest = scaled < 0, np.abs(scaled)
    width = max(len(str(int(rest.max()))), decimals + 1) + 1 + int(negative.any())
    out, keep = data.copy(), np.ones(len(data), dtype=bool)
    if width > cells.text.shape[1]:
        return None
    for back in range(width):
        at = cells.begins + cells.text.shape[1] - 1 - back
        if back == decimals:
            out[at] = ord(decimal)
        else:
            out[at] = rest % 10 + ord("0")
            rest = rest // 10
    out[(cells.begins + cells.text.shape[1] - width)[negative]] = ord("-")
    for unused in range(cells.text.shape[1] - width):
        keep[cells.begins + unused] = False
    if dates is not None:
        out[dates.begins] = ord("0")
        for unused in range(1, dates.text.shape[1]):
            keep[dates.begins + unused] = False
    return out[keep].tobytes()


class _DaysPassed:
    """The days that have passed in one column."""

    def __init__(self) -> None:
        self.days, self.last = 0, -np.inf

    def counted_on(self, seconds: Samples) -> tuple[Samples, list[int]]:
        """The seconds with the days that passed, to the nanosecond, and where they did; not finite ones as they are."""
        at = np.flatnonzero(np.isfinite(seconds))
        steps = np.diff(seconds[at], prepend=self.last)
        passed = at[steps < -_HALF_A_DAY_S]
        if len(at):
            self.last = float(seconds[at[-1]])
        before, self.days = self.days, self.days + len(passed)
        if not self.days:
            return seconds, []
        days = before + np.searchsorted(passed, at, side="right")
        result = seconds.copy()
        result[at] = (np.rint(seconds[at] * SECOND) + days * float(DAY)) / SECOND
        return result, [int(i) for i in passed]


def across_midnight(blocks: Iterable[Block], columns: Collection[int], report: Report) -> Iterator[Block]:
    """The same blocks; in the ``columns`` a fall by more than half a day is a midnight, which is reported."""
    passed = {i: _DaysPassed() for i in columns}
    for block in blocks:
        given = list(block.columns)
        for i, days in passed.items():
            given[i], at = days.counted_on(given[i])
            for row in at:
                message = "midnight passes before this row"
                report(Finding("time_as_text", block.group.channels[i].name, block.where(row), message))
        yield replace(block, columns=tuple(given))
