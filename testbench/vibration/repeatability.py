"""How much the repeats of a campaign scatter: noise, and a share of the amplitude, pooled over conditions.

Of a run at an amplitude of x standard deviations of the noise that its rest shows, the reading has the variance
p0 + p1 x^2, in units of that noise: p0 is the noise in motion, which need not be that at rest, and p1 the square of the
share by which runs differ (two components: Rocke and Lorenzato, Technometrics 37, 176, 1995; pooled over conditions:
JCGM 100:2008, 4.2.4, and ISO 5725-2). Both are found by likelihood of the variances within groups of repeats, which
are p0 + p1 x^2 times chi squared over its degrees of freedom; so what one run's noise does to its reading is counted
once, as part of their scatter. Nothing but their scatter says how large they are: two repeats a side are not taken to
scatter as little as noise at rest would make them. A group that scatters more than the others let expect is not pooled.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import f_tail

from .amplitude_likelihood import AmplitudeLikelihood

OUTLYING = 0.01
"""Level at which the largest of the variances is not one of the others' (ISO 5725-2, 7.3.3)."""
_FEWEST = 3
"""Groups, of which one can be told to be unlike the others."""
_TRIED = 200
"""Ratios of the components."""
_DITHERED = 0.25
"""Share of steps in the noise where its standard deviation is half a step: more of it, and errors of steps are a
matter of chance in every run (Widrow and Kollar, Quantization Noise, 2008); less, and repeats may err alike."""
_LEAST = 1e-12
"""Variance of readings that differ in rounding alone."""


@dataclass(frozen=True, eq=False)
class Group:
    """One run, or repeats, of one condition, with or without counter-masses."""

    runs: tuple[AmplitudeLikelihood, ...]
    names: tuple[str, ...] = ()
    """Of the runs."""

    @cached_property
    def middle(self) -> float:
        """The amplitude that reads as was read on average; zero where noise alone reads as much [unit]."""
        tried = np.unique(np.concatenate([run.tried for run in self.runs]))
        above = np.minimum.accumulate(self.deviations(tried).sum(axis=0))
        return float(np.interp(0.0, above[::-1], tried[::-1]))

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the scatter."""
        return len(self.runs) - 1

    @cached_property
    def variance(self) -> float:
        """Of the readings [1, in units of the noise]; no less than of steps that noise does not make differ."""
        steps = float(np.mean([run.steps for run in self.runs]))
        least = steps if steps > _DITHERED else _LEAST
        return max(float(self.deviations(np.array([self.middle])).var(ddof=1)), least)

    @cached_property
    def clearness(self) -> float:
        """The amplitude in standard deviations of the noise."""
        return float(np.sqrt(np.mean([run.clearness(self.middle) ** 2 for run in self.runs])))

    @property
    def noisy(self) -> bool:
        """Whether the noise of every run is known."""
        return all(run.floor is not None for run in self.runs)

    def deviations(self, amplitudes: Floats) -> Floats:
        """Of each run from each amplitude (k,), (n, k) [standard deviations of noise]."""
        return np.array([run.deviation(amplitudes) for run in self.runs])


@dataclass(frozen=True)
class Repeatability:
    """The two components, and how well they are known."""

    noise: float
    """p0 [1]."""
    share: float
    """p1 [1]."""
    covariance: Floats
    """Of both, by the information of the likelihood, (2, 2)."""
    outlying: tuple[Group, ...] = ()
    """Groups that are not pooled."""

    @classmethod
    def of(cls, groups: Sequence[Group]) -> "Repeatability | None":
        """From groups of repeats; None where fewer than two of known noise have any."""
        pooled = [group for group in groups if group.freedom and group.noisy]
        outlying: list[Group] = []
        while len(pooled) >= _FEWEST and (odd := _unlike(pooled)):
            pooled.remove(odd)
            outlying.append(odd)
        return _fitted(pooled, tuple(outlying)) if len(pooled) > 1 else None

    def variance(self, clearness: float) -> float:
        """Of a reading [1, in units of the noise]."""
        return self.noise + self.share * clearness**2

    def leaves_out(self, group: Group) -> bool:
        """Whether a group is not pooled, since it scatters unlike the others."""
        return group.names in {other.names for other in self.outlying}

    def freedom(self, clearness: float) -> float:
        """Degrees of freedom of the variance: 2 v^2 / var v (Satterthwaite; JCGM 100:2008, G.4), at least 1."""
        terms = np.array([1.0, clearness**2])
        return max(2.0 * self.variance(clearness) ** 2 / float(terms @ self.covariance @ terms), 1.0)


def _fitted(groups: Sequence[Group], outlying: tuple[Group, ...] = ()) -> Repeatability:
    """The likeliest components, neither below zero: least sum of freedom (log v + variance / v).

    Their ratio is the one that suits the variances found, and what v is of a side thereby too small, by 1 in so many
    degrees of freedom as there are: with that made up for, 95 % are 95 % (Monte Carlo, tests of this module).
    """
    freedom, variance, square = _arrays(groups)
    variance *= 1.0 + 1.0 / freedom.sum()
    unit = float(square.mean()) or 1.0  # so that both components are of like size
    terms = np.stack([np.ones_like(square), square / unit])
    ratio = _ratio(freedom, variance, terms[1])
    noise = float(freedom @ (variance / (1.0 + ratio * terms[1])) / freedom.sum())
    weights = freedom / (2.0 * (noise * (1.0 + ratio * terms[1])) ** 2)
    scale = np.array([1.0, 1.0 / unit])
    covariance = np.linalg.pinv((terms * weights) @ terms.T, hermitian=True) * np.outer(scale, scale)
    return Repeatability(noise, noise * ratio / unit, covariance, outlying)


def _ratio(freedom: Floats, variance: Floats, square: Floats) -> float:
    """The likeliest p1 / p0; of each, the likeliest p0 is a mean."""
    from scipy.optimize import minimize_scalar

    def unlikely(logarithm: Floats | float) -> Floats:
        factors = 1.0 + np.multiply.outer(np.exp(logarithm), square)
        mean = (freedom * variance / factors).sum(axis=-1) / freedom.sum()
        return np.asarray(freedom.sum() * np.log(mean) + (freedom * np.log(factors)).sum(axis=-1))

    clear = square[square > 0.0]
    if not clear.size:
        return 0.0
    tried = np.linspace(np.log(1e-3 / clear.max()), np.log(1e6 / clear.min()), _TRIED)
    best = int(np.argmin(unlikely(tried)))
    if best == 0:
        return 0.0
    ends = float(tried[best - 1]), float(tried[min(best + 1, _TRIED - 1)])
    return float(np.exp(minimize_scalar(lambda at: float(unlikely(at)), bounds=ends, method="bounded").x))


def _unlike(groups: Sequence[Group]) -> Group | None:
    """The group whose variance is least like what all others let expect, where that is a matter of OUTLYING.

    What they let expect is the most of what noise alone, a share alone and both would make of their scatter.
    """
    freedom, variance, square = _arrays(groups)
    chances = []
    for index, group in enumerate(groups):
        rest = np.arange(len(groups)) != index
        expected = _fitted([*groups[:index], *groups[index + 1 :]]).variance(group.clearness)
        noise = float(np.average(variance[rest], weights=freedom[rest]))
        share = float(np.average((variance / np.maximum(square, 1.0))[rest], weights=freedom[rest]))
        excess = group.variance / max(expected, noise, share * group.clearness**2)
        chances.append(f_tail(excess, group.freedom, float(freedom[rest].sum())))
    odd = int(np.argmin(chances))
    return groups[odd] if chances[odd] < OUTLYING / len(groups) else None


def _arrays(groups: Sequence[Group]) -> tuple[Floats, Floats, Floats]:
    """Degrees of freedom, variances and squared clearness, (m,) each."""
    table = np.array([(group.freedom, group.variance, group.clearness**2) for group in groups], dtype=float)
    return table[:, 0], table[:, 1], table[:, 2]
