"""The amplitude of a condition, with or without counter-masses, from one run or from repeats."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import student_quantile

from .judged import Judged
from .repeatability import Group, Repeatability
from .statistic import Statistic

FAR = 10.0
"""Distance from zero at which the bound is not felt [standard deviations]."""
_REACH = 5.0
"""How far from what was read amplitudes are tried [standard deviations]."""
_STEEP = 25.0
"""Most logarithms that amplitudes of repeats are tried above and below what was read."""
_FINE = 401
"""Amplitudes that are tried."""


@dataclass(frozen=True)
class Side:
    """One run, or repeats of it, whose mean deviation has the variance v / n.

    Without ``repeats`` v is 1, since a deviation is in standard deviations of what noise does to one run. With them
    v is that of the repeatability that is pooled over a campaign; of the side's own repeats alone where their noise is
    not known, or where they are not pooled.
    """

    group: Group
    repeats: Repeatability | None = None
    own: bool = False
    """Whether the scatter of the side's own repeats alone says how sure it is."""

    @property
    def runs(self) -> tuple[Judged, ...]:
        """One, or repeats."""
        return self.group.runs

    @property
    def bound(self) -> bool:
        """Whether a sensor was at the end of its range."""
        return any(run.bound for run in self.runs)

    @property
    def statistic(self) -> Statistic:
        """What is read of each run."""
        return self.runs[0].statistic

    @cached_property
    def floor(self) -> float | None:
        """What the metric would show of noise alone [unit]; None where a run shows no noise."""
        known = [run.floor for run in self.runs if run.floor is not None]
        return self.statistic.amplitude(float(np.mean(known))) if len(known) == len(self.runs) else None

    @property
    def amplitude(self) -> float:
        """The amplitude that reads as was read, middle value; zero where noise alone reads as much [unit]."""
        return self.group.middle

    def deviation(self, amplitude: Floats) -> Floats:
        """By how many standard deviations the mean reading lies above what each amplitude (k,) would read."""
        return self.group.deviations(amplitude).mean(axis=0) / self._error

    def distance(self, amplitude: Floats) -> Floats:
        """How many standard deviations each amplitude (k,) reads above none, at most FAR."""
        risen = np.mean([run.distance(amplitude) for run in self.runs], axis=0)
        return np.clip(risen / self._error, 0.0, FAR)

    @cached_property
    def tried(self) -> Floats:
        """Amplitudes around what was read, rising, (_FINE,) [unit]; evenly far above the noise in their logarithms."""
        tables = np.array([run.tried[[0, -1]] for run in self.runs])
        scale = float(np.mean([run.scale for run in self.runs]))
        reach = max(_REACH, 1.5 * student_quantile(0.9975, self.freedom)) * self._error
        around = min(0.25 * reach * scale / float(np.hypot(self.amplitude, scale)), _STEEP) * np.array([-1.0, 1.0])
        low, high = np.maximum(np.arcsinh(self.amplitude / scale) + around, 0.0)
        low, high = min(low, np.arcsinh(tables[:, 0].min() / scale)), max(high, np.arcsinh(tables[:, 1].max() / scale))
        return scale * np.sinh(np.linspace(low, high, _FINE))

    @property
    def freedom(self) -> float:
        """Degrees of freedom of its own variance."""
        return freedom_of((self,), (1.0,))

    @cached_property
    def variance(self) -> float:
        """Of one reading [1, in units of the noise]."""
        if self.own:
            return self.group.variance
        return 1.0 if self.repeats is None else self.repeats.variance(self.group.clearness)

    @property
    def components(self) -> Floats:
        """By how much of itself the variance grows with each of the pooled components, (2,)."""
        pooled = self.repeats is not None and not self.own
        return np.array([1.0, self.group.clearness**2]) / self.variance if pooled else np.zeros(2)

    @property
    def own_freedom(self) -> float:
        """Degrees of freedom of what is not pooled."""
        return self.group.freedom if self.own else np.inf

    @property
    def _error(self) -> float:
        """Standard deviation of the mean deviation."""
        return float((self.variance / len(self.runs)) ** 0.5)


def freedom_of(sides: Sequence[Side], shares: Sequence[float]) -> float:
    """Degrees of freedom of a variance to which each side brings its share.

    Welch and Satterthwaite (JCGM 100:2008, G.4), but that what is pooled is the same on all sides.
    """
    repeats = sides[0].repeats
    pooled = np.sum([share * side.components for side, share in zip(sides, shares, strict=True)], axis=0)
    doubt = sum(2.0 * share**2 / side.own_freedom for side, share in zip(sides, shares, strict=True))
    doubt += 0.0 if repeats is None else float(pooled @ repeats.covariance @ pooled)
    return max(2.0 / doubt, 1.0) if doubt > 0.0 else np.inf
