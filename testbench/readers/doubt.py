"""What a reader may say about names, units and rates as they stand in a header."""

import re
from collections.abc import Iterable

from .. import units
from ..findings import Finding
from ..recording import Channel

_FORCE = re.compile(r"f|f[xyz_ ]?\d*|(?:force|kraft|kuvvet|hammer|load)\b.*", re.IGNORECASE)
_PURE_FORCE = re.compile(r"f|f[xyz_ ]?\d*|(?:force|kraft|kuvvet)\b.*", re.IGNORECASE)
_ACCELERATION = re.compile(r"a|a[xyz]|acc?(?:\b|[_ xyz\d]|el).*|ivme.*|beschl.*", re.IGNORECASE)
_UNITS_OF_ACCELERATION = ("g", "m/s^2", "m/s2", "mm/s^2", "g0", "gn")
_UNITS_OF_JERK = ("m/s^3", "mm/s^3")
_UNITS_OF_MASS = ("kg", "mg", "lb")
_UNITS_OF_FORCE = ("N", "kN", "lbf", "kgf", "Newtons", "newton")
_EXACT_ENOUGH = 1e-6
_DAYS = ((25_569, 80_000), (719_529, 800_000))
"""Days as spreadsheets (since 1900) and as MATLAB (since the year 0) count them, from 1970 on."""
_SHORTEST_STEP = 2e-5
"""Seconds from one sample to the next that are rather days: 50 kHz, or a sample in two seconds."""


def units_of(channels: Iterable[Channel]) -> list[Finding]:
    """Channels whose name says force and whose unit says acceleration or mass, and the reverse; jerk for either."""
    return [finding for channel in channels if (finding := _unit_of(channel)) is not None]


def _unit_of(channel: Channel) -> Finding | None:
    label = channel.label.strip().replace("İ", "i")
    if channel.unit is None:
        return None
    if _FORCE.fullmatch(label) and _is_one(channel.unit, _UNITS_OF_ACCELERATION):
        said = "the name says force, the unit acceleration"
    elif _FORCE.fullmatch(label) and _is_one(channel.unit, _UNITS_OF_JERK):
        said = "the name says force, the unit is of jerk"
    elif _PURE_FORCE.fullmatch(label) and _is_one(channel.unit, _UNITS_OF_MASS):
        said = "the name says force, the unit is of mass"
    elif _ACCELERATION.fullmatch(label) and _is_one(channel.unit, _UNITS_OF_FORCE):
        said = "the name says acceleration, the unit force"
    elif _ACCELERATION.fullmatch(label) and _is_one(channel.unit, _UNITS_OF_JERK):
        said = "the name says acceleration, the unit is of jerk"
    else:
        return None
    return Finding("unit_doubtful", channel.name, None, f"{channel.unit!r}: {said}; kept as written")


def _is_one(unit: str, known: Iterable[str]) -> bool:
    return any(units.same(unit, other) for other in known)


def may_be_days(first: float, step: float) -> bool:
    """Whether times without a unit may be days of a calendar: by the first one, and by the step to the next."""
    return any(low <= first < high for low, high in _DAYS) and 0 < step < _SHORTEST_STEP


def step_as_text(text: str, what: str) -> list[Finding]:
    """That a step of time is known only to the digits in which it is written."""
    match = re.fullmatch(r"\s*[+-]?(\d*)[.,]?(\d*)(?:[eEdD]([+-]?\d+))?\s*", text)
    if match is None or not (digits := (match[1] + match[2]).lstrip("0")):
        return []
    share = 0.5 / int(digits)
    if share < _EXACT_ENOUGH:
        return []
    message = f"{what} {text.strip()} is written in {len(digits)} digits: the rate is known to {share:.1g} of itself"
    return [Finding("rate_rounded", None, None, message)]
