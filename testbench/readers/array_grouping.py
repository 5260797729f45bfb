"""Arrays of a file as groups: those of one place and length belong together, with the one that is their time.

Time is the axis that the file states, else the only array that is named for it and grows; a scalar named ``fs`` or
``dt`` states a rate.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..recording import Block, Channel, Clock, Group, Samples, TimeColumn, UniformClock
from ..units import seconds_per
from . import header_claims
from .byte_source import block_samples
from .csv.header import is_time_name, named_channels
from .header_claims import clock_of_rate

_TIME_LIKE = re.compile(r"(?:.*[. /])?(?:t|time|timestamps?|zeit|zaman)(?:[_ ].*|\d*)", re.IGNORECASE)
_RATE_LIKE = re.compile(r"(?:.*[._ /])?(?:fs|sample_?rate|sampling_?(?:rate|frequency)|rate_?hz)", re.IGNORECASE)
_STEP_LIKE = re.compile(r"(?:.*[._ /])?(?:dt|ts|delta_?t|sample_?time|sampling_?(?:interval|period))", re.IGNORECASE)
_SAME_RATE = 1e-9


@dataclass(frozen=True)
class Series:
    """One array of ``length`` samples and one or more channels; ``root`` is what it shares with its neighbours.

    ``block(begin, end)`` gives the samples from ``begin`` to before ``end``, one column a channel. ``axis`` is the
    path of the axis that the file states for it, ``is_axis`` that it is that axis itself.
    """

    root: str
    channels: tuple[Channel, ...]
    length: int
    block: Callable[[int, int], Sequence[Samples]]
    may_be_time: bool = True
    axis: str = ""
    is_axis: bool = False


@dataclass(frozen=True)
class SeriesGroup:
    """Series of one group."""

    group: Group
    members: tuple[Series, ...]
    samples: int

    def blocks(self) -> Iterator[Block]:
        """The samples in blocks."""
        step = block_samples(len(self.group.channels))
        for begin in range(0, self.samples, step):
            end = min(begin + step, self.samples)
            columns = tuple(column for member in self.members for column in member.block(begin, end))
            yield Block(self.group, columns, begin)


@dataclass
class Grouping:
    """The groups of a file, and the rate that it states."""

    groups: list[SeriesGroup] = field(default_factory=list)
    stated_rate_hz: float | None = None


def group_series(stem: str, series: Sequence[Series], scalars: Mapping[str, float]) -> Grouping:
    """Groups of the series of one root and length; ``scalars`` may state a sampling rate."""
    result = Grouping(stated_rate_hz=stated_rate(scalars))
    by_place: dict[tuple[str, int, str], list[Series]] = {}
    for each in series:
        by_place.setdefault((each.root, each.length, each.axis), []).append(each)
    of_root = Counter(root for root, _, _ in by_place)
    of_length = Counter((root, length) for root, length, _ in by_place)
    taken: set[str] = set()
    for (root, length, axis), members in by_place.items():
        parts = [stem, *([root] if root else []), *([str(length)] if of_root[root] > 1 else [])]
        if of_length[root, length] > 1 and axis:
            parts.append(axis.rpartition("/")[2])
        parts += [str(len(taken))] if " ".join(parts) in taken else []
        taken.add(" ".join(parts))
        clock = _time(members)
        if clock is None and len(by_place) == 1 and result.stated_rate_hz is not None:
            result.groups.append(_series_group(" ".join(parts), members, UniformClock(result.stated_rate_hz)))
            continue
        result.groups.append(_series_group(" ".join(parts), members, clock))
    return result


def _series_group(name: str, members: Sequence[Series], clock: Clock | None) -> SeriesGroup:
    channels = tuple(channel for member in members for channel in member.channels)
    return SeriesGroup(Group(name, channels, clock), tuple(members), members[0].length)


def stated_rate(scalars: Mapping[str, float]) -> float | None:
    """The sampling rate [Hz] that scalars such as ``fs`` or ``dt`` state, if they state one."""
    rates = [value for name, value in scalars.items() if _RATE_LIKE.fullmatch(name) and 0 < value < np.inf]
    rates += [1 / value for name, value in scalars.items() if _STEP_LIKE.fullmatch(name) and 1e-300 < value < np.inf]
    if not rates or any(abs(rate / rates[0] - 1) > _SAME_RATE for rate in rates):
        return None
    return float(rates[0]) if clock_of_rate(float(rates[0])) else None


def _time(members: Sequence[Series]) -> TimeColumn | None:
    """The one series that is named for time and grows from sample to sample; plain names before longer ones."""
    found: list[tuple[TimeColumn, str]] = []
    index = 0
    for member in members:
        channel = member.channels[0]
        if len(member.channels) == 1 and member.may_be_time and _is_time(member):
            named = named_channels([channel.name.rpartition(".")[2]], [""])[0]
            unit = channel.unit or named.unit
            factor = seconds_per(unit.split(" since ")[0]) if unit else 1.0
            clock = TimeColumn(index, factor, assumed=unit is None)
            if unit is None and _may_be_days(member):
                clock = TimeColumn(index, None)
            if member.is_axis:
                return clock
            found.append((clock, channel.name.rpartition(".")[2]))
        index += len(member.channels)
    plain = [clock for clock, name in found if is_time_name(name)]
    likely = plain or [clock for clock, _ in found]
    return likely[0] if len(likely) == 1 else None


def _is_time(member: Series) -> bool:
    """An axis in a unit of time, or named so, as the file states it; else what is named so and grows."""
    channel = member.channels[0]
    named = _TIME_LIKE.fullmatch(channel.name) is not None
    if member.is_axis:
        return named or (channel.unit is not None and seconds_per(channel.unit.split(" since ")[0]) is not None)
    return named and _grows(member)


def _may_be_days(member: Series) -> bool:
    first = member.block(0, min(2, member.length))[0]
    return len(first) > 1 and header_claims.may_be_days(float(first[0]), float(first[1] - first[0]))


def _grows(member: Series) -> bool:
    if member.length < 2:
        return False
    last, step = -np.inf, block_samples(1)
    for begin in range(0, member.length, step):
        column = member.block(begin, min(begin + step, member.length))[0]
        with np.errstate(invalid="ignore"):
            if not column[0] > last or not (np.diff(column) > 0).all():
                return False
        last = float(column[-1])
    return True
