"""Steps of a recorded time column, gathered block by block in bounded memory.

Stretches of a recorded time column, kept as they came: what a distribution of steps does not show is their order.
"""

import math
from dataclasses import dataclass, field
from heapq import heappush, heappushpop

import numpy as np
from numpy.typing import NDArray

from ..recording import Block, Samples

LENGTH = 4096
"""Steps of one stretch."""
_MOST = 16


@dataclass
class StepReservoir:
    """Up to 16 stretches of 4096 steps in a row, evenly over the column; all of it while it is no longer than that."""

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
        """The steps that are kept, each array (n,) without a break."""
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
        """The steps above 0, neighbours no further apart than ``width`` as one: their means, and how many each is."""
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
    longest: list[tuple[float, str]] = field(default_factory=list)
    steps: Steps = field(default_factory=Steps)
    stretches: StepReservoir = field(default_factory=StepReservoir)

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
        self.stretches.add(steps)
        smallest, largest = float(steps.min()), float(steps.max())
        self.dt_min, self.dt_max = min(self.dt_min, smallest), max(self.dt_max, largest)
        if smallest <= 0:
            falling = np.flatnonzero(steps <= 0)
            self.non_increasing += len(falling)
            for i in falling[: max(0, SHOWN - len(self.falls))]:
                self.falls.append((block.where(int(index[i])), float(steps[i])))
        if len(self.longest) < SHOWN or largest > self.longest[0][0]:
            for i in np.argpartition(steps, -min(SHOWN, len(steps)))[-SHOWN:]:
                self._keep_longest(float(steps[i]), block.where(int(index[i])))

    def _keep_longest(self, step: float, where: str) -> None:
        if len(self.longest) < SHOWN:
            heappush(self.longest, (step, where))
        else:
            heappushpop(self.longest, (step, where))
