"""Findings about a recorded time column, and the rate that it gives."""

import math

from ..recording import Finding, Group, TimeColumn
from .time_steps import (
    GAP,
    RATE_TOLERANCE,
    ClockStats,
    Sampling,
    about_gaps,
    coarse_times_finding,
    is_cause,
    sampling_of_times,
)

_SAME_RATE = 1e-6
"""Rates that differ by less than this share of them are one."""


def time_column_sampling(group: Group, clock: ClockStats, stated_rate_hz: float | None) -> Sampling | None:
    """The sampling that the times show; None where they are no times of a sampled signal, or in no unit of time."""
    assert isinstance(group.clock, TimeColumn)
    factor = group.clock.seconds_per_unit
    if len(group.channels) == 1 or factor is None:
        return None
    found = sampling_of_times(clock, _stated_step(group, stated_rate_hz))
    return found if found.is_steady else None


def rate_hz(group: Group, clock: ClockStats, stated_rate_hz: float | None) -> float | None:
    """1 / median step [Hz], where the steps are those of a sampled signal in a unit of time.

    Where the times are rounded so that the median is none of a sample, 1 / mean step.
    """
    assert isinstance(group.clock, TimeColumn)
    found, factor = time_column_sampling(group, clock, stated_rate_hz), group.clock.seconds_per_unit
    return None if found is None or factor is None else 1.0 / (found.step * factor)


def _stated_step(group: Group, stated_rate_hz: float | None) -> float | None:
    """The step of the header's rate, in the unit of the times."""
    assert isinstance(group.clock, TimeColumn)
    factor = group.clock.seconds_per_unit
    return 1.0 / (stated_rate_hz * factor) if stated_rate_hz and factor else None


def time_in_seconds(group: Group, clock: ClockStats) -> dict[str, float | int | None]:
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


def time_findings(group: Group, clock: ClockStats, stated_rate_hz: float | None) -> list[Finding]:
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
    if len(group.channels) == 1:
        message = "the only column of numbers is one of times: events such as edges, no signal; there is no rate"
        return [Finding("event_times", name, None, message)]
    shown, median = (
        sampling_of_times(clock, _stated_step(group, stated)),
        clock.steps.quantile(0.5),
    )
    if not shown.step > 0:
        return []
    if not shown.is_steady:
        share = f"{shown.spread:.0%} of their median {median:g} {unit}"
        return [Finding("time_irregular", name, None, f"the middle half of the steps spreads over {share}: no rate")]
    found = _gaps(clock, shown, name, unit)
    jitter = clock.steps.quantile(0.95) - clock.steps.quantile(0.05)
    if jitter > 0.01 * median and not is_cause(shown):
        message = f"nine steps in ten lie within {jitter / median:.1%} of the median {median:.6g} {unit}"
        found.append(Finding("time_jitter", name, None, message))
    rate = rate_hz(group, clock, stated)
    if rate and shown.rounded and not shown.settled:
        found.append(Finding("rate_doubtful", name, None, coarse_times_finding(shown, rate, unit)))
    elif rate and shown.rounded and not stated:
        message = (
            f"the times are rounded: steps of {clock.dt_min:.6g} to {clock.dt_max:.6g} {unit}, by whose median of "
            f"{median:.6g} {unit} the rate would be {rate * shown.step / median:.6g} Hz; "
            f"it is {rate:.6g} Hz by their mean"
        )
        found.append(Finding("rate_rounded", name, None, message))
    return found + _against_stated(clock, shown, name, rate, stated)


def _gaps(clock: ClockStats, shown: Sampling, name: str, unit: str) -> list[Finding]:
    """Steps that are longer than those of samples, and where samples may be missing besides."""
    parts, places = [], None
    if gaps := clock.steps.above(shown.longest):
        longest = sorted((step, where) for step, where in clock.longest if step > shown.longest)[::-1]
        listed = ", ".join(f"{step:.6g} {unit} before {where}" for step, where in longest)
        limit = f"{shown.longest:.6g} {unit}, a sample taking {shown.step:.6g} {unit} on average"
        if not is_cause(shown):
            limit = f"{GAP:g} times the median {clock.steps.quantile(0.5):.6g} {unit}"
        parts.append(f"steps longer than {limit}: {gaps} ({listed})")
        places = ", ".join(where for _, where in longest)
    if text := about_gaps(shown, gaps, clock.steps.above(0.0), unit):
        parts.append(text)
    return [Finding("time_gap", name, places, "; ".join(parts))] if parts else []


def _against_stated(
    clock: ClockStats, shown: Sampling, name: str, rate: float | None, stated: float | None
) -> list[Finding]:
    """A header's rate that the steps contradict, or that drifts from the times by more than they are rounded."""
    if not rate or not stated:
        return []
    if abs(rate / stated - 1) > RATE_TOLERANCE:
        message = f"the header states {stated:g} Hz, the steps of time give {rate:.6g} Hz"
        return [Finding("rate_contradiction", name, None, message)]
    span = clock.last - clock.first
    if clock.dt_max > shown.longest or clock.non_increasing:
        return []
    mean = rate * shown.step * clock.steps.above(0.0) / span
    if abs(mean / stated - 1) <= max(_SAME_RATE, (clock.dt_max - clock.dt_min) / span):
        return []
    message = f"the header states {stated:.10g} Hz, the times give {mean:.10g} Hz on average; the times are taken"
    return [Finding("rate_rounded", name, None, message)]
