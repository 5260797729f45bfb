"""What one cell may be: a number with a decimal point or comma, one with doubtful marks, a time, a missing value."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from functools import lru_cache

MINUS = "\N{MINUS SIGN}"
_NUMBER = re.compile(r"[+-]?(?:\d++(?:[.,]\d*+)?|[.,]\d++)(?:[eE][+-]?\d++)?", re.ASCII)
_LOOSE = re.compile(
    r"[+-]?(?:(?=[.,'’]*\d)[\d.,'’]++|\d{1,3}(?:[ \u00a0\u202f]\d{3})+(?:[.,]\d*)?)(?:[eE][+-]?\d+)?", re.ASCII
)
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}", re.ASCII)
_FORTRAN = re.compile(r"([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+))[dD]([+-]?\d{1,3})", re.ASCII)
_HEXADECIMAL = re.compile(r"0[xX][0-9a-fA-F]{1,13}", re.ASCII)
_BARE_HEXADECIMAL = re.compile(r"(?=.*\d)(?=.*[A-Fa-f])(?![Ee]\d+$)(?:\d[\dA-Fa-f]{2,15}|[\dA-Fa-f]{4,16})", re.ASCII)
_DECORATED = re.compile(
    r"""[("']?\s*[+-]?\s*(?=[.,\d]*\d)[\d.,_]++(?:[eEdD][+-]?\d+|(?<=[.,\d]{3})[+-]\d{2,3})?\s?"""
    r"""(?:[)"'-]|[%°]?[A-Za-zµ]{0,3})"""
)
_LONGEST_NUMBER = 30
_MISSING = frozenset((
    "nan", "+nan", "-nan", "inf", "+inf", "-inf", "infinity", "-infinity", "na", "n/a", "#n/a", "null", "none", "-",
    "--", "---", "?", "*",
))  # fmt: skip
"""Words for no value, next to 1.#QNAN, 1.#IND and their kin."""


def as_number(text: str | bytes | float) -> float | None:
    """What ``float()`` makes of it; None if that is nothing."""
    try:
        return float(text)
    except ValueError:
        return None


@lru_cache(maxsize=1 << 14)
def decimal_mark(cell: str) -> str | None:
    """``.`` or ``,`` if the cell is a number with that decimal mark; ``""`` for an integer; None otherwise."""
    cell = cell.strip()
    if _NUMBER.fullmatch(cell) is None:
        return None
    return "." if "." in cell else "," if "," in cell else ""


def may_be_thousands(cell: str) -> bool:
    """Whether the one mark of ``1.234`` may be of thousands: one to three digits, then exactly three."""
    return _THOUSANDS.fullmatch(cell.strip()) is not None


def is_ambiguous(cell: str) -> bool:
    """Digits with several marks, such as ``1.234,5``, ``1'234`` or ``1 234``: no number in any dialect."""
    return decimal_mark(cell) is None and _LOOSE.fullmatch(cell.strip()) is not None


def is_number_like(cell: str) -> bool:
    """Whether the cell has the look of a number, in whatever dialect."""
    return decimal_mark(cell) is not None or _LOOSE.fullmatch(plain_number(cell.strip())) is not None


def is_word(cell: str) -> bool:
    """Whether the cell begins with a letter, and is no number and no word for a missing value."""
    return cell.strip()[:1].isalpha() and not is_missing(cell) and not is_number_like(cell)


def is_bare_hexadecimal(cell: str) -> bool:
    """Whether the cell has digits and letters up to F, such as ``01C3``; ``E5`` and ``E005`` are codes of errors."""
    return decimal_mark(cell) is None and _BARE_HEXADECIMAL.fullmatch(cell.strip()) is not None


def is_decorated(cell: str) -> bool:
    """Whether the cell is one number and signs: ``"1.5"``, ``(1.5)``, ``1.5-``, ``1.5D+03``, ``1.5 k``."""
    return plain_number(cell.strip()) != cell.strip() or _DECORATED.fullmatch(cell.strip()) is not None


@lru_cache(maxsize=1 << 14)
def plain_number(cell: str) -> str:
    """The number ``−1.5D+03`` as ``-1.5e+03``, ``0x1F`` as ``31``; every other cell as it is.

    ``12D4`` stays, for it may be the name of a part: a decimal mark or a sign shows an exponent.
    """
    if _HEXADECIMAL.fullmatch(cell):
        return str(int(cell, 16))
    plain = cell.replace(MINUS, "-")
    if (match := _FORTRAN.fullmatch(plain)) and (set(match[1]) & set(".,") or match[2][0] in "+-"):
        plain = f"{match[1]}e{match[2]}"
    return plain if decimal_mark(plain) is not None else cell


def is_without_exponent(cell: str) -> bool:
    """Whether a cell is a number of few characters without an exponent."""
    return len(cell) <= _LONGEST_NUMBER and decimal_mark(cell) is not None and "e" not in cell.casefold()


def is_exact(whole: str) -> bool:
    """Whether float64 holds a whole number to its last digit."""
    return int(float(whole)) == int(whole)


def is_missing(cell: str) -> bool:
    """Whether the cell is empty or a usual word for no value."""
    cell = cell.strip().casefold()
    return not cell or cell in _MISSING or cell.startswith(("1.#", "-1.#"))


SECOND = 1_000_000_000
"""Nanoseconds in a second."""
DAY = 86_400 * SECOND
"""Nanoseconds in a day."""
_DATES = (
    ("ymd", r"(?P<a>\d{4})(?P<by>[-/.])(?P<b>\d{1,2})(?P=by)(?P<c>\d{1,2})"),
    ("dmy", r"(?P<a>\d{1,2})\.(?P<b>\d{1,2})\.(?P<c>\d{4})"),  # no country writes months first with points
    ("??y", r"(?P<a>\d{1,2})(?P<by>[-/])(?P<b>\d{1,2})(?P=by)(?P<c>\d{4})"),
    ("??2", r"(?P<a>\d{1,2})(?P<by>[-/.])(?P<b>\d{1,2})(?P=by)(?P<c>\d{2})"),
    ("named", r"(?P<a>\d{1,2})[- ](?P<b>[A-Za-z]{3})[- ](?P<c>\d{4})"),
    ("ymd", r"(?P<a>\d{4})(?P<b>\d{2})(?P<c>\d{2})(?=T\d{6})"),
)
"""Notations of dates: the name of each, and how its three numbers a, b and c are written."""
_CLOCKS = (
    r"(?P<h>\d{1,4}):(?P<m>[0-5]\d):(?P<s>[0-5]\d)(?:[.,](?P<f>\d+)|:(?P<ms>\d{3}))?"
    r"(?:\s?(?P<half>[AaPp])\.?[Mm]\.?)?",
    r"(?P<m>\d{1,4}):(?P<s>[0-5]\d)[.,](?P<f>\d+)",
    r"(?<=T)(?P<h>[0-2]\d)(?P<m>[0-5]\d)(?P<s>[0-5]\d)(?:[.,](?P<f>\d+))?",
)
"""Notations of times of day: with hours; minutes and seconds of a stop watch; packed behind a date."""
_ZONE = r"(?:\s?(?P<zone>[Zz]|UTC|GMT|[+-]\d{2}(?::?\d{2})?))?"
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")


def _any_of(patterns: Sequence[str], kind: str) -> str:
    """One pattern of several, in which the group ``a`` of the third is called ``a_date2``, for a kind ``date``."""
    return "|".join(re.sub(r"\?P([<=])(\w+)", rf"?P\1\2_{kind}{k}", text) for k, text in enumerate(patterns))


_DATE, _CLOCK = _any_of([pattern for _, pattern in _DATES], "date"), _any_of(_CLOCKS, "clock")
_TIMESTAMP = re.compile(rf"(?:{_DATE})?(?:(?<=\d)(?:T|[ _]+|, ?))?(?:(?:{_CLOCK}){_ZONE})?", re.ASCII)


@dataclass(frozen=True)
class TimeNotation:
    """How a time is written: the date as ``ymd``, ``dmy``, ``named``, ``??y`` (day or month first) or ``??2`` (years
    of two digits); whether there is a time of day; whether that has a zone.
    """

    date: str
    clock: bool
    zone: bool


@dataclass(frozen=True)
class Timestamp:
    """A time as written: the three numbers of its date in their order, nanoseconds of the day less its zone."""

    notation: TimeNotation
    date: tuple[int, int, int]
    nanoseconds: int
    decimals: int

    def days(self, order: str = "") -> int | None:
        """Days of the date, counted in the calendar; None if there is no such date.

        ``order`` (dmy, mdy, ymd) where the notation leaves it open. Years of two digits are of this century.
        """
        if not self.notation.date:
            return 0
        order = order or self.notation.date
        a, b, c = self.date
        year, month, day = (a, b, c) if order == "ymd" else (c, a, b) if order == "mdy" else (c, b, a)
        try:
            return date(year + (2000 if self.notation.date == "??2" else 0), month, day).toordinal()
        except ValueError:
            return None


def read_timestamp(text: str) -> Timestamp | None:
    """The time that a cell's text is; None if it is none, or one finer than a nanosecond."""
    if not 5 <= len(text) <= 48 or (match := _TIMESTAMP.fullmatch(text)) is None:
        return None
    found = {key.partition("_")[0]: value for key, value in match.groupdict().items() if value is not None}
    notation = next((name for k, (name, _) in enumerate(_DATES) if match[f"a_date{k}"]), "")
    months = {name: i for i, name in enumerate(_MONTHS, 1)}
    a, b, c = (int(n) if n.isdigit() else months.get(n.casefold(), 0) for n in (found.get(key, "0") for key in "abc"))
    fraction, half = found.get("f") or found.get("ms") or "", found.get("half")
    hours, minutes, seconds = (int(found.get(key, "0")) for key in "hms")
    # finer than a nanosecond, no hour of a half day, or no hour of a day; hours beyond 24 are those of a stop watch
    if fraction[9:].strip("0") or (half and not 1 <= hours <= 12):
        return None
    if half:
        hours = hours % 12 + (12 if half in "pP" else 0)
    if notation and hours > 23:
        return None
    whole = 3600 * hours + 60 * minutes + seconds - _seconds_east(found.get("zone", ""))
    clock = whole * SECOND + int(fraction[:9].ljust(9, "0"))
    return Timestamp(TimeNotation(notation, "m" in found, "zone" in found), (a, b, c), clock, len(fraction))


def fraction_span(text: str) -> tuple[int, int] | None:
    """Where the digits behind the seconds begin and end; None if there are none, or it is no time."""
    match = _TIMESTAMP.fullmatch(text)
    if match is None:
        return None
    names = (key for key, value in match.groupdict().items() if value and key.startswith(("f_", "ms_")))
    return next(map(match.span, names), None)


def zone_minutes(text: str) -> int:
    """The offset from UTC in which a time is written [min]."""
    match = _TIMESTAMP.fullmatch(text)
    zones = [value for key, value in match.groupdict().items() if value and key.startswith("zone")] if match else []
    return _seconds_east(zones[0]) // 60 if zones else 0


def _seconds_east(zone: str) -> int:
    if zone[:1] not in ("+", "-"):
        return 0
    digits = zone[1:].replace(":", "").ljust(4, "0")
    return (1 if zone[0] == "+" else -1) * (3600 * int(digits[:2]) + 60 * int(digits[2:]))
