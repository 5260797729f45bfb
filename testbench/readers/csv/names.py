"""Channels from header cells: the name as written, the unit beside it; which of them is time."""

import re
from collections.abc import Sequence

from ... import units
from ...recording import Channel, TimeColumn

_BRACKETS = re.compile(r"\(([^()]*)\)|\[([^][]*)\]")
_SIGNS_OF_UNITS = re.compile(r"[^\W\d_°%µ‰][^\s]{0,9}(?:\s?[/·⋅*^]\s?[^\s]{1,10}|[²³⁻¹]+)+")
_SCALED = re.compile(r"\s*[x×*·]\s*1(?:0+|0?[\^eE][+-]?\d+)\b")
_TIME_SUFFIX = re.compile(r"(.*?)[_ ](s|sec|ms|us|µs|ns|min)", re.IGNORECASE)
_ONE_OF_SEVERAL = re.compile(r"[ .-]*(?:\d+|(?<=[ .-])[abcxyz])$")
_TIME_NAMES = frozenset({
    "t", "time", "timestamp", "time stamp", "elapsed", "elapsed time", "relative time", "test time",
    "unix", "epoch", "posix", "unix time", "unixtime", "epoch time", "posix time", "unix timestamp", "time unix",
    "timestamp unix", "time epoch",
    "zaman", "süre", "sure", "geçen süre", "zaman damgası", "zeit", "temps", "tiempo", "tempo",
})  # fmt: skip


def channels(names: Sequence[str], second_row: Sequence[str]) -> tuple[Channel, ...]:
    """The channels of these header cells, with the units of a second row where there is one."""
    return tuple(_channel(name, below) for name, below in zip(names, second_row, strict=True))


def _channel(name: str, below: str) -> Channel:
    """A channel of this header cell; its unit from the second row, from brackets, or the suffix of a time.

    Round brackets may hold anything (``Force (filtered)``): what is no known unit is one only if it is written as one.
    """
    if below:
        enclosed = _BRACKETS.fullmatch(below.strip())
        text = below.strip() if enclosed is None else (enclosed[1] or enclosed[2] or "").strip()
        return Channel(name, text or None, name)
    for match in reversed(list(_BRACKETS.finditer(name))):
        text = (match[1] or match[2] or "").strip()
        if _SCALED.match(name[match.end() :]):
            break  # F (N) x10: the numbers are of another unit than the brackets'
        if units.is_unit(text) or _is_written_as_unit(text, square=match[2] is not None):
            label = (name[: match.start()].rstrip() + " " + name[match.end() :].lstrip()).strip()
            return Channel(name, text, label or name)
    suffixed = _TIME_SUFFIX.fullmatch(name)
    if suffixed is not None and _plain(suffixed[1]) in _TIME_NAMES:
        return Channel(name, suffixed[2], suffixed[1])
    return Channel(name, None, name)


def _is_written_as_unit(text: str, square: bool) -> bool:
    """Whether an unknown text in brackets is meant as a unit: in square ones, or with the signs of units."""
    return not text.isdecimal() and (bool(text) if square else _SIGNS_OF_UNITS.fullmatch(text) is not None)


def unknown_brackets(channel: Channel) -> str:
    """What stands in brackets at the end of the name of a channel without a unit; empty if nothing does."""
    match = re.search(r"\(([^()]*)\)\s*$|\[([^][]*)\]\s*$", channel.name) if channel.unit is None else None
    text = "" if match is None else (match[1] or match[2] or "").strip()
    return text if any(map(str.isalpha, text)) else ""


def is_time(name: str) -> bool:
    """Whether a header cell names time."""
    label = _BRACKETS.sub("", _channel(name, "").label)
    return _plain(label) in _TIME_NAMES


def base_of_time(label: str) -> str | None:
    """The name of time in a label, without the number or letter that tells it from others: ``time`` of ``Time_2``."""
    plain = _plain(_BRACKETS.sub("", label))
    if plain in _TIME_NAMES:
        return plain
    base = _ONE_OF_SEVERAL.sub("", plain)
    return base if len(base) > 1 and base in _TIME_NAMES else None


def _plain(name: str) -> str:
    """A name in small letters, with blanks between its words."""
    return name.strip().replace("İ", "i").casefold().replace("_", " ")


def time_column(channels: Sequence[Channel]) -> TimeColumn | None:
    """The column of time, recognised by its name; seconds are assumed, and said so, where it has no unit.

    Brackets that hold something else than a unit of time leave the unit unknown.
    """
    for i, channel in enumerate(channels):
        if is_time(channel.label):
            if channel.unit is not None:
                return TimeColumn(i, units.seconds_per(channel.unit))
            bare = _BRACKETS.search(channel.label) is None
            return TimeColumn(i, 1.0, assumed=True) if bare else TimeColumn(i, None)
    return None
