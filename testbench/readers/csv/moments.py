"""Times that are written as text: one cell as a date and exact nanoseconds of the day."""

import re
from dataclasses import dataclass
from datetime import date

SECOND = 1_000_000_000
"""Nanoseconds in a second."""
DAY = 86_400 * SECOND
"""Nanoseconds in a day."""
_DATE = (
    r"(?:(?P<y>\d{4})(?P<by>[-/.])(?P<m>\d{1,2})(?P=by)(?P<d>\d{1,2})"
    r"|(?P<a>\d{1,2})(?P<parted>[-/.])(?P<b>\d{1,2})(?P=parted)(?P<year>\d{4}|\d{2})"
    r"|(?P<day>\d{1,2})[- ](?P<month>[A-Za-z]{3})[- ](?P<of>\d{4})"
    r"|(?P<basic>\d{8})(?=T\d{6}))"
)
_CLOCK = (
    r"(?:(?P<H>\d{1,4}):(?P<M>[0-5]\d):(?P<S>[0-5]\d)(?:[.,](?P<f>\d+)|:(?P<ms>\d{3}))?(?:\s?(?P<half>[AaPp])\.?[Mm]\.?)?"
    r"|(?P<minutes>\d{1,4}):(?P<seconds>[0-5]\d)[.,](?P<f2>\d+)"
    r"|(?<=T)(?P<packed>[0-2]\d[0-5]\d[0-5]\d)(?:[.,](?P<f3>\d+))?)"
)
_ZONE = r"(?:\s?(?P<zone>[Zz]|UTC|GMT|[+-]\d{2}(?::?\d{2})?))?"
_TEXT = re.compile(rf"(?:{_DATE})?(?:(?<=\d)(?:T|[ _]+|, ?))?(?:{_CLOCK}{_ZONE})?", re.ASCII)
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")


@dataclass(frozen=True)
class Notation:
    """How a time is written: the date as ``ymd``, ``dmy``, ``named``, ``??y`` (day or month first) or ``??2`` (years
    of two digits); whether there is a time of day; whether that has a zone.
    """

    date: str
    clock: bool
    zone: bool

    def __str__(self) -> str:
        parts = ["date" if self.date else "", "time of day" if self.clock else "", "zone" if self.zone else ""]
        return ", ".join(filter(None, parts))


@dataclass(frozen=True)
class Moment:
    """A time as written: the three numbers of its date in their order, nanoseconds of the day less its zone."""

    notation: Notation
    date: tuple[int, int, int]
    nanoseconds: int
    decimals: int

    def days(self, order: str = "") -> int | None:
        """Days of the date, counted in the calendar; ``order`` (dmy, mdy, ymd) where the notation leaves it open.

        Years of two digits are of this century.
        """
        if not self.notation.date:
            return 0
        year, month, day = _arranged(self.date, order or self.notation.date)
        century = 2000 if self.notation.date == "??2" else 0
        try:
            return date(century + year, month, day).toordinal()
        except ValueError:
            return None


def read(text: str) -> Moment | None:
    """The moment that a cell's text is; None if it is none, or one finer than a nanosecond."""
    if not 5 <= len(text) <= 48 or (match := _TEXT.fullmatch(text)) is None:
        return None
    found = {key: value for key, value in match.groupdict().items() if value is not None}
    notation, numbers = _date(found)
    clock = _clock(found, bool(notation))
    if clock is None or not (notation or found.keys() & {"H", "minutes"}):
        return None
    with_clock = bool(found.keys() & {"H", "minutes", "packed"})
    fraction = found.get("f") or found.get("f2") or found.get("f3") or found.get("ms") or ""
    return Moment(Notation(notation, with_clock, "zone" in found), numbers, clock, len(fraction))


def fraction_of(text: str) -> tuple[int, int] | None:
    """Where the digits behind the seconds begin and end; None if there are none, or it is no time."""
    match = _TEXT.fullmatch(text)
    spans = [] if match is None else [match.span(name) for name in ("f", "f2", "f3", "ms") if match[name]]
    return spans[0] if spans else None


def _date(found: dict[str, str]) -> tuple[str, tuple[int, int, int]]:
    """The date's notation and numbers. Points go with the day first: no country writes months first with points."""
    if "y" in found:
        return "ymd", (int(found["y"]), int(found["m"]), int(found["d"]))
    if "basic" in found:
        return "ymd", (int(found["basic"][:4]), int(found["basic"][4:6]), int(found["basic"][6:]))
    if "month" in found:
        month = found["month"].casefold()
        number = _MONTHS.index(month) + 1 if month in _MONTHS else 0
        return "named", (int(found["day"]), number, int(found["of"]))
    if "a" in found:
        notation = "??2" if len(found["year"]) == 2 else "dmy" if found["parted"] == "." else "??y"
        return notation, (int(found["a"]), int(found["b"]), int(found["year"]))
    return "", (0, 0, 0)


def _arranged(numbers: tuple[int, int, int], order: str) -> tuple[int, int, int]:
    """Year, month, day."""
    if order == "ymd":
        return numbers
    return (numbers[2], numbers[0], numbers[1]) if order == "mdy" else (numbers[2], numbers[1], numbers[0])


def _clock(found: dict[str, str], dated: bool) -> int | None:
    """Nanoseconds of the day; None if it is no time of day. Hours beyond 24 are those of a stop watch."""
    fraction = found.get("f") or found.get("f2") or found.get("f3") or found.get("ms", "").ljust(3, "0")
    if fraction[9:].strip("0"):
        return None
    if "packed" in found:
        hours, minutes, seconds = (int(found["packed"][i : i + 2]) for i in (0, 2, 4))
    elif "minutes" in found:
        hours, minutes, seconds = 0, int(found["minutes"]), int(found["seconds"])
    else:
        hours, minutes, seconds = (int(found.get(key, "0")) for key in "HMS")
    if half := found.get("half"):
        if not 1 <= hours <= 12:
            return None
        hours = hours % 12 + (12 if half in "pP" else 0)
    if dated and hours > 23:
        return None
    whole = 3600 * hours + 60 * minutes + seconds - _zone(found.get("zone", ""))
    return whole * SECOND + int(fraction[:9].ljust(9, "0"))


def _zone(text: str) -> int:
    """Seconds east of Greenwich."""
    if text[:1] not in ("+", "-"):
        return 0
    digits = text[1:].replace(":", "").ljust(4, "0")
    return (1 if text[0] == "+" else -1) * (3600 * int(digits[:2]) + 60 * int(digits[2:]))
