"""Columns whose cells are numbers to a person and not to ``float()``, rewritten from the first one on.

Numbers such as ``1'234,5``, ``1.5D+03``, a typographic minus, ``0x1F``; times that no float64 writes, as seconds from
the first one, whole blocks of rows at once where they are of one form; and which column is the clock.
"""

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...recording import Block, Channel, Finding, Report, StartTime, TimeColumn, point_in_time
from ...units import seconds_per
from .. import header_claims
from .cell_syntax import (
    DAY,
    MINUS,
    SECOND,
    TimeNotation,
    Timestamp,
    decimal_mark,
    fraction_span,
    is_exact,
    is_missing,
    is_number_like,
    is_without_exponent,
    plain_number,
    read_timestamp,
    zone_minutes,
)
from .header import Header, is_time_name, time_column
from .row_parser import Places, RewrittenColumn, RowParser

_THOUSANDS_MARKS = ".,'\u2019 \u00a0\u202f"
_NEVER_DECIMAL = frozenset("'\u2019 \u00a0\u202f")
_EXACT_DIGITS = 15
"""Digits that float64 holds whatever they are."""


@dataclass(frozen=True)
class NotationColumn(RewrittenColumn):
    """A column of numbers in another notation, which ``plain`` turns into what ``float()`` reads."""

    plain: Callable[[str], str | None]
    findings: tuple[Finding, ...] = ()
    zero_text: str = ""
    """Of times such as nanoseconds since 1970: the first one, from which they are counted."""

    def number(self, cells: Sequence[str]) -> str | None:
        """The number of its cell; None if it stays as it is."""
        return self.plain(cells[self.field])


def find_notations(
    rows: Sequence[Sequence[str]], header: Header, decimal: str, passed_over: Collection[int]
) -> tuple[NotationColumn, ...]:
    """The columns of the first ``rows`` in such notations, but for those ``passed_over``."""
    rows = [cells for cells in rows if len(cells) == header.fields]
    fields = [i for i in range(len(header.channels)) if i not in passed_over]
    columns = {i: [cells[i] for cells in rows if not is_missing(cells[i])] for i in fields}
    found = []
    for i, numbers in columns.items():
        for mark in _THOUSANDS_MARKS:
            marked = [cell for cell in numbers if mark in cell]
            # sure by a mark that is never of decimals, or by one number that has it twice, or has both
            sure = mark in _NEVER_DECIMAL or any(cell.count(mark) > 1 or decimal in cell for cell in marked)
            if marked and mark != decimal and sure and all(map(_group_pattern(mark, decimal).fullmatch, numbers)):
                message = f"every number has {mark!r} between thousands and {decimal!r} before decimals"
                finding = Finding("thousands_marks", header.channels[i].name, None, message)
                found.append(NotationColumn(i, partial(_ungrouped, mark, decimal), (finding,)))
    done = {column.field for column in found}
    others = {i: cells for i, cells in columns.items() if i not in done and cells and all(map(is_number_like, cells))}
    signs = {cell[0] for cells in others.values() for cell in cells} & {"-", MINUS}
    for i, cells in others.items():  # all numbers of a column are foreign; a typographic minus is of the whole file
        foreign = [cell for cell in cells if _plain(decimal, cell) is not None]
        if signs == {MINUS} or len(foreign) == len(cells):
            message = f"numbers such as {foreign[0]!r} are read as {plain_number(foreign[0])}" if foreign else ""
            finding = Finding("number_notation", header.channels[i].name, None, message)
            found.append(NotationColumn(i, partial(_plain, decimal), (finding,) if foreign else ()))
    return tuple(found)


def rounded_numbers(rows: Sequence[Sequence[str]], header: Header, passed_over: Collection[int]) -> list[Finding]:
    """The columns in which some of these ``rows`` hold whole numbers that float64 rounds, each with the first one."""
    found = []
    for i, channel in enumerate(header.channels):
        cells = (row[i] for row in rows if len(row) == header.fields and len(row[i]) > _EXACT_DIGITS)
        whole = (cell for cell in cells if is_without_exponent(cell) and cell.lstrip("+-").isdigit())
        first = next((cell for cell in whole if not is_exact(cell)), None)
        if first is not None and i not in passed_over:
            message = f"holds whole numbers beyond 2**53, such as {first}, which float64 rounds to {float(first):.0f}"
            found.append(Finding("not_exact", channel.name, None, message))
    return found


def _group_pattern(mark: str, decimal: str) -> "re.Pattern[str]":
    one, point = re.escape(mark), re.escape(decimal)
    return re.compile(rf"[+-]?(?:\d{{1,3}}|[1-9]\d{{0,2}}(?:{one}\d{{3}})+)(?:{point}\d*)?(?:[eE][+-]?\d+)?", re.ASCII)


def _ungrouped(mark: str, decimal: str, cell: str) -> str | None:
    """The number without its marks of thousands; None if it has none, or is not grouped by threes."""
    if mark not in cell or _group_pattern(mark, decimal).fullmatch(cell) is None:
        return None
    return cell.replace(mark, "").replace(decimal, ".")


def _plain(decimal: str, cell: str) -> str | None:
    """The number as ``float()`` reads it; None if the cell stays as it is."""
    plain = plain_number(cell)
    if plain == cell or decimal_mark(plain) not in ("", decimal):
        return None
    return plain.replace(decimal, ".")


_TEN_DIGITS = 10  # seconds since 1970 have no more before the point until the year 2286
_SINCE_1970 = {13: 1e-3, 16: 1e-6, 19: 1e-9}
"""Seconds in a unit, by the digits of a time since 1970 that is counted in it, from 2001 to 2286."""
_ORDERS = {"dmy": "day before month", "mdy": "month before day", "ymd": "year, month, day"}

_LONGEST = 1 << 62
"""What nanoseconds of 64 bits hold, with room for a fraction."""
_MOST_DISTINCT = 0.25
"""Where more of the rows have a second of their own, reading row by row is as quick."""
_HALF_A_DAY_S = 43_200.0
Bytes = NDArray[np.uint8]
Rows = Sequence[Sequence[str]]
Cells = Sequence[str] | Mapping[int, str]


@dataclass(frozen=True)
class TimestampColumn(RewrittenColumn):
    """The column ``field`` as seconds from its first time; ``date_field`` is the column of its dates, if apart.

    ``only_date`` is the one date whose day and month may be either; ``is_stated``: a person stated the order.
    """

    notation: TimeNotation
    zero: int = 0
    zero_text: str = ""
    decimals: int = 0
    date_field: int | None = None
    order: str = ""
    only_date: tuple[int, int, int] | None = None
    is_stated: bool = False

    @property
    def is_of_day(self) -> bool:
        """Whether there is no date, so that the time starts again at midnight."""
        return not self.notation.date

    def zero_time(self, source: str) -> StartTime | None:
        """The first time, if its date is known; in the zone in which it is written."""
        if self.is_of_day or self.only_date:
            return None
        minutes = zone_minutes(self.zero_text.rpartition(" ")[2] if self.date_field is not None else self.zero_text)
        nanoseconds = self.zero - header_claims.DAYS_TO_1970 * DAY
        return point_in_time(nanoseconds, source, 10.0**-self.decimals, minutes if self.notation.zone else None)

    def number(self, cells: Sequence[str]) -> str | None:
        """The seconds in the row of these cells, in as many decimals as it was written; None if there is no time.

        One that is written shorter than the first one gets a digit more, so that it is never taken for a whole one.
        """
        time = read_timestamp(cells[self.field])
        if time is None or (nanoseconds := self._since_zero(time, cells)) is None:
            return None
        decimals = time.decimals if time.decimals >= self.decimals else self.decimals + 1
        scaled = nanoseconds * 10 ** max(0, decimals - 9) // 10 ** max(0, 9 - decimals)
        return _decimal_text(scaled, decimals)

    def block(self, plain: bytes, parser: RowParser) -> bytes | None:
        """The rows with times as seconds, all at once; None where rows or times are of several forms, or shorter."""
        fields = [self.field] if self.date_field is None else [self.field, self.date_field]
        cells = _cells_of_one_width(plain, parser, fields)
        span = None if cells is None else fraction_span(cells[0][1][0].tobytes().decode("latin-1"))
        if cells is None or span is None or not self.decimals <= span[1] - span[0] <= 9:
            return None
        nanoseconds = self._all_nanoseconds(dict(zip(fields, (text for _, text in cells), strict=True)), span)
        return None if nanoseconds is None else _replaced(plain, cells, nanoseconds, span[1] - span[0], parser)

    def _all_nanoseconds(self, texts: dict[int, Bytes], span: tuple[int, int]) -> Places | None:
        """Each row's time since ``zero``, (rows,) [ns]; None if one is no time, or many have a second of their own.

        ``texts`` are the cells of the times, then of their dates, by field; ``span`` is the place of the fraction.
        """
        times = texts[self.field]
        digits = times[:, span[0] : span[1]].astype(np.int64) - ord("0")
        if ((digits < 0) | (digits > 9)).any():
            return None
        times[:, span[0] : span[1]] = ord("0")
        keys = np.hstack(list(texts.values()))
        first = np.flatnonzero(np.concatenate(([True], (keys[1:] != keys[:-1]).any(axis=1))))
        if len(first) > max(1.0, _MOST_DISTINCT * len(keys)):
            return None
        whole = np.empty(len(first), dtype=np.int64)
        for i, row in enumerate(first):  # each distinct second once
            cells = {i: text[row].tobytes().decode("latin-1") for i, text in texts.items()}
            value = self.nanoseconds(cells) if fraction_span(cells[self.field]) == span else None
            if value is None or abs(value) > _LONGEST:
                return None
            whole[i] = value
        scale = 10 ** np.arange(8, 8 - digits.shape[1], -1, dtype=np.int64)
        return np.repeat(whole, np.diff(np.append(first, len(keys)))) + digits @ scale

    def nanoseconds(self, cells: Cells) -> int | None:
        """The time in the row of these cells since ``zero`` [ns]; None if there is none."""
        time = read_timestamp(cells[self.field])
        return None if time is None else self._since_zero(time, cells)

    def _since_zero(self, time: Timestamp, cells: Cells) -> int | None:
        """The time with the days of the row's date [ns]; None if it is no date, or in another notation."""
        dated = time if self.date_field is None else read_timestamp(cells[self.date_field])
        alone = self.notation if self.date_field is None else TimeNotation("", True, self.notation.zone)
        if dated is None or (time.notation, dated.notation.date) != (alone, self.notation.date):
            return None
        days = dated.days(self.order) if self.only_date is None else 0 if dated.date == self.only_date else None
        return None if days is None else days * DAY + time.nanoseconds - self.zero


def _counted(zero_text: str, least_decimals: int, cell: str) -> str | None:
    """The difference of a number to the first one, to its last digit."""
    if not is_without_exponent(cell):
        return None
    decimals = max(least_decimals, len(cell.replace(",", ".").partition(".")[2]))
    return _decimal_text(_scaled(cell, decimals) - _scaled(zero_text, decimals), decimals)


def _scaled(cell: str, decimals: int) -> int:
    """The number in units of its last decimal."""
    whole, _, rest = cell.replace(",", ".").partition(".")
    return int(whole + rest.ljust(decimals, "0"))


def _decimal_text(scaled: int, decimals: int) -> str:
    sign, digits = "-" if scaled < 0 else "", str(abs(scaled)).rjust(decimals + 1, "0")
    return f"{sign}{digits[:-decimals]}.{digits[-decimals:]}" if decimals else sign + digits


@dataclass(frozen=True)
class TimeColumns:
    """The times of a text: columns that become numbers, ``texts`` that do not, and findings on them.

    ``coarse`` columns repeat their times; ``digits`` is how many a number called time has before its point, and
    too many for seconds if it may be a day.
    """

    columns: tuple[TimestampColumn | NotationColumn, ...] = ()
    texts: frozenset[int] = frozenset()
    coarse: frozenset[int] = frozenset()
    findings: tuple[Finding, ...] = ()
    digits: dict[int, int] = field(default_factory=dict)

    @property
    def timestamps(self) -> "tuple[TimestampColumn, ...]":
        """The columns whose times are written as text."""
        return tuple(column for column in self.columns if isinstance(column, TimestampColumn))

    @property
    def dates(self) -> frozenset[int]:
        """Columns of dates, which the times of other columns take up."""
        return frozenset(c.date_field for c in self.timestamps if c.date_field is not None)

    @property
    def fields(self) -> frozenset[int]:
        """All columns that hold times, as numbers or not."""
        return frozenset(column.field for column in self.columns) | self.texts | self.dates

    def channels(self, channels: Sequence[Channel]) -> tuple[Channel, ...]:
        """The channels, those of times as text in seconds."""
        stamps = {column.field for column in self.timestamps}
        return tuple(Channel(c.name, "s", c.label) if i in stamps else c for i, c in enumerate(channels))

    def zeros(self, channels: Sequence[Channel]) -> dict[str, str]:
        """The first time of each column as it was written."""
        return {f"zero of {channels[column.field].name}": column.zero_text for column in self.columns}

    def zero(self, channels: Sequence[Channel], clock: int) -> StartTime | None:
        """When the time of the clock in this field is zero: its first time as text, or 1970 where its name says so."""
        column = next((c for c in self.columns if c.field == clock), None)
        name = channels[clock].name
        if isinstance(column, TimestampColumn):
            return column.zero_time(f"first time of {name}")
        unit = channels[clock].unit
        digits = self.digits.get(clock, 0)
        in_seconds = 1.0 if digits == _TEN_DIGITS else _unit_since_1970(channels[clock], digits)
        seconds = seconds_per(unit) if unit else in_seconds
        if not is_since_1970(name) or seconds is None:
            return None
        first = Decimal(column.zero_text.replace(",", ".")) if column is not None else Decimal(0)
        return point_in_time(int(first * Decimal(repr(seconds)) * SECOND), f"{name}, since 1970")

    def clock(self, channels: Sequence[Channel], kept: Sequence[int]) -> TimeColumn | None:
        """The clock among the ``kept`` of ``channels``: numbers called time, else times as text that do not repeat."""
        stamps = {column.field for column in self.timestamps}
        numbers = time_column([Channel("-") if i in stamps else channels[i] for i in kept])
        if numbers is not None:
            at = kept[numbers.index]
            if not numbers.assumed or self.digits.get(at, 0) <= _TEN_DIGITS:
                return numbers
            # too large for seconds since 1970, or maybe days: no unit is assumed, but ``unix`` in a name shows it
            return TimeColumn(numbers.index, _unit_since_1970(channels[at], self.digits[at]))
        fine = [i for i in kept if i in stamps - self.coarse]
        named = [i for i in fine if is_time_name(channels[i].name)]
        return TimeColumn(list(kept).index((named or fine)[0])) if fine else None


def _unit_since_1970(channel: Channel, digits: int) -> float | None:
    """Seconds in the unit of times since 1970, by their digits; None if the name does not say that they are such."""
    return _SINCE_1970.get(digits) if is_since_1970(channel.name) else None


def is_since_1970(name: str) -> bool:
    """Whether a name says that times are counted since 1970."""
    return any(word in name.casefold() for word in ("unix", "epoch", "posix"))


def find_time_columns(rows: Rows, ends: Rows, header: Header, order: str = "") -> TimeColumns:
    """The times in the columns of the first ``rows`` of a file, whose last ones are ``ends``.

    ``order`` (dmy, mdy, ymd) is what a person states of dates whose notation leaves it open.
    """
    rows = [cells for cells in rows if len(cells) == header.fields]
    found = {i: notation for i in range(len(header.channels)) if (notation := _usual_notation(rows, i)) is not None}
    dates = [i for i, notation in found.items() if not notation.clock]
    columns, findings = list[TimestampColumn | NotationColumn](), list[Finding]()
    texts, coarse, digits = {*dates}, set[int](), dict[int, int]()
    for i, notation in found.items():
        if not notation.clock:
            continue
        apart = dates[0] if not notation.date and len(dates) == 1 else None
        dated = replace(notation, date=notation.date if apart is None else found[apart].date)
        column = _with_zero(TimestampColumn(i, dated, date_field=apart), rows, ends, order)
        name = header.channels[i].name
        if not isinstance(column, TimestampColumn):  # no clear one
            texts.add(i)
            findings += [Finding("ambiguous_date", name, None, column)] if column else []
            continue
        columns.append(column)
        texts -= {apart}
        findings.append(Finding("time_as_text", name, None, _how_it_is_read(column)))
        repeats, is_coarse = _repeats(column, rows)
        if is_coarse:
            coarse.add(i)
            message = f"{repeats} of the first {len(rows)} times repeat the one before, for they are written to "
            message += f"{10.0**-column.decimals:g} s: a channel, and no clock"
            findings.append(Finding("time_coarse", name, None, message))
    for i, channel in enumerate(header.channels):
        cells = [row[i] for row in rows if not is_missing(row[i])]
        if i not in found and is_time_name(channel.name) and cells and all(map(is_without_exponent, cells)):
            long, digits[i] = _numbered(i, channel, cells, findings)
            columns += [long] if long else []
    return TimeColumns(tuple(columns), frozenset(texts), frozenset(coarse), tuple(findings), digits)


def _usual_notation(rows: Rows, i: int) -> TimeNotation | None:
    """The notation of time that most cells of a column have, but for those that are missing."""
    read = Counter(_notation(cells[i]) for cells in rows if not is_missing(cells[i]))
    notation, count = read.most_common(1)[0] if read else (None, 0)
    return notation if 2 * count > read.total() else None


@lru_cache(4096)
def _notation(cell: str) -> TimeNotation | None:
    time = read_timestamp(cell)
    return None if time is None else time.notation


def _with_zero(begun: TimestampColumn, rows: Rows, ends: Rows, stated: str) -> TimestampColumn | str | None:
    """The column with its zero and the order of day and month, or why they remain open."""
    dated = begun.field if begun.date_field is None else begun.date_field
    whole = [cells for cells in rows if _notation(cells[begun.field]) and _notation(cells[dated])]
    if not whole:
        return None
    if begun.notation.date.startswith("?") or (stated and begun.notation.date == "dmy"):
        texts = [row[dated] for row in (*whole, *ends) if len(row) > dated]
        ordered = _with_order(begun, [time for text in texts if (time := read_timestamp(text)) is not None], stated)
        if isinstance(ordered, str):
            return ordered
        begun = ordered
    for cells in whole:
        time = read_timestamp(cells[begun.field])
        if time is not None and (zero := begun.nanoseconds(cells)) is not None:
            text = " ".join(dict.fromkeys((cells[dated], cells[begun.field])))
            return replace(begun, zero=zero, zero_text=text, decimals=time.decimals)
    return f"{whole[0][dated]}: no such date; expected one such as 2024-03-01"


def _with_order(begun: TimestampColumn, seen: Sequence[Timestamp], stated: str) -> TimestampColumn | str:
    """The column with the order of day and month as stated, or as its dates show; or what contradicts it."""
    dates = [time.date for time in seen]
    slashed = ["/".join(map(str, date)) for date in dates]
    if stated:
        wrong = next((text for time, text in zip(seen, slashed, strict=True) if time.days(stated) is None), None)
        if wrong is not None:
            return f"{wrong} is no date in the order {stated}, which --date-order states: say another"
        return replace(begun, order=stated, is_stated=True)
    first, second = (max(date[k] for date in dates) > 12 for k in (0, 1))
    if begun.notation.date == "??y" and first != second:
        return replace(begun, order="dmy" if first else "mdy")
    if len(set(dates)) > 1:
        other = next(text for text in slashed if text != slashed[0])
        return (
            f"{slashed[0]} and {other}: day or month first? state it, --date-order dmy or mdy (ymd for a year of two "
            "digits in front); without it there are no times"
        )
    return replace(begun, only_date=dates[0])


def _repeats(column: TimestampColumn, rows: Rows) -> tuple[int, bool]:
    """How many times repeat the one before; whether they are written too coarsely for a clock.

    They are if most repeat, or if some do and the others go on by the last digit that is written.
    """
    times = [time for row in rows if (time := column.nanoseconds(row)) is not None]
    steps = [after - before for before, after in pairwise(times)]
    repeats, longer = steps.count(0), sorted(step for step in steps if step > 0)
    by_last_digit = bool(longer) and longer[len(longer) // 2] <= 10 ** (9 - min(9, column.decimals))
    return repeats, repeats > 0 and (2 * repeats > len(steps) or by_last_digit)


def _how_it_is_read(column: TimestampColumn) -> str:
    text = f"written as text, kept as seconds from the first, {column.zero_text!r}"
    if column.date_field is not None:
        text += f"; the dates are those of column {column.date_field + 1}"
    if column.order:
        text += f"; {_ORDERS[column.order]}, as {'--date-order states' if column.is_stated else 'the dates show'}"
    if column.only_date:
        text += "; all are of one date, in which either number may be the day"
    if column.is_of_day:
        text += "; without dates, the hours go on after midnight"
    return text


def _numbered(
    i: int, channel: Channel, cells: Sequence[str], findings: list[Finding]
) -> tuple[NotationColumn | None, int]:
    """A column of numbers called time, counted from the first if float64 does not hold them; and their digits."""
    whole, _, decimals = cells[0].lstrip("+-").replace(",", ".").partition(".")
    first, last = (float(cell.replace(",", ".")) for cell in (cells[0], cells[-1]))
    days = header_claims.may_be_days(first, (last - first) / len(cells))
    if channel.unit is None and (unit := _unit_since_1970(channel, len(whole))):
        message = f"times such as {cells[0]} are counted since 1970 in units of {unit:g} s, as their digits tell"
        findings.append(Finding("time_as_text", channel.name, None, message))
    column = None
    if not all(map(_is_kept_by_float, cells)):
        column = NotationColumn(i, partial(_counted, cells[0], len(decimals)), zero_text=cells[0])
        message = f"numbers of more digits than float64 holds, kept as counted from the first, {cells[0]}"
        findings.append(Finding("time_as_text", channel.name, None, message))
    return column, _TEN_DIGITS + 1 if days else len(whole)


def _is_kept_by_float(cell: str) -> bool:
    """Whether float64 holds a number: few digits, a whole number that is one of its own, or such a fraction's shortest
    digits, as Python and others write them so that they are read back.
    """
    written = cell.replace(",", ".")
    if sum(c.isdigit() for c in written.lstrip("+-0.")) <= _EXACT_DIGITS:
        return True
    return Decimal(repr(float(written))) == Decimal(written) if "." in written else is_exact(written)


def _cells_of_one_width(plain: bytes, parser: RowParser, fields: Sequence[int]) -> list[tuple[Places, Bytes]] | None:
    """Where the cells of each of the ``fields`` begin, (rows,), and their bytes, (rows, width).

    None if a row has more or fewer cells, or those of a field are not of one width.
    """
    data, (begins, ends) = np.frombuffer(plain, dtype=np.uint8), parser.cells(plain)
    if not len(ends) or len(ends) % parser.fields or data[-1] != ord("\n"):
        return None
    is_end = (data[ends] == ord("\n")).reshape(-1, parser.fields)
    if not is_end[:, -1].all() or is_end[:, :-1].any():
        return None
    found = []
    for i in fields:
        first = begins[i :: parser.fields]
        widths = ends[i :: parser.fields] - first
        if not widths[0] or (widths != widths[0]).any():
            return None
        found.append((first, data[first[:, None] + np.arange(widths[0])]))
    return found


def _replaced(
    plain: bytes, cells: Sequence[tuple[Places, Bytes]], nanoseconds: Places, decimals: int, parser: RowParser
) -> bytes | None:
    """The rows with numbers in place of times, right-aligned, what they do not need of the cell cut out."""
    data, ((begins, text), *dates) = np.frombuffer(plain, dtype=np.uint8), cells
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
