"""Columns of times that are written as text, or too long for float64: their numbers, exactly."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ...recording import Channel
from . import marks, moments
from .moments import DAY, Moment, Notation

_LONGEST = 30


@dataclass(frozen=True)
class Stamps:
    """The column ``field`` as seconds from its first time; ``date_field`` is the column of its dates, if apart.

    ``only_date`` is the one date whose day and month need not be told apart; ``is_stated``: a person said the order.
    """

    field: int
    notation: Notation
    zero: int
    zero_text: str
    decimals: int
    date_field: int | None = None
    order: str = ""
    only_date: tuple[int, int, int] | None = None
    is_stated: bool = False

    @property
    def is_of_day(self) -> bool:
        """Whether there is no date, so that the time starts again at midnight."""
        return not self.notation.date

    def channel(self, channel: Channel) -> Channel:
        """The channel as it is given: in seconds."""
        return Channel(channel.name, "s", channel.label)

    def number(self, cells: Sequence[str]) -> str | None:
        """The seconds in the row of these cells, in as many decimals as it was written; None if there is no time.

        One that is written shorter than the first one gets a digit more, so that it is never taken for a whole one.
        """
        moment = moments.read(cells[self.field])
        days = None if moment is None else self.days_of(moment, cells)
        if moment is None or days is None:
            return None
        decimals = moment.decimals if moment.decimals >= self.decimals else self.decimals + 1
        return _decimal(days * DAY + moment.nanoseconds - self.zero, decimals)

    def nanoseconds(self, cells: Sequence[str] | Mapping[int, str]) -> int | None:
        """The time in the row of these cells, counted as ``zero`` is; None if there is none."""
        moment = moments.read(cells[self.field])
        days = None if moment is None else self.days_of(moment, cells)
        return None if moment is None or days is None else days * DAY + moment.nanoseconds

    def days_of(self, moment: Moment, cells: Sequence[str] | Mapping[int, str]) -> int | None:
        """The days of the row's date; None if it is no date, or in another notation."""
        dated = moment if self.date_field is None else moments.read(cells[self.date_field])
        if dated is None or (moment.notation, dated.notation.date) != (_of_clock(self), self.notation.date):
            return None
        if self.only_date is not None:
            return 0 if dated.date == self.only_date else None
        return dated.days(self.order)


def _of_clock(stamps: Stamps) -> Notation:
    """The notation of the cells of the time alone."""
    return stamps.notation if stamps.date_field is None else Notation("", True, stamps.notation.zone)


@dataclass(frozen=True)
class Counted:
    """The column ``field`` of long numbers, such as nanoseconds since 1970, counted from its first one."""

    field: int
    zero_text: str
    decimals: int

    def channel(self, channel: Channel) -> Channel:
        """The channel as it is given: its unit is kept."""
        return channel

    def number(self, cells: Sequence[str]) -> str | None:
        """The difference to the first number, to its last digit."""
        cell = cells[self.field]
        if len(cell) > _LONGEST or not is_plain(cell):
            return None
        decimals = max(self.decimals, len(cell.replace(",", ".").partition(".")[2]))
        return _decimal_of(_scaled(cell, decimals) - _scaled(self.zero_text, decimals), decimals)


def is_plain(cell: str) -> bool:
    """Whether a cell is a number without an exponent."""
    return len(cell) <= _LONGEST and marks.mark_of(cell) is not None and "e" not in cell.casefold()


def _scaled(cell: str, decimals: int) -> int:
    """The number in units of its last decimal."""
    whole, _, rest = cell.replace(",", ".").partition(".")
    return int(whole + rest.ljust(decimals, "0"))


def _decimal(nanoseconds: int, decimals: int) -> str:
    """Nanoseconds as seconds, of up to nine decimals or with zeros behind them."""
    return _decimal_of(nanoseconds * 10 ** max(0, decimals - 9) // 10 ** max(0, 9 - decimals), decimals)


def _decimal_of(scaled: int, decimals: int) -> str:
    sign, digits = "-" if scaled < 0 else "", str(abs(scaled)).rjust(decimals + 1, "0")
    return f"{sign}{digits[:-decimals]}.{digits[-decimals:]}" if decimals else sign + digits
