"""What a header states, in any format: doubtful units, rounded steps of time, clocks, and the origin of the log.

A stated value is taken as written; what contradicts the channel's name, or is written in few digits, is a finding. That
a log calls itself simulated counts, that it calls itself measured does not.
"""

import math
import re
from collections.abc import Iterable
from dataclasses import replace

from ..recording import Channel, Finding, Origin, Recording, TimeColumn, UniformClock
from ..units import same_unit, seconds_per

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


_DOUBTS = (
    (_FORCE, _UNITS_OF_ACCELERATION, "the name says force, the unit acceleration"),
    (_FORCE, _UNITS_OF_JERK, "the name says force, the unit is of jerk"),
    (_PURE_FORCE, _UNITS_OF_MASS, "the name says force, the unit is of mass"),
    (_ACCELERATION, _UNITS_OF_FORCE, "the name says acceleration, the unit force"),
    (_ACCELERATION, _UNITS_OF_JERK, "the name says acceleration, the unit is of jerk"),
)
"""Names, units that do not go with them, and what is said; the first that applies counts."""


def unit_findings(channels: Iterable[Channel]) -> list[Finding]:
    """Channels whose name says force and whose unit says acceleration or mass, and the reverse; jerk for either."""
    found = []
    for channel in channels:
        label = channel.label.strip().replace("İ", "i")
        for named, units, doubt in _DOUBTS:
            if named.fullmatch(label) and any(same_unit(channel.unit, unit) for unit in units):
                message = f"{channel.unit!r}: {doubt}; kept as written"
                found.append(Finding("unit_doubtful", channel.name, None, message))
                break
    return found


def may_be_days(first: float, step: float) -> bool:
    """Whether times without a unit may be days of a calendar: by the first one, and by the step to the next."""
    return any(low <= first < high for low, high in _DAYS) and 0 < step < _SHORTEST_STEP


def step_findings(text: str, what: str) -> list[Finding]:
    """The finding that a step of time is known only to the digits in which it is written."""
    match = re.fullmatch(r"\s*[+-]?(\d*)[.,]?(\d*)(?:[eEdD]([+-]?\d+))?\s*", text)
    if match is None or not (digits := (match[1] + match[2]).lstrip("0")):
        return []
    share = 0.5 / int(digits)
    if share < _EXACT_ENOUGH:
        return []
    message = f"{what} {text.strip()} is written in {len(digits)} digits: the rate is known to {share:.1g} of itself"
    return [Finding("rate_rounded", None, None, message)]


_SMALLEST, _FASTEST = 1e-300, 1e300


def recorded_time(index: int, unit: str | None) -> TimeColumn:
    """The clock of a recorded column of time in its stated unit; without one, seconds are assumed."""
    return TimeColumn(index, seconds_per(unit) if unit else 1.0, assumed=not unit)


def clock_of_step(step_s: float, start_s: float) -> UniformClock | None:
    """The clock of a step [s] and a start [s]; None if they are no step and no time."""
    return clock_of_rate(1.0 / step_s, start_s) if _SMALLEST < step_s < math.inf else None


def clock_of_rate(rate_hz: float, start_s: float = 0.0) -> UniformClock | None:
    """The clock of a rate [Hz] and a start [s]; None if they are no rate and no time."""
    return UniformClock(rate_hz, start_s) if _SMALLEST < rate_hz < _FASTEST and math.isfinite(start_s) else None


_ORIGIN = re.compile(r"\borigin\"?\s*[:=]\s*\"?(\w+)", re.IGNORECASE)
_LONGEST = 2000
"""Letters of a text that are looked at."""


def stated_origin(texts: Iterable[str]) -> Origin:
    """``simulated`` if a text says so; that a log calls itself measured counts for nothing."""
    found = {match[1].casefold() for text in texts for match in _ORIGIN.finditer(text[:_LONGEST])}
    return "simulated" if "simulated" in found else "unstated"


def with_stated_origin(recording: Recording) -> Recording:
    """The recording, ``simulated`` if its comments or metadata say so."""
    if recording.origin != "unstated":
        return recording
    texts = (*recording.comments, *(f"{key}: {text[:_LONGEST]}" for key, text in recording.metadata.items()))
    origin = stated_origin(texts)
    # the data through the recording as it was opened, which may hold a process that waits
    return recording if origin == "unstated" else replace(recording, origin=origin, read=recording.blocks)
