"""Findings about a recorded time column, and the rate that it gives."""

import math

from ..findings import Finding
from ..recording import Group, TimeColumn
from .clock import ClockStats

GAP = 1.5
"""A step longer than this many medians is a gap."""
IRREGULAR = 0.1
"""Steps whose middle half spreads over more than this share of the median are those of no sampled signal."""
_PLACES = 5
"""Steps of rounded times lie in so few places: two, more where they were rounded twice."""
_NEIGHBOURS, _COARSE = 8, 2.0**-16
"""Width of such a place: floating-point numbers beside the times, or the share of a step to which steps are known."""
_MANY = 0.05
"""Share of all steps above which gaps may be no gaps at all."""
_MATTERS = 1e-4
"""Mean and median step that differ by less than this share are not told apart."""
_SAME_RATE = 1e-6
"""Rates that differ by less than this share of them are one."""
RATE_TOLERANCE = 0.005
"""A header's rate and 1 / median step may differ by this share: rates are often printed in three digits."""


def rate_hz(group: Group, clock: ClockStats) -> float | None:
    """1 / median step [Hz], where the steps are those of a sampled signal in a unit of time.

    Where the times are rounded so that the median is none of a sample, 1 / mean step.
    """
    median = clock.steps.quantile(0.5)
    if len(group.channels) == 1 or not median > 0 or _spread(clock) > IRREGULAR:
        return None
    assert isinstance(group.clock, TimeColumn)
    factor = group.clock.seconds_per_unit
    return None if factor is None else 1.0 / ((rounded_step(clock) or median) * factor)


def rounded_step(clock: ClockStats) -> float | None:
    """The mean step where the times are rounded and their median step shows that, in the unit of the times.

    2048 samples a second with times in four decimals have steps of 0.0004 and 0.0005: their median is that of 2000.
    """
    median = clock.steps.quantile(0.5)
    width = max(_NEIGHBOURS * math.ulp(max(abs(clock.first), abs(clock.last))), _COARSE * median)
    found = clock.steps.places(median / 2.0, GAP * median, width)
    if found is None or found[0] > _PLACES or abs(found[1] / median - 1.0) <= _MATTERS:
        return None
    return found[1]


def seconds(group: Group, clock: ClockStats) -> dict[str, float | int | None]:
    """The clock's numbers as they are printed, in seconds; as written, without ``_s``, if the unit is unknown."""
    assert isinstance(group.clock, TimeColumn)
    factor = group.clock.seconds_per_unit
    values = {
        "t_first": clock.first,
        "t_last": clock.last,
        "dt_min": clock.dt_min,
        "dt_median": clock.steps.quantile(0.5),
        "dt_max": clock.dt_max,
    }
    unit, factor = ("", 1.0) if factor is None else ("_s", factor)
    finite = {f"{key}{unit}": value * factor if math.isfinite(value) else None for key, value in values.items()}
    return {**finite, "non_increasing": clock.non_increasing}


def findings(group: Group, clock: ClockStats, stated_rate_hz: float | None) -> list[Finding]:
    """What a time column shows."""
    assert isinstance(group.clock, TimeColumn)
    name, unit = group.channels[group.clock.index].name, group.channels[group.clock.index].unit or "s"
    found = []
    if group.clock.assumed:
        message = "carries no unit; seconds were assumed for the rate and the clock, the column is kept as written"
        found.append(Finding("time_unit_assumed", name, None, message))
    if group.clock.seconds_per_unit is None:
        message = "names no unit of time that is known: there is no rate, and the clock is given as written"
        found.append(Finding("time_unit_unknown", name, None, message))
    if clock.unreadable:
        found.append(Finding("time_unreadable", name, None, f"no finite number: {clock.unreadable} times"))
    if clock.non_increasing:
        found.append(_not_increasing(name, unit, clock))
    return found + _steps(group, clock, name, unit, stated_rate_hz)


def _not_increasing(name: str, unit: str, clock: ClockStats) -> Finding:
    steps = ", ".join(f"{step:.10g} {unit} at {where}" for where, step in clock.falls)
    more = ", ..." if clock.non_increasing > len(clock.falls) else ""
    message = f"time falls or stands still {clock.non_increasing} times: {steps}{more}"
    return Finding("time_not_increasing", name, ", ".join(where for where, _ in clock.falls), message)


def _steps(group: Group, clock: ClockStats, name: str, unit: str, stated: float | None) -> list[Finding]:
    """Findings about the lengths of the steps."""
    median, spread = clock.steps.quantile(0.5), _spread(clock)
    if len(group.channels) == 1:
        message = "the only column of numbers is one of times: events such as edges, no signal; there is no rate"
        return [Finding("event_times", name, None, message)]
    if not median > 0:
        return []
    if spread > IRREGULAR:
        message = f"the middle half of the steps spreads over {spread:.0%} of their median {median:g} {unit}: no rate"
        return [Finding("time_irregular", name, None, message)]
    found = []
    if gaps := clock.steps.above(GAP * median):
        longest = sorted((step, where) for step, where in clock.longest if step > GAP * median)[::-1]
        shown = ", ".join(f"{step:.6g} {unit} before {where}" for step, where in longest)
        message = f"steps longer than {GAP:g} times the median {median:.6g} {unit}: {gaps} ({shown})"
        if gaps > _MANY * clock.steps.above(0.0):
            message += "; so many are samples lost all over, or times in too few digits: then the rate is wrong too"
        found.append(Finding("time_gap", name, ", ".join(where for _, where in longest), message))
    if (jitter := clock.steps.quantile(0.95) - clock.steps.quantile(0.05)) > 0.01 * median:
        message = f"nine steps in ten lie within {jitter / median:.1%} of the median {median:.6g} {unit}"
        found.append(Finding("time_jitter", name, None, message))
    rate = rate_hz(group, clock)
    if rate and not stated and (step := rounded_step(clock)) is not None:
        message = (
            f"the times are rounded: steps of {clock.dt_min:.6g} to {clock.dt_max:.6g} {unit}, by whose median of "
            f"{median:.6g} {unit} the rate would be {rate * step / median:.6g} Hz; it is {rate:.6g} Hz by their mean"
        )
        found.append(Finding("rate_rounded", name, None, message))
    return found + _against_stated(name, clock, rate, stated)


def _against_stated(name: str, clock: ClockStats, rate: float | None, stated: float | None) -> list[Finding]:
    """A header's rate that the steps contradict, or that drifts from the times by more than they are rounded."""
    if not rate or not stated:
        return []
    if abs(rate / stated - 1) > RATE_TOLERANCE:
        message = f"the header states {stated:g} Hz, the steps of time give {rate:.6g} Hz"
        return [Finding("rate_contradiction", name, None, message)]
    median, span = clock.steps.quantile(0.5), clock.last - clock.first
    if clock.dt_max > GAP * median or clock.non_increasing:
        return []
    mean = rate * (rounded_step(clock) or median) * clock.steps.above(0.0) / span
    if abs(mean / stated - 1) <= max(_SAME_RATE, (clock.dt_max - clock.dt_min) / span):
        return []
    message = f"the header states {stated:.10g} Hz, the times give {mean:.10g} Hz on average; the times are taken"
    return [Finding("rate_rounded", name, None, message)]


def _spread(clock: ClockStats) -> float:
    """Spread of the middle half of the steps, as a share of their median."""
    median = clock.steps.quantile(0.5)
    return (clock.steps.quantile(0.75) - clock.steps.quantile(0.25)) / median if median > 0 else 0.0
