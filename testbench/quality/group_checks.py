"""Numbers of each channel, gathered block by block, and all checks of a group and of a whole recording."""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated

import numpy as np

from balance.results import Key, finite, first_of

from ..readers import header_claims
from ..recording import (
    Block,
    Channel,
    Finding,
    Group,
    Recording,
    Samples,
    SensorRange,
    StartTime,
    TimeColumn,
    UniformClock,
    by_name,
    of_one_name,
)
from ..units import is_unit, same_unit, seconds_per
from .clipping import Clipping, CodedValues
from .time_steps import GAP, MANY, RATE_TOLERANCE, ClockStats, Sampling, sampling_of_times

_SAME_RATE = 1e-6
"""Rates that differ by less than this share of them are one."""
ONE_UNIT, OTHER_UNIT = 0.1, 10.0
"""Share by which rates may differ that are of times in one unit; and the factor from which on they are in others."""
_FEW_GAPS = 10
"""So few gaps are said as they are."""


def unit_assumed(name: str, rate_hz: float | None, stated_hz: float | None, stated_by: str) -> Finding:
    """Of a column of time without a unit: that it is in seconds by a stated rate, or against it, or that none shows it.

    Rates [Hz], None where there is none. Any other unit would be sixty times off, or more.
    """
    cure = "write Time (s) into the header, or state time and time_unit in an import description (testbench describe "
    cure += "LOG writes one; --as)"
    if rate_hz and stated_hz and abs(rate_hz / stated_hz - 1.0) < ONE_UNIT:
        message = f"carries no unit: seconds, by the rate of {stated_hz:g} Hz that {stated_by} states"
        return Finding("time_unit_confirmed", name, None, message)
    if rate_hz and stated_hz and not 1.0 / OTHER_UNIT < rate_hz / stated_hz < OTHER_UNIT:
        message = f"carries no unit; in seconds its rate is {rate_hz:.4g} Hz, and {stated_by} states {stated_hz:g} Hz: "
        return Finding("time_unit_contradiction", name, None, message + cure)
    message = "carries no unit: seconds are assumed, which neither a stated rate, another logger nor the motion shows; "
    return Finding("time_unit_assumed", name, None, message + cure + ", or the logger's rate in the rig")


@dataclass(frozen=True)
class TimeCheck:
    """The time ``column`` of a group that has been read: its numbers, and the rate [Hz] that is stated."""

    group: Group
    column: TimeColumn
    clock: ClockStats
    stated_rate_hz: float | None
    stated_by: str = "the header"

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
            found.append(unit_assumed(self._name, self.rate_hz, self.stated_rate_hz, self.stated_by))
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
            message = f"the middle half of the steps spreads over {share}: no rate"
            if self.stated_rate_hz:
                message += f"; {self.stated_by} states {self.stated_rate_hz:g} Hz, the times are taken"
            return [Finding("time_irregular", name, None, message)]
        found = self._gaps()
        jitter = clock.steps.quantile(0.95) - clock.steps.quantile(0.05)
        if jitter > 0.01 * median and not shown.is_of_rounding:
            message = f"nine steps in ten lie within {jitter / median:.1%} of the median {median:.6g} {unit}"
            found.append(Finding("time_jitter", name, None, message))
        rate = self.rate_hz
        if rate and shown.rounded and not shown.settled and shown.grid is not None:
            kinds = shown.grid
            message = (
                f"steps of {kinds.lengths(unit)} come as evenly as those of times rounded to {kinds.place:.6g} {unit}: "
                f"the rate is {rate:.6g} Hz by their mean. A logger of {rate * shown.step / kinds.place:.6g} Hz that "
                f"lost one sample in {1.0 + 1.0 / kinds.longer_share:.3g} as evenly would look the same; a rate in the "
                "log's header tells"
            )
            found.append(Finding("rate_doubtful", name, None, message))
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
            longest = sorted((-number, step, where) for step, number, where in clock.longest if step > shown.longest)
            listed = ", ".join(f"{step:.6g} {unit} before {where}" for _, step, where in longest)
            listed = f"the longest: {listed}" if gaps > len(longest) else listed
            limit = f"{shown.longest:.6g} {unit}, a sample taking {shown.step:.6g} {unit} on average"
            if not shown.is_of_rounding:
                limit = f"{GAP:g} times the median {clock.steps.quantile(0.5):.6g} {unit}"
            parts.append(f"steps longer than {limit}: {gaps} ({listed})")
            places = ", ".join(where for *_, where in longest)
        parts += self._doubts(gaps)
        return [Finding("time_gap", self._name, places, "; ".join(parts))] if parts else []

    def _doubts(self, gaps: int) -> list[str]:
        """What the gaps may be besides, or where samples may be lost though no step is a gap."""
        shown, kinds, even = self._shown, self._shown.grid, self._shown.evenness
        if shown.is_of_rounding and even is not None:
            missing = "the steps do not come as evenly as rounding makes them: samples may be lost there"
            return [f"in {even.uneven} of {even.tested} pieces of the column {missing}"] if even.uneven else []
        if kinds is not None and not shown.settled and gaps >= _FEW_GAPS:
            return [
                f"steps of {kinds.lengths(self._unit)}: whether samples were lost, or none and the times have too few "
                f"digits (then a sample takes {kinds.mean:.6g} {self._unit}), cannot be told; a rate in the log's "
                "header tells"
            ]
        if shown.rounded or gaps <= MANY * self.clock.steps.above(0.0):
            return []
        if kinds is None or kinds.short > 1 or even is None or not even.tested:
            return ["so many are samples lost all over, or times in too few digits: then the rate is wrong too"]
        return [
            "so many are samples lost all over" + ("" if even.rounded else ": they do not come as evenly as rounding")
        ]

    def _against_stated(self, rate: float | None) -> list[Finding]:
        """A stated rate that the steps contradict, or that drifts from the times by more than they are rounded."""
        clock, shown, stated = self.clock, self._shown, self.stated_rate_hz
        if not rate or not stated:
            return []
        if abs(rate / stated - 1) > RATE_TOLERANCE:
            message = f"{self.stated_by} states {stated:g} Hz, the steps of time give {rate:.6g} Hz, which is taken"
            return [Finding("rate_contradiction", self._name, None, message)]
        span = clock.last - clock.first
        if clock.dt_max > shown.longest or clock.non_increasing:
            return []
        mean = rate * shown.step * clock.steps.above(0.0) / span
        if abs(mean / stated - 1) <= max(_SAME_RATE, (clock.dt_max - clock.dt_min) / span):
            return []
        message = (
            f"{self.stated_by} states {stated:.10g} Hz, the times give {mean:.10g} Hz on average; the times are taken"
        )
        return [Finding("rate_rounded", self._name, None, message)]


@dataclass
class ChannelStats:
    """Counts and values of one channel, in its unit. ``mean``, ``min`` and ``max`` are of the finite samples."""

    n: Annotated[int, Key("", "n")] = 0
    not_finite: Annotated[int, Key("nan", "nan")] = 0
    min: Annotated[float, Key("", "min", ".9g", finite)] = math.inf
    max: Annotated[float, Key("", "max", ".9g", finite)] = -math.inf
    first: Annotated[float, Key("", "first", ".9g", finite)] = math.nan
    last: Annotated[float, Key("", "last", ".9g", finite)] = math.nan
    total: float = 0.0

    @property
    def mean(self) -> Annotated[float, Key("", "mean", ".9g", finite)]:
        """Mean of the finite samples; NaN if there are none."""
        finite = self.n - self.not_finite
        return self.total / finite if finite else math.nan

    @property
    def is_constant(self) -> bool:
        """Whether all samples are one finite value."""
        return self.n > 1 and self.not_finite == 0 and self.min == self.max

    def update(self, samples: Samples) -> tuple[float, float] | None:
        """Take in the next samples; the least and the largest of them if all are finite."""
        if not self.n:
            self.first = float(samples[0])
        self.last = float(samples[-1])
        self.n += len(samples)
        with np.errstate(over="ignore", invalid="ignore"):
            total = float(samples.sum())
        finite = samples
        if not math.isfinite(total):  # a sample is not finite, or the sum overflows
            finite = samples[np.isfinite(samples)]
            self.not_finite += len(samples) - len(finite)
            try:
                total = math.fsum(finite)
            except OverflowError:
                total = math.inf
        if not len(finite):
            return None
        least, most = float(finite.min()), float(finite.max())
        self.min, self.max = min(self.min, least), max(self.max, most)
        self.total += total
        return (least, most) if len(finite) == len(samples) else None


_OTHER_AXES = re.compile(r"(?:.*[./ ])?(?:freq\w*|frekans|frequenz|order|nodes?)", re.IGNORECASE)


@dataclass
class GroupCheck:
    """Numbers and findings of one group, gathered block by block."""

    group: Group
    ranges: Sequence[SensorRange] = ()
    stated_rate_hz: float | None = None
    channel_ranges: Mapping[str, SensorRange] = field(default_factory=dict)
    stated_by: str = "the header"
    samples: int = 0
    stats: list[ChannelStats] = field(init=False)
    clock: ClockStats = field(default_factory=ClockStats)
    _clipping: dict[int, Clipping] = field(init=False)
    _coded: dict[int, CodedValues] = field(init=False)

    def __post_init__(self) -> None:
        clock = self.group.clock
        time = clock.index if isinstance(clock, TimeColumn) else None
        self.stats = [ChannelStats() for _ in self.group.channels]
        self._clipping = {i: Clipping(self._range(c)) for i, c in enumerate(self.group.channels) if i != time}
        self._coded = {i: CodedValues() for i in self._clipping}

    def _range(self, channel: Channel) -> SensorRange | None:
        """The range that holds for a channel: the rig's, else the only one that the log states in its unit."""
        if known := channel.names & self.channel_ranges.keys():
            return self.channel_ranges[min(known)]
        stated = [r for r in self.ranges if same_unit(r.unit, channel.unit)]
        return stated[0] if len(stated) == 1 else None

    def update(self, block: Block) -> None:
        """Take in the next block."""
        self.samples += len(block)
        extremes = [stats.update(column) for stats, column in zip(self.stats, block.columns, strict=True)]
        for i, clipping in self._clipping.items():
            clipping.update(block.columns[i], extremes[i])
            self._coded[i].update(block, block.columns[i], extremes[i])
        if isinstance(self.group.clock, TimeColumn):
            index = self.group.clock.index
            self.clock.update(block, block.columns[index], all_finite=extremes[index] is not None)

    @property
    def _time(self) -> TimeCheck | None:
        """The check of its time column, if it has one."""
        clock = self.group.clock
        if not isinstance(clock, TimeColumn):
            return None
        return TimeCheck(self.group, clock, self.clock, self.stated_rate_hz, self.stated_by)

    @property
    def rate_hz(self) -> float | None:
        """The sampling rate [Hz]: declared, or that of the steps; None if there is none."""
        if isinstance(self.group.clock, UniformClock):
            return self.group.clock.rate_hz
        return None if (time := self._time) is None else time.rate_hz

    @property
    def start_time(self) -> StartTime | None:
        """When the first sample was taken; None where the log does not say it, or the unit of time is unknown."""
        zero, clock = self.group.zero, self.group.clock
        if zero is None or clock is None:
            return zero
        if isinstance(clock, UniformClock):
            return zero.later(clock.start_s)
        first = self.clock.first * (clock.seconds_per_unit if clock.seconds_per_unit is not None else math.nan)
        return zero.later(first) if math.isfinite(first) else None

    @property
    def rate_source(self) -> str | None:
        """Where the rate comes from."""
        if (time := self._time) is not None:
            return None if time.sampling is None else time.sampling.source
        return None if self.rate_hz is None else "declared"

    def findings(self) -> list[Finding]:
        """What the data of the group show."""
        if not self.samples:
            return [Finding("no_data", None, None, f"group {self.group.name!r} holds no sample")]
        found = []
        if self.samples > 1:
            found += clock_findings(self.group)
        if (time := self._time) is not None:
            found += time.findings()
        for i, channel in enumerate(self.group.channels):
            coded = self._coded[i].places() if i in self._coded else []
            found += [Finding("coded_values", channel.name, where, message) for message, where in coded]
            if self.stats[i].is_constant:
                message = f"all {self.samples} samples are {self.stats[i].first:g}: dead, stuck or unused"
                found.append(Finding("constant_channel", channel.name, None, message))
            elif not coded and i in self._clipping and (text := self._clipping[i].message(channel.unit)) is not None:
                code = "clipping" if self._clipping[i].limit else "clipping_suspected"
                found.append(Finding(code, channel.name, None, text))
        return found


@dataclass
class RecordingCheck:
    """Checks of every group of a recording, those that come to light while it is read included."""

    recording: Recording
    channel_ranges: Mapping[str, SensorRange] = field(default_factory=dict)
    groups: dict[str, GroupCheck] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for group in self.recording.groups:
            self._add(group)

    def _add(self, group: Group) -> GroupCheck:
        told = self.recording
        check = GroupCheck(group, told.ranges, told.stated_rate_hz, self.channel_ranges, told.rate_stated_by)
        self.groups[group.name] = check
        return check

    def update(self, block: Block) -> None:
        """Take in the next block."""
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is counted, not warned of
            (self.groups.get(block.group.name) or self._add(block.group)).update(block)

    def findings(self) -> list[Finding]:
        """What the header and the data show."""
        reported = {f.channel for f in self.recording.findings if f.code == "unit_unknown"}
        found = [
            replace(f, group=group.name) for group in self.recording.groups for f in header_findings(group, reported)
        ]
        if self.recording.origin == "simulated":
            found.append(Finding("simulated", None, None, "the log says that it is simulated, and not measured"))
        return found + [replace(f, group=name) for name, check in self.groups.items() for f in check.findings()]


def clock_findings(group: Group) -> list[Finding]:
    """That a group whose channels ought to follow time has no clock."""
    first = group.channels[0]
    hertz = any(same_unit(first.unit, unit) for unit in ("Hz", "kHz"))
    if group.clock is not None or hertz or _OTHER_AXES.fullmatch(first.label) is not None:
        return []
    message = (
        f"no column of {first_of((c.name for c in group.channels), 4)} is known as time, and no rate is declared: "
        'state time = "NAME", or rate = "1 kHz", in an import description (testbench describe LOG writes one), '
        "which is given with --as, or by the rig as read_as of the logger"
    )
    return [Finding("no_clock", None, None, message)]


def header_findings(group: Group, reported: Collection[str | None] = ()) -> list[Finding]:
    """What the names and units of a group show, but missing units of the channels in ``reported``."""
    found = [
        Finding("duplicate_names", name, None, of_one_name(group.channels, places))
        for name, places in by_name(group.channels).items()
        if len(places) > 1 and group.channels[places[0]].name == name
    ]
    without = [
        c.name
        for i, c in enumerate(group.channels)
        if c.unit is None
        and c.name not in reported
        and not (isinstance(group.clock, TimeColumn) and group.clock.index == i)
    ]
    if without:
        one = without[0] if len(without) == 1 else None
        found.append(Finding("unit_missing", one, None, f"no unit is written for {first_of(without, 8)}"))
    behind = [c.name for c in group.channels if c.unit and c.name.removeprefix(c.label).lstrip().startswith("/")]
    if behind:
        message = f"quantity / unit: what is behind the slash is taken as the unit of {first_of(behind, 8)}"
        found.append(Finding("unit_inferred", None, None, message))
    for channel in group.channels:
        if channel.unit is None or is_unit(channel.unit):
            continue
        span, since, _ = channel.unit.partition(" since ")  # time since a date, as netCDF writes it
        if not since or seconds_per(span) is None:
            message = f"{channel.unit!r} is no unit that is known; it is kept as written"
            found.append(Finding("unit_unknown", channel.name, None, message))
    found += header_claims.unit_findings(group.channels)
    return found
