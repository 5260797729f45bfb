"""All checks of a group of channels, and of a whole recording."""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .. import units
from ..findings import Finding
from ..readers import doubt
from ..recording import Block, Channel, Group, Recording, SensorRange, TimeColumn, UniformClock
from . import times
from .channels import ChannelStats
from .clipping import Clipping
from .clock import ClockStats

_OTHER_AXES = re.compile(r"(?:.*[./ ])?(?:freq\w*|frekans|frequenz|order|nodes?)", re.IGNORECASE)


@dataclass
class GroupCheck:
    """Numbers and findings of one group, gathered block by block."""

    group: Group
    ranges: Sequence[SensorRange] = ()
    stated_rate_hz: float | None = None
    channel_ranges: Mapping[str, SensorRange] = field(default_factory=dict)
    samples: int = 0
    stats: list[ChannelStats] = field(init=False)
    clock: ClockStats = field(default_factory=ClockStats)
    _clipping: dict[int, Clipping] = field(init=False)

    def __post_init__(self) -> None:
        clock = self.group.clock
        time = clock.index if isinstance(clock, TimeColumn) else None
        self.stats = [ChannelStats() for _ in self.group.channels]
        self._clipping = {i: Clipping(self._range(c)) for i, c in enumerate(self.group.channels) if i != time}

    def _range(self, channel: Channel) -> SensorRange | None:
        """The range that holds for a channel: the rig's, else the only one that the log states in its unit."""
        if (known := self.channel_ranges.get(channel.label)) is not None:
            return known
        stated = [r for r in self.ranges if units.same(r.unit, channel.unit)]
        return stated[0] if len(stated) == 1 else None

    def update(self, block: Block) -> None:
        """Take in the next block."""
        self.samples += len(block)
        extremes = [stats.update(column) for stats, column in zip(self.stats, block.columns, strict=True)]
        for i, clipping in self._clipping.items():
            clipping.update(block.columns[i], extremes[i])
        if isinstance(self.group.clock, TimeColumn):
            index = self.group.clock.index
            self.clock.update(block, block.columns[index], all_finite=extremes[index] is not None)

    @property
    def rate_hz(self) -> float | None:
        """The sampling rate [Hz]: declared, or that of the steps; None if there is none."""
        if isinstance(self.group.clock, UniformClock):
            return self.group.clock.rate_hz
        return None if self.group.clock is None else times.rate_hz(self.group, self.clock, self.stated_rate_hz)

    @property
    def rate_source(self) -> str | None:
        """Where the rate comes from."""
        if isinstance(self.group.clock, TimeColumn):
            found = times.of(self.group, self.clock, self.stated_rate_hz)
            return None if found is None else found.source
        return None if self.rate_hz is None else "declared"

    def findings(self) -> list[Finding]:
        """What the data of the group show."""
        if not self.samples:
            return [Finding("no_data", None, None, f"group {self.group.name!r} holds no sample")]
        found = []
        if _needs_clock(self.group, self.samples):
            message = f"group {self.group.name!r} has neither a time column nor a declared rate: no time"
            found.append(Finding("no_clock", None, None, message))
        if isinstance(self.group.clock, TimeColumn):
            found += times.findings(self.group, self.clock, self.stated_rate_hz)
        for i, channel in enumerate(self.group.channels):
            if self.stats[i].is_constant:
                message = f"all {self.samples} samples are {self.stats[i].first:g}: dead, stuck or unused"
                found.append(Finding("constant_channel", channel.name, None, message))
            elif i in self._clipping and (text := self._clipping[i].message(channel.unit)) is not None:
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
        check = GroupCheck(group, self.recording.ranges, self.recording.stated_rate_hz, self.channel_ranges)
        self.groups[group.name] = check
        return check

    def update(self, block: Block) -> None:
        """Take in the next block."""
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is counted, not warned of
            (self.groups.get(block.group.name) or self._add(block.group)).update(block)

    def findings(self) -> list[Finding]:
        """What the header and the data show."""
        said = {f.channel for f in self.recording.findings if f.code == "unit_unknown"}
        found = [replace(f, group=group.name) for group in self.recording.groups for f in header_findings(group, said)]
        if self.recording.origin == "simulated":
            found.append(Finding("simulated", None, None, "the log says that it is simulated, and not measured"))
        return found + [replace(f, group=name) for name, check in self.groups.items() for f in check.findings()]


def header_findings(group: Group, said: Collection[str | None] = ()) -> list[Finding]:
    """What the names and units of a group show, but missing units of channels of which they are ``said``."""
    names = Counter(channel.name for channel in group.channels)
    found = [
        Finding("duplicate_names", name, None, f"{count} channels have this name")
        for name, count in names.items()
        if count > 1
    ]
    without = [
        c.name for i, c in enumerate(group.channels) if c.unit is None and c.name not in said and not _is_time(group, i)
    ]
    if without:
        shown = ", ".join(without[:8]) + (f" and {len(without) - 8} more" if len(without) > 8 else "")
        one = without[0] if len(without) == 1 else None
        found.append(Finding("unit_missing", one, None, f"no unit is written for {shown}"))
    for channel in group.channels:
        if channel.unit is not None and not units.is_unit(channel.unit) and not _is_date(channel.unit):
            message = f"{channel.unit!r} is no unit that is known; it is kept as written"
            found.append(Finding("unit_unknown", channel.name, None, message))
    found += doubt.units_of(group.channels)
    return found


def _is_date(unit: str) -> bool:
    """Whether a unit is time since a date, as netCDF writes it."""
    return " since " in unit and units.seconds_per(unit.split(" since ")[0]) is not None


def _needs_clock(group: Group, samples: int) -> bool:
    """Whether the samples ought to follow time: not single numbers, nor values over frequency, order or node."""
    first = group.channels[0]
    hertz = any(units.same(first.unit, unit) for unit in ("Hz", "kHz"))
    return group.clock is None and samples > 1 and not hertz and _OTHER_AXES.fullmatch(first.label) is None


def _is_time(group: Group, index: int) -> bool:
    return isinstance(group.clock, TimeColumn) and group.clock.index == index
