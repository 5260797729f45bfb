"""Steps of a recorded time column, gathered in bounded memory, and what they say of its sampling.

Steps may be the few whole numbers of a last place: are the times rounded, or samples lost? Sample k of a steady clock,
rounded to places of q, is at q floor(k T / q + c): for n q < T < (n + 1) q its steps are n and n + 1 places, and come
so evenly that no time is further than one place from a straight line. Steps that are longer because samples were lost
by chance wander off it. Only steps of one and of two places may be either.
"""

import math
from dataclasses import dataclass, field
from heapq import heappush, heappushpop
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats

from ..recording import Block, Samples

LENGTH = 4096
"""Steps of one segment."""
_MOST = 16


@dataclass
class StepReservoir:
    """Up to 16 segments of 4096 steps in a row, evenly over the column; all of it while it is no longer than that."""

    _kept: dict[int, list[Samples]] = field(default_factory=dict)
    _stride: int = 1
    _count: int = 0

    def add(self, steps: Samples) -> None:
        """Take in the next steps."""
        begin, end = self._count, self._count + len(steps)
        self._count = end
        for number in range(begin // LENGTH, -(-end // LENGTH)):
            if number % self._stride:
                continue
            first, last = max(begin, number * LENGTH), min(end, (number + 1) * LENGTH)
            self._kept.setdefault(number, []).append(steps[first - begin : last - begin].copy())
            if len(self._kept) > _MOST:
                self._stride *= 2
                self._kept = {n: parts for n, parts in self._kept.items() if n % self._stride == 0}

    def in_a_row(self) -> list[Samples]:
        """The steps that are kept, each array (n,) [unit of the times] without a break."""
        if self._stride == 1:
            parts = [part for parts in self._kept.values() for part in parts]
            return [np.concatenate(parts)] if parts else []
        return [np.concatenate(parts) for parts in self._kept.values()]


SHOWN = 10
"""How many places a finding lists."""
_MOST_STEPS = 1 << 18


@dataclass
class Steps:
    """The distribution of steps: exact while there are at most 2**18 different ones, then to a part in 2**18."""

    values: Samples = field(default_factory=lambda: np.empty(0))
    counts: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    _new: list[Samples] = field(default_factory=list)
    _waiting: int = 0

    def add(self, steps: Samples) -> None:
        """Take in the next steps."""
        self._new.append(steps)
        self._waiting += len(steps)
        if self._waiting >= _MOST_STEPS:
            self._merge()

    def _merge(self) -> None:
        new = np.concatenate([*self._new, np.empty(0)])
        new.sort()
        firsts = np.flatnonzero(np.concatenate((np.ones(min(1, len(new)), bool), new[1:] != new[:-1])))
        counts = np.diff(firsts, append=len(new))
        self.values, self.counts = _merged(
            np.concatenate([self.values, new[firsts]]), np.concatenate([self.counts, counts])
        )
        dropped = 32
        while len(self.values) > _MOST_STEPS:
            coarse = (self.values.view(np.int64) >> dropped << dropped).view(np.float64)
            self.values, self.counts = _merged(coarse, self.counts)
            dropped += 2
        self._new, self._waiting = [], 0

    def quantile(self, q: float) -> float:
        """The step below which a share ``q`` of all lies; NaN if there are none. 0.5 is the median."""
        self._merge()
        total = int(self.counts.sum())
        if not total:
            return math.nan
        position, upto = q * (total - 1), np.cumsum(self.counts)
        low = self.values[np.searchsorted(upto, math.floor(position), side="right")]
        high = self.values[np.searchsorted(upto, math.ceil(position), side="right")]
        return float(low if low == high else (low + high) / 2)

    def places(self, lowest: float, highest: float, width: float) -> tuple[int, float] | None:
        """How many places of this ``width`` hold all steps from ``lowest`` to ``highest``, and the mean of these steps.

        None where they spread over more than that: times that are rounded have steps in few places.
        """
        self._merge()
        chosen = (self.values >= lowest) & (self.values <= highest)
        values, counts = self.values[chosen], self.counts[chosen]
        if not len(values):
            return None
        firsts = np.flatnonzero(np.diff(values, prepend=-math.inf) > width)
        lasts = np.append(firsts[1:], len(values)) - 1
        if np.any(values[lasts] - values[firsts] > width):
            return None
        return len(firsts), float(values @ counts / counts.sum())

    def gathered(self, width: float) -> tuple[Samples, NDArray[np.int64]]:
        """The steps above 0, neighbours no further apart than ``width`` as one.

        Returns their means (m,) [unit of the times] and how many each is (m,) [-].
        """
        self._merge()
        values, counts = self.values[self.values > 0], self.counts[self.values > 0]
        firsts = np.flatnonzero(np.diff(values, prepend=-math.inf) > width)
        if not len(firsts):
            return values, counts
        many = np.add.reduceat(counts, firsts)
        return np.add.reduceat(values * counts, firsts) / many, many

    def mean(self, lowest: float, highest: float) -> float:
        """The mean of the steps above ``lowest``, ``highest`` at most; NaN if there are none."""
        self._merge()
        chosen = (self.values > lowest) & (self.values <= highest)
        count = self.counts[chosen].sum()
        return float(self.values[chosen] @ self.counts[chosen] / count) if count else math.nan

    def above(self, limit: float) -> int:
        """How many steps are longer than ``limit``."""
        self._merge()
        return int(self.counts[self.values > limit].sum())


def _merged(values: Samples, counts: NDArray[np.int64]) -> tuple[Samples, NDArray[np.int64]]:
    unique, inverse = np.unique(values, return_inverse=True)
    return unique, np.bincount(inverse, weights=counts, minlength=len(unique)).astype(np.int64)


@dataclass
class ClockStats:
    """A recorded time column, in its unit as written."""

    first: float = math.nan
    last: float = math.nan
    dt_min: float = math.inf
    dt_max: float = -math.inf
    non_increasing: int = 0
    unreadable: int = 0
    falls: list[tuple[str, float]] = field(default_factory=list)
    longest: list[tuple[float, int, str]] = field(default_factory=list)
    """The longest steps, the first of equal ones: each with minus its number, and where it is."""
    _count: int = 0
    steps: Steps = field(default_factory=Steps)
    segments: StepReservoir = field(default_factory=StepReservoir)

    def update(self, block: Block, times: Samples, all_finite: bool = False) -> None:
        """Take in the times of the next block, of which it may be known that all are finite."""
        index: range | NDArray[np.int64] = range(len(times))
        if not all_finite:
            index = np.flatnonzero(np.isfinite(times))
            self.unreadable += len(times) - len(index)
            times = times[index]
        if not len(times):
            return
        steps = np.empty(len(times))
        steps[0] = times[0] - self.last
        np.subtract(times[1:], times[:-1], out=steps[1:])
        if math.isnan(self.last):
            self.first, steps, index = float(times[0]), steps[1:], index[1:]
        self.last = float(times[-1])
        if len(steps):
            self._take(block, steps, index)

    def _take(self, block: Block, steps: Samples, index: range | NDArray[np.int64]) -> None:
        self.steps.add(steps)
        self.segments.add(steps)
        smallest, largest = float(steps.min()), float(steps.max())
        self.dt_min, self.dt_max = min(self.dt_min, smallest), max(self.dt_max, largest)
        if smallest <= 0:
            falling = np.flatnonzero(steps <= 0)
            self.non_increasing += len(falling)
            for i in falling[: max(0, SHOWN - len(self.falls))]:
                self.falls.append((block.where(int(index[i])), float(steps[i])))
        least = self.longest[0][0] if len(self.longest) == SHOWN else -math.inf
        if largest > least:
            longer = np.flatnonzero(steps > least)
            cut = np.partition(steps[longer], -min(SHOWN, len(longer)))[-min(SHOWN, len(longer))]
            for i in [*longer[steps[longer] > cut], *longer[steps[longer] == cut][:SHOWN]]:
                keep = heappush if len(self.longest) < SHOWN else heappushpop
                keep(self.longest, (float(steps[i]), -self._count - int(i), block.where(int(index[i]))))
        self._count += len(steps)


_NEIGHBOURS, _SHARE = 8, 2.0**-16
"""To what a step is known: floating-point numbers beside the times, or the share of a step that is kept of it."""
_MOST_PLACES = 10
"""Steps of more places than that are alike to a tenth, and no reason for doubt."""
_NEARLY_ALL = 0.9
"""Share of the steps that are of two neighbouring numbers of places."""
_WHOLE = 0.05
"""How far a step may be from a whole number of places [places]."""
_WIDTH = 1.5
"""How far apart the furthest times above and below a fitted line may be [places]: 1, and up to 1.4 by the fit."""
_RARER, _PIECE = 32, 128
"""Steps of the rarer kind in a piece that is fitted by one line, and of both kinds, whichever makes it longer."""
_FEWEST, _SHORTEST = 10, 64
"""The fewest of either from which a piece is tested: fewer may well come evenly by chance."""
_MOSTLY = 0.75
"""Share of the pieces that are even where the times are rounded; in the others samples may be lost besides."""


class Grid(NamedTuple):
    """Steps of ``short`` and ``short`` + 1 places, each so long, and how many there are of both kinds."""

    place: float
    short: int
    shorter: int
    longer: int

    @property
    def mean(self) -> float:
        """The mean step, in the unit of the times."""
        return self.place * (self.short + self.longer / (self.shorter + self.longer))

    @property
    def longer_share(self) -> float:
        """Share of the longer steps."""
        return self.longer / (self.shorter + self.longer)

    def lengths(self, unit: str) -> str:
        """Both lengths, for a message."""
        return f"{self.short * self.place:.6g} and {(self.short + 1) * self.place:.6g} {unit}"

    def kinds(self, steps: Samples) -> NDArray[np.int64]:
        """Each of ``steps``, (n,) [s or other], as 0 (the shorter kind), 1 (the longer) or -1 (any other), (n,) [-]."""
        places = steps / self.place - self.short
        whole = np.rint(places)
        return np.where((np.abs(places - whole) <= _WHOLE) & (whole >= 0) & (whole <= 1), whole, -1).astype(np.int64)


@dataclass(frozen=True)
class Evenness:
    """In how many pieces of the column both kinds of steps come evenly, and in how many they do not."""

    even: int
    uneven: int
    mean: float
    """The mean step of the even pieces, in the unit of the times; NaN if there are none."""

    @property
    def tested(self) -> int:
        """Pieces from which it could be told."""
        return self.even + self.uneven

    @property
    def rounded(self) -> bool:
        """Whether the steps are those of a steady clock whose times were rounded."""
        return self.even > 0 and self.even >= _MOSTLY * self.tested


def known_to(clock: ClockStats, step: float) -> float:
    """To how much a step of the column is known, in the unit of the times."""
    return max(_NEIGHBOURS * math.ulp(max(abs(clock.first), abs(clock.last))), _SHARE * step)


def grid(clock: ClockStats) -> Grid | None:
    """The two kinds of steps; None where nearly all are not of two neighbouring numbers of places, both small."""
    values, counts = clock.steps.gathered(known_to(clock, clock.steps.quantile(0.5)))
    if len(values) < 2:
        return None
    low, high = sorted(np.argsort(counts)[-2:])
    place = float(values[high] - values[low])
    short = round(float(values[low]) / place)
    if counts[low] + counts[high] < _NEARLY_ALL * counts.sum() or not 1 <= short <= _MOST_PLACES:
        return None
    if abs(values[low] / place - short) > _WHOLE:
        return None
    return Grid(place, short, int(counts[low]), int(counts[high]))


def evenness(clock: ClockStats, steps: Grid) -> Evenness:
    """How evenly the two kinds of steps come, piece by piece."""
    length = max(_PIECE, math.ceil(_RARER / min(steps.longer_share, 1.0 - steps.longer_share)))
    even, tested, longer, count = 0, 0, 0, 0
    rows = [steps.kinds(row) for row in clock.segments.in_a_row()]
    for part in (part[part >= 0] for row in rows for part in np.split(row, np.flatnonzero(row < 0))):
        pieces = max(1, len(part) // length)
        kinds = part[: len(part) // pieces * pieces].reshape(pieces, -1)
        rarer = np.minimum(kinds.sum(axis=1), (1 - kinds).sum(axis=1))
        kinds = kinds[(rarer >= _FEWEST) & (kinds.shape[1] >= _SHORTEST)]
        straight = kinds[_widths(kinds) <= _WIDTH]
        even, tested = even + len(straight), tested + len(kinds)
        longer, count = longer + int(straight.sum()), count + straight.size
    return Evenness(even, tested - even, steps.place * (steps.short + longer / count) if count else math.nan)


def _widths(kinds: NDArray[np.int64]) -> Samples:
    """How far the times of m pieces lie apart, above and below each one's line of least squares, (m,) [places]."""
    at = np.pad(np.cumsum(kinds, axis=1), ((0, 0), (1, 0))).astype(float)
    along = np.arange(at.shape[1]) - (at.shape[1] - 1) / 2.0
    apart = at - np.outer(at @ along / (along @ along), along)
    return np.ptp(apart, axis=1)


GAP = 1.5
"""A step longer than this many samples is a gap."""
IRREGULAR = 0.1
"""Steps whose middle half spreads over more than this share of the median are those of no sampled signal."""
RATE_TOLERANCE = 0.005
"""A header's rate and 1 / median step may differ by this share: rates are often printed in three digits."""
_PLACES = 5
"""Steps of rounded times lie in so few places: two, more where they were rounded twice."""
_MATTERS = 1e-4
"""Mean and median step that differ by less than this share are not told apart."""
MANY = 0.05
"""Share of longer steps above which a steady clock whose times are rounded is likelier than samples lost as evenly."""


@dataclass(frozen=True)
class Sampling:
    """The step of a sample, in the unit of the times, and how it was found."""

    step: float
    longest: float
    """Longer steps are gaps."""
    source: str
    """``median_step``, or ``mean_step`` where the times are rounded so that the median is the step of no sample, or
    tremble: the median of such steps is off by their scatter, their mean by next to nothing.
    """
    spread: float
    """Spread of the middle half of the steps, as a share of their median; 0 where their scatter is all of rounding."""
    grid: Grid | None = None
    """The two kinds of steps, where the times are rounded so coarsely or samples may be lost."""
    evenness: Evenness | None = None
    settled: bool = True
    """Whether rounded times and samples lost as evenly can be told apart, where there are two kinds of steps."""
    rounded: bool = False
    """Whether the step is the mean of rounded ones."""

    @property
    def is_of_rounding(self) -> bool:
        """Whether the steps scatter because the times are rounded so coarsely."""
        return self.rounded and self.evenness is not None and self.evenness.rounded

    @property
    def is_steady(self) -> bool:
        """Whether the steps are those of a sampled signal."""
        return self.step > 0 and self.spread <= IRREGULAR


def sampling_of_times(clock: ClockStats, stated_step: float | None = None) -> Sampling:
    """The sampling that a column shows; ``stated_step``, in its unit, is that of the header's rate."""
    steps = grid(clock)
    if steps is None:
        return _by_median(clock)
    even = evenness(clock, steps)
    lost = not even.rounded or _near(stated_step, steps.place)
    lost = lost or (steps.longer_share < MANY and not _near(stated_step, steps.mean))
    if steps.short == 1 and lost:  # steps of two places among those of one are read as samples that were lost
        settled = not even.rounded or _near(stated_step, steps.place)
        return _by_median(clock, steps, even, settled)
    if not even.rounded:
        return _by_median(clock, steps, even)
    longest = max(GAP * steps.mean, (steps.short + 1.5) * steps.place)
    mean = even.mean if even.uneven else clock.steps.mean(0.0, longest)
    settled = steps.short > 1 or steps.longer_share > 0.5 or _near(stated_step, mean)
    return Sampling(mean, longest, "mean_step", 0.0, steps, even, settled, rounded=True)


def _near(stated_step: float | None, step: float) -> bool:
    return stated_step is not None and abs(step / stated_step - 1.0) <= RATE_TOLERANCE


def _by_median(
    clock: ClockStats,
    steps: Grid | None = None,
    even: Evenness | None = None,
    settled: bool = True,
) -> Sampling:
    """By the median step; by the mean of those about it where they lie in so few places that times were rounded, or in
    so many that the clock trembles.

    2048 samples a second with times in four decimals have steps of 0.0004 and 0.0005: their median is that of 2000.
    """
    median = clock.steps.quantile(0.5)
    if not median > 0:
        return Sampling(median, GAP * median, "median_step", 0.0)
    spread = (clock.steps.quantile(0.75) - clock.steps.quantile(0.25)) / median
    known = known_to(clock, median)
    longest = GAP * median + known
    found = clock.steps.places(median / 2.0 - known, longest, known)
    if found is None or found[0] > _PLACES:
        return Sampling(clock.steps.mean(median / 2.0, longest), longest, "mean_step", spread, steps, even, settled)
    if abs(found[1] / median - 1.0) <= _MATTERS:
        return Sampling(median, longest, "median_step", spread, steps, even, settled)
    return Sampling(found[1], longest, "mean_step", spread, steps, even, settled, rounded=True)


_BESIDE = 8
"""Samples on each side of a long step, by which it is told how many it left out."""


def even_steps(time: Floats, rate_hz: float) -> NDArray[np.intp] | None:
    """Where samples at instants (n,) [s] lie on even steps, (n,) [samples], if steps leave some out; else None.

    A long step left out as many as the clock is ahead of its samples after it, and was not before it, by the medians of
    those about it: one late time stamp leaves out none.
    """
    wide = np.flatnonzero(np.diff(time) * rate_hz > GAP)
    ahead = (time - time[:1]) * rate_hz - np.arange(len(time))
    lost = np.zeros(len(time), dtype=np.intp)
    for before, at, after in zip([-1, *wide], wide, [*wide[1:], len(time) - 1], strict=False):
        left, right = ahead[max(before + 1, at + 1 - _BESIDE) : at + 1], ahead[at + 1 : min(after, at + _BESIDE) + 1]
        lost[at + 1] = max(round(float(np.nan_to_num(np.nanmedian(right) - np.nanmedian(left)))), 0)
    return np.arange(len(time)) + np.cumsum(lost) if lost.any() else None
