"""Times as text turned to seconds for whole blocks of rows, and times of day counted on after midnight."""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...recording import Block, Finding, Report
from .cell_syntax import DAY, SECOND, fraction_span
from .row_parser import RowParser

_LONGEST = 1 << 62
"""What nanoseconds of 64 bits hold, with room for a fraction."""
_MOST_DISTINCT = 0.25
"""Where more of the rows have a second of their own, reading row by row is as quick."""
_HALF_A_DAY_S = 43_200.0

Bytes = NDArray[np.uint8]
Places = NDArray[np.int64]
TimeOf = Callable[[dict[int, str]], int | None]


def rewritten_block(
    plain: bytes, parser: RowParser, fields: Sequence[int], decimals: int, time_of: TimeOf
) -> bytes | None:
    """Regular rows with times as seconds; None where rows or times are of several forms, or of fewer ``decimals``.

    ``fields`` are those of the times and, where they are apart, of the dates; ``time_of`` gives the time since the
    file's first [ns] from a row's cells by field, and is asked once for each distinct second.
    """
    data = np.frombuffer(plain, dtype=np.uint8)
    cells = _cells_of_one_width(data, parser, fields)
    span = None if cells is None else fraction_span(cells[0][1][0].tobytes().decode("latin-1"))
    if cells is None or span is None or not decimals <= span[1] - span[0] <= 9:
        return None
    nanoseconds = _nanoseconds(dict(zip(fields, (text for _, text in cells), strict=True)), span, time_of)
    return None if nanoseconds is None else _replaced(data, cells, nanoseconds, span[1] - span[0], parser)


def _cells_of_one_width(data: Bytes, parser: RowParser, fields: Sequence[int]) -> list[tuple[Places, Bytes]] | None:
    """Where the cells of each of the ``fields`` begin, (rows,), and their bytes, (rows, width).

    None if a row has more or fewer cells, or those of a field are not of one width.
    """
    ends = np.flatnonzero((data == ord(parser.separator)) | (data == ord("\n")))
    if not len(ends) or len(ends) % parser.fields or data[-1] != ord("\n"):
        return None
    borders = ends.reshape(-1, parser.fields)
    if (data[borders[:, -1]] != ord("\n")).any() or (data[borders[:, :-1]] == ord("\n")).any():
        return None
    found = []
    for field in fields:
        begins = borders[:, field - 1] + 1 if field else np.concatenate(([0], borders[:-1, -1] + 1))
        widths = borders[:, field] - begins
        if not widths[0] or (widths != widths[0]).any():
            return None
        found.append((begins, data[begins[:, None] + np.arange(widths[0])]))
    return found


def _nanoseconds(texts: dict[int, Bytes], span: tuple[int, int], time_of: TimeOf) -> Places | None:
    """Each row's time since the file's first, (rows,) [ns]; None if one is no time, or many have a second of their own.

    ``texts`` are the cells of the times, then of their dates, by field; ``span`` is the place of the fraction in times.
    """
    field, times = next(iter(texts.items()))
    digits = times[:, span[0] : span[1]].astype(np.int64) - ord("0")
    if ((digits < 0) | (digits > 9)).any():
        return None
    times[:, span[0] : span[1]] = ord("0")
    keys = np.hstack(list(texts.values()))
    first = np.flatnonzero(np.concatenate(([True], (keys[1:] != keys[:-1]).any(axis=1))))
    if len(first) > max(1.0, _MOST_DISTINCT * len(keys)):
        return None
    whole = np.empty(len(first), dtype=np.int64)
    for i, row in enumerate(first):
        cells = {i: text[row].tobytes().decode("latin-1") for i, text in texts.items()}
        value = time_of(cells) if fraction_span(cells[field]) == span else None
        if value is None or abs(value) > _LONGEST:
            return None
        whole[i] = value
    scale = 10 ** np.arange(8, 8 - digits.shape[1], -1, dtype=np.int64)
    return np.repeat(whole, np.diff(np.append(first, len(keys)))) + digits @ scale


def _replaced(
    data: Bytes, cells: Sequence[tuple[Places, Bytes]], nanoseconds: Places, decimals: int, parser: RowParser
) -> bytes | None:
    """The rows with numbers in place of times, right-aligned, what they do not need of the cell cut out."""
    (begins, text), *dates = cells
    scaled = nanoseconds // 10 ** (9 - decimals)
    negative, rest = scaled < 0, np.abs(scaled)
    width = max(len(str(int(rest.max()))), decimals + 1) + 1 + int(negative.any())
    out, keep = data.copy(), np.ones(len(data), dtype=bool)
    unused = text.shape[1] - width
    if unused < 0:
        return None
    for back in range(width):
        at = begins + text.shape[1] - 1 - back
        if back == decimals:
            out[at] = ord(parser.dialect.decimal)
        else:
            out[at] = rest % 10 + ord("0")
            rest = rest // 10
    out[(begins + unused)[negative]] = ord("-")
    for k in range(unused):
        keep[begins + k] = False
    for date_begins, date_text in dates:
        out[date_begins] = ord("0")
        for k in range(1, date_text.shape[1]):
            keep[date_begins + k] = False
    return out[keep].tobytes()


def across_midnight(blocks: Iterable[Block], columns: Collection[int], report: Report) -> Iterator[Block]:
    """The same blocks; in the ``columns`` a fall by more than half a day is a midnight, which is reported."""
    days, last = dict.fromkeys(columns, 0), dict.fromkeys(columns, -np.inf)
    for block in blocks:
        given = list(block.columns)
        for i in columns:
            seconds = given[i]
            at = np.flatnonzero(np.isfinite(seconds))
            passed = at[np.diff(seconds[at], prepend=last[i]) < -_HALF_A_DAY_S]
            last[i] = float(seconds[at[-1]]) if len(at) else last[i]
            if days[i] or len(passed):  # counted on to the nanosecond
                before = days[i] + np.searchsorted(passed, at, side="right")
                given[i] = seconds.copy()
                given[i][at] = (np.rint(seconds[at] * SECOND) + before * float(DAY)) / SECOND
            days[i] += len(passed)
            for row in map(int, passed):
                message = "midnight passes before this row"
                report(Finding("time_as_text", block.group.channels[i].name, block.where(row), message))
        yield replace(block, columns=tuple(given))
