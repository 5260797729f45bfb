"""Findings about a recorded time column, and the rate that it gives."""

import math
from dataclasses import dataclass
from functools import cached_property

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


def time_in_seconds(column: TimeColumn, clock: ClockStats) -> dict[str, float | int | None]:
    """The clock's numbers as they are printed, in seconds; as written, without ``_s``, if the unit is unknown."""
    values = {
        "t_first": clock.first,
        "t_last": clock.last,
        "dt_min": clock.dt_min,
        "dt_median": clock.steps.quantile(0.5),
        "dt_max": clock.dt_max,
    }
    unit, factor = ("", 1.0) if column.seconds_per_unit is None else ("_s", column.seconds_per_unit)
    finite = {f"{key}{unit}": value * factor if math.isfinite(value) else None for key, value in values.items()}
    return {**finite, "non_increasing": clock.non_increasing}


@dataclass(frozen=True)
class TimeCheck:
    """The time ``column`` of a group that has been read: its numbers, and the header's rate [Hz] if it states one."""

    group: Group
    column: TimeColumn
    clock: ClockStats
    stated_rate_hz: float | None

    @cached_property
    def _shown(self) -> Sampling:
        """The sampling of the steps, whatever they are."""
        stated, factor = self.stated_rate_hz, self.column.seconds_per_unit
        return sampling_of_times(self.clock, 1.0 / (stated * factor) if stated and factor else None)

    @property
    def sampling(self) -> Sampling | None:
        """The sampling that the times show; None where they are none of a sampled signal, or in no unit of time."""
        is_timed = len(self.group.channels) > 1 and self.column.seconds_per_unit is not None
        return self._shown if is_timed and self._shown.is_steady else None

    @property
    def rate_hz(self) -> float | None:
        """1 / median step [Hz], where the steps are those of a sampled signal in a unit of time.

        Where the times are rounded so that the median is none of a sample, or tremble, 1 / mean step.
        """
        found, factor = self.sampling, self.column.seconds_per_unit
        return None if found is None or factor is None else 1.0 / (found.step * factor)

    @property
    def _name(self) -> str:
        return self.group.channels[self.column.index].name

    @property
    def _unit(self) -> str:
        return self.group.channels[self.column.index].unit or "s"

    def findings(self) -> list[Finding]:
        """What the time column shows."""
        found, clock = [], self.clock
        if self.column.assumed:
            message = (
                "carries no unit; seconds were assumed for the rate and the clock, the column is kept as written; "
                "state it in the header, Time (s), or as time_unit in an import description (testbench describe)"
            )
            found.append(Finding("time_unit_assumed", self._name, None, message))
        if self.column.seconds_per_unit is None:
            message = "names no unit of time that is known: there is no rate, and the clock is given as written"
            found.append(Finding("time_unit_unknown", self._name, None, message))
        if clock.unreadable:
            found.append(Finding("time_unreadable", self._name, None, f"no finite number: {clock.unreadable} times"))
        is_of_events = len(self.group.channels) == 1
        if clock.non_increasing and not (is_of_events and clock.dt_min >= 0):
            steps = ", ".join(f"{step:.10g} {self._unit} at {where}" for where, step in clock.falls)
            more = ", ..." if clock.non_increasing > len(clock.falls) else ""
            message = f"time falls or stands still {clock.non_increasing} times: {steps}{more}"
            places = ", ".join(where for where, _ in clock.falls)
            found.append(Finding("time_not_increasing", self._name, places, message))
        if is_of_events:
            message = "the only column of numbers is one of times: events such as edges, no signal; there is no rate"
            if clock.non_increasing and clock.dt_min >= 0:
                message += f"; {clock.non_increasing} of them are at the time of the one before"
            return [*found, Finding("event_times", self._name, None, message)]
        return found + self._steps() if self._shown.step > 0 else found

    def _steps(self) -> list[Finding]:
        """Findings about the lengths of the steps."""
        clock, shown, name, unit = self.clock, self._shown, self._name, self._unit
        median = clock.steps.quantile(0.5)
        if not shown.is_steady:
            share = f"{shown.spread:.0%} of their median {median:g} {unit}"
            return [
                Finding("time_irregular", name, None, f"the middle half of the steps spreads over {share}: no rate")
            ]
        found = self._gaps()
        jitter = clock.steps.quantile(0.95) - clock.steps.quantile(0.05)
        if jitter > 0.01 * median and not is_cause(shown):
            message = f"nine steps in ten lie within {jitter / median:.1%} of the median {median:.6g} {unit}"
            found.append(Finding("time_jitter", name, None, message))
        rate = self.rate_hz
        if rate and shown.rounded and not shown.settled:
            found.append(Finding("rate_doubtful", name, None, coarse_times_finding(shown, rate, unit)))
        elif rate and shown.rounded and not self.stated_rate_hz:
            message = (
                f"the times are rounded: steps of {clock.dt_min:.6g} to {clock.dt_max:.6g} {unit}, by whose median of "
                f"{median:.6g} {unit} the rate would be {rate * shown.step / median:.6g} Hz; "
                f"it is {rate:.6g} Hz by their mean"
            )
            found.append(Finding("rate_rounded", name, None, message))
        return found + self._against_stated(rate)

    def _gaps(self) -> list[Finding]:
        """Steps that are longer than those of samples, and where samples may be missing besides."""
        clock, shown, unit = self.clock, self._shown, self._unit
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
        return [Finding("time_gap", self._name, places, "; ".join(parts))] if parts else []

    def _against_stated(self, rate: float | None) -> list[Finding]:
        """A header's rate that the steps contradict, or that drifts from the times by more than they are rounded."""
        clock, shown, stated = self.clock, self._shown, self.stated_rate_hz
        if not rate or not stated:
            return []
        if abs(rate / stated - 1) > RATE_TOLERANCE:
            message = f"the header states {stated:g} Hz, the steps of time give {rate:.6g} Hz"
            return [Finding("rate_contradiction", self._name, None, message)]
        span = clock.last - clock.first
        if clock.dt_max > shown.longest or clock.non_increasing:
            return []
        mean = rate * shown.step * clock.steps.above(0.0) / span
        if abs(mean / stated - 1) <= max(_SAME_RATE, (clock.dt_max - clock.dt_min) / span):
            return []
        message = f"the header states {stated:.10g} Hz, the times give {mean:.10g} Hz on average; the times are taken"
        return [Finding("rate_rounded", self._name, None, message)]
