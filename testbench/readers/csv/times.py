"""Which columns of a text hold times that no float64 spells, and which column is the clock."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from functools import lru_cache
from itertools import pairwise

from ...findings import Finding
from ...recording import Channel, TimeColumn
from .. import doubt
from . import marks, moments, names
from .exact import is_exact
from .header import Header
from .moments import DAY, Moment, Notation
from .stamps import Counted, Stamps, is_plain

_SIGNIFICANT = 15  # digits of a decimal number that float64 holds whatever they are
_TEN_DIGITS = 10  # seconds since 1970 have no more before the point until the year 2286
_SINCE_1970 = {13: 1e-3, 16: 1e-6, 19: 1e-9}
"""Seconds in a unit, by the digits of a time since 1970 that is counted in it, from 2001 to 2286."""
_ORDERS = {"dmy": "day before month", "mdy": "month before day", "ymd": "year, month, day"}

Rows = Sequence[Sequence[str]]


@dataclass(frozen=True)
class Times:
    """The times that were found: columns that become numbers, ``texts`` that do not, what is said of them.

    ``coarse`` columns repeat their times; ``digits`` is how many a number called time has before its point, and
    too many for seconds if it may be a day.
    """

    columns: tuple[Stamps | Counted, ...] = ()
    texts: frozenset[int] = frozenset()
    coarse: frozenset[int] = frozenset()
    findings: tuple[Finding, ...] = ()
    digits: dict[int, int] = field(default_factory=dict)

    @property
    def taken_up(self) -> frozenset[int]:
        """Columns of dates, which the times beside them take up."""
        return frozenset(c.date_field for c in self.columns if isinstance(c, Stamps) and c.date_field is not None)

    @property
    def spoken_for(self) -> frozenset[int]:
        """All columns that hold times, as numbers or not."""
        return frozenset(column.field for column in self.columns) | self.texts | self.taken_up

    @property
    def of_day(self) -> frozenset[int]:
        """Columns that begin again at midnight."""
        return frozenset(c.field for c in self.columns if isinstance(c, Stamps) and c.is_of_day)

    def channels(self, channels: Sequence[Channel]) -> tuple[Channel, ...]:
        """The channels, those of times in the unit in which they are given."""
        given = {column.field: column.channel(channels[column.field]) for column in self.columns}
        return tuple(given.get(i, channel) for i, channel in enumerate(channels))

    def zeros(self, channels: Sequence[Channel]) -> dict[str, str]:
        """The first time of each column as it was written."""
        return {f"zero of {channels[column.field].name}": column.zero_text for column in self.columns}

    def clock(self, channels: Sequence[Channel], kept: Sequence[int]) -> TimeColumn | None:
        """The clock among the ``kept`` of ``channels``: numbers called time, else times as text that do not repeat."""
        stamps = {column.field for column in self.columns if isinstance(column, Stamps)}
        plain = [Channel("-") if i in stamps else channels[i] for i in kept]
        if (numbers := names.time_column(plain)) is not None:
            at = kept[numbers.index]
            return _of_epoch(numbers, channels[at].name, self.digits.get(at, 0))
        fine = [i for i in kept if i in stamps - self.coarse]
        named = [i for i in fine if names.is_time(channels[i].name)]
        return TimeColumn(list(kept).index((named or fine)[0])) if fine else None


def _of_epoch(clock: TimeColumn, name: str, digits: int) -> TimeColumn:
    """Seconds are not assumed of numbers too large for seconds since 1970, or maybe days; ``unix`` tells the unit."""
    if not clock.assumed or digits <= _TEN_DIGITS:
        return clock
    return TimeColumn(clock.index, _SINCE_1970.get(digits) if _is_of_epoch(name) else None)


def _is_of_epoch(name: str) -> bool:
    return any(word in name.casefold() for word in ("unix", "epoch", "posix"))


def find(rows: Rows, last: Callable[[], Rows], header: Header, order: str = "") -> Times:
    """The times in the columns of the first ``rows`` of a file; ``last`` gives its last ones, if dates need them.

    ``order`` (dmy, mdy, ymd) is what a person says of dates whose notation leaves it open.
    """
    rows = [cells for cells in rows if len(cells) == header.fields]
    found = {i: notation for i in range(len(header.channels)) if (notation := _notation(rows, i)) is not None}
    dates = [i for i, notation in found.items() if not notation.clock]
    times = Times()
    for i, notation in found.items():
        if notation.clock:
            apart = dates[0] if not notation.date and len(dates) == 1 else None
            dated = replace(notation, date=notation.date if apart is None else found[apart].date)
            column = _column(Stamps(i, dated, 0, "", 0, apart), rows, last, order)
            times = _with(times, i, column, header.channels[i].name, rows)
    times = replace(times, texts=times.texts | frozenset(dates) - times.taken_up)
    for i, channel in enumerate(header.channels):
        if i not in found and names.is_time(channel.name):
            times = _with_numbers(times, i, channel, [row[i] for row in rows if not marks.is_missing(row[i])])
    return times


def _notation(rows: Rows, i: int) -> Notation | None:
    """The notation of time that most cells of a column have, but for those that are missing."""
    read = Counter(_notation_of(cells[i]) for cells in rows if not marks.is_missing(cells[i]))
    notation, count = read.most_common(1)[0] if read else (None, 0)
    return notation if 2 * count > read.total() else None


@lru_cache(4096)
def _notation_of(cell: str) -> Notation | None:
    moment = moments.read(cell)
    return None if moment is None else moment.notation


def _column(begun: Stamps, rows: Rows, last: Callable[[], Rows], stated: str) -> Stamps | str | None:
    """The column with its zero and the order of day and month, or why they cannot be told apart."""
    dated = begun.field if begun.date_field is None else begun.date_field
    whole = [cells for cells in rows if _notation_of(cells[begun.field]) and _notation_of(cells[dated])]
    if not whole:
        return None
    if begun.notation.date.startswith("?") or (stated and begun.notation.date == "dmy"):
        texts = [row[dated] for row in (*whole, *last()) if len(row) > dated]
        seen = [moment for text in texts if (moment := moments.read(text)) is not None]
        ordered = _ordered(begun, seen, stated)
        if isinstance(ordered, str):
            return ordered
        begun = ordered
    for cells in whole:
        moment = moments.read(cells[begun.field])
        if moment is not None and (days := begun.days_of(moment, cells)) is not None:
            text = " ".join(dict.fromkeys((cells[dated], cells[begun.field])))
            return replace(begun, zero=days * DAY + moment.nanoseconds, zero_text=text, decimals=moment.decimals)
    return f"{whole[0][dated]}: no such date; expected one such as 2024-03-01"


def _ordered(begun: Stamps, seen: Sequence[Moment], stated: str) -> Stamps | str:
    """The column with the order of day and month as stated, or as its dates show; or what stands against it."""
    if stated:
        wrong = next((moment.date for moment in seen if moment.days(stated) is None), None)
        if wrong is not None:
            return f"{_shown(wrong)} is no date in the order {stated}, which --date-order states: say another"
        return replace(begun, order=stated, is_stated=True)
    dates = [moment.date for moment in seen]
    order = _order(dates) if begun.notation.date == "??y" else ""
    if not order and len(set(dates)) > 1:
        other = next(date for date in dates if date != dates[0])
        return (
            f"{_shown(dates[0])} and {_shown(other)}: day or month first? state it, --date-order dmy or mdy (ymd for a "
            "year of two digits in front); without it there are no times"
        )
    return replace(begun, order=order, only_date=None if order else dates[0])


def _shown(date: tuple[int, int, int]) -> str:
    return "/".join(map(str, date))


def _order(dates: Sequence[tuple[int, int, int]]) -> str:
    """Day or month first, if a number above twelve tells."""
    first, second = (max(date[k] for date in dates) > 12 for k in (0, 1))
    return "" if first == second else "dmy" if first else "mdy"


def _with(times: Times, i: int, column: Stamps | str | None, name: str, rows: Rows) -> Times:
    """The times and one column more; it is left out where it is no clear one."""
    if not isinstance(column, Stamps):
        said = (Finding("ambiguous_date", name, None, column),) if column else ()
        return replace(times, texts=times.texts | {i}, findings=(*times.findings, *said))
    alike, coarse = _repeats(column, rows)
    findings = [_said(column, name)]
    if coarse:
        message = f"{alike} of the first {len(rows)} times repeat the one before, for they are written to "
        message += f"{10.0**-column.decimals:g} s: a channel, and no clock"
        findings.append(Finding("time_coarse", name, None, message))
    return replace(
        times,
        columns=(*times.columns, column),
        coarse=times.coarse | ({i} if coarse else set()),
        findings=(*times.findings, *findings),
    )


def _repeats(column: Stamps, rows: Rows) -> tuple[int, bool]:
    """How many times repeat the one before; whether they are written too coarsely for a clock.

    They are if most repeat, or if some do and the others go on by the last digit that is written.
    """
    times = [time for row in rows if (time := column.nanoseconds(row)) is not None]
    steps = [after - before for before, after in pairwise(times)]
    alike, longer = steps.count(0), sorted(step for step in steps if step > 0)
    by_last_digit = bool(longer) and longer[len(longer) // 2] <= 10 ** (9 - min(9, column.decimals))
    return alike, alike > 0 and (2 * alike > len(steps) or by_last_digit)


def _said(column: Stamps, name: str) -> Finding:
    """How the column is read."""
    text = f"written as text, kept as seconds from the first, {column.zero_text!r}"
    if column.date_field is not None:
        text += f"; the dates are those of column {column.date_field + 1}"
    if column.order:
        text += f"; {_ORDERS[column.order]}, as {'--date-order states' if column.is_stated else 'the dates show'}"
    if column.only_date:
        text += "; all are of one date, of which day and month are not told apart"
    if column.is_of_day:
        text += "; without dates, the hours go on after midnight"
    return Finding("time_as_text", name, None, text)


def _is_held(cell: str) -> bool:
    """Whether float64 holds a number: few digits, a whole number that is one of its own, or such a fraction's shortest
    digits, as Python and others write them so that they are read back.
    """
    written = cell.replace(",", ".")
    if sum(c.isdigit() for c in written.lstrip("+-0.")) <= _SIGNIFICANT:
        return True
    if "." not in written:
        return is_exact(written)
    return Decimal(repr(float(written))) == Decimal(written)


def _with_numbers(times: Times, i: int, channel: Channel, cells: Sequence[str]) -> Times:
    """The times and a column of numbers called time, counted from the first if float64 does not hold them."""
    if not cells or not all(map(is_plain, cells)):
        return times
    whole, _, decimals = cells[0].lstrip("+-").replace(",", ".").partition(".")
    first, last = (float(cell.replace(",", ".")) for cell in (cells[0], cells[-1]))
    days = doubt.may_be_days(first, (last - first) / len(cells))
    times = replace(times, digits=times.digits | {i: _TEN_DIGITS + 1 if days else len(whole)})
    name = channel.name
    said = _SINCE_1970.get(len(whole)) if channel.unit is None and _is_of_epoch(name) else None
    if said:
        message = f"times such as {cells[0]} are counted since 1970 in units of {said:g} s, as their digits tell"
        times = replace(times, findings=(*times.findings, Finding("time_as_text", name, None, message)))
    if all(map(_is_held, cells)):
        return times
    message = f"numbers of more digits than float64 holds, kept as counted from the first, {cells[0]}"
    return replace(
        times,
        columns=(*times.columns, Counted(i, cells[0], len(decimals))),
        findings=(*times.findings, Finding("time_as_text", name, None, message)),
    )
