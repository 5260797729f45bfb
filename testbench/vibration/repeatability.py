"""How much the repeats of a campaign scatter: noise, and a share of the amplitude, pooled over conditions.

At a signal-to-noise ratio x (the noise being that of the run's rest) a reading has the variance p0 + p1 x^2, in
variances of that noise: p0 is the noise in motion, which may differ from that at rest, p1 the square of the share by
which runs differ (two components: Rocke and Lorenzato, Technometrics 37, 176, 1995; pooled over conditions:
JCGM 100:2008, 4.2.4, and ISO 5725-2). Both are estimated by maximum likelihood from the variances within groups of
repeats, which are p0 + p1 x^2 times chi squared over its degrees of freedom. The noise of a single run is thus counted
once, as part of the scatter, and the scatter is never assumed to be as small as noise at rest alone would make it. A
group that scatters more than expected from the others is not pooled.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import f_tail

from .amplitude_likelihood import AmplitudeLikelihood

OUTLYING = 0.01
"""Level at which the largest variance is an outlier (ISO 5725-2, 7.3.3)."""
_FEWEST = 3
"""Least number of groups of which one can be an outlier."""
_TRIED = 200
"""Ratios of the components among which the likeliest is searched."""
_DITHERED = 0.25
"""Share of quantization in the noise power where the noise's standard deviation is half a step: below it quantization
errors are random in every run (Widrow and Kollar, Quantization Noise, 2008), above it repeats may share them."""
_LEAST = 1e-12
"""Variance of readings that differ by rounding alone [variances of the noise]."""


@dataclass(frozen=True, eq=False)
class Group:
    """One run, or repeats, of one condition, with or without counter-masses."""

    runs: tuple[AmplitudeLikelihood, ...]
    names: tuple[str, ...] = ()
    """Names of the runs."""

    @cached_property
    def amplitude(self) -> float:
        """The amplitude whose expected reading is the mean reading; zero where noise alone reads as much [unit]."""
        tried = np.unique(np.concatenate([run.amplitudes for run in self.runs]))
        above = np.minimum.accumulate(self.deviations(tried).sum(axis=0))
        return float(np.interp(0.0, above[::-1], tried[::-1]))

    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom of the scatter."""
        return len(self.runs) - 1

    @cached_property
    def variance(self) -> float:
        """Of the readings [variances of the noise]; at least that of quantization which the repeats may share."""
        steps = float(np.mean([run.quantization_share for run in self.runs]))
        least = steps if steps > _DITHERED else _LEAST
        return max(float(self.deviations(np.array([self.amplitude])).var(ddof=1)), least)

    @cached_property
    def signal_to_noise(self) -> float:
        """The amplitude in standard deviations of the noise [-]."""
        return float(np.sqrt(np.mean([run.signal_to_noise(self.amplitude) ** 2 for run in self.runs])))

    @property
    def noise_known(self) -> bool:
        """Whether the noise of every run is known."""
        return all(run.floor is not None for run in self.runs)

    def deviations(self, amplitudes: Floats) -> Floats:
        """Of each run from amplitudes (k,) [unit], (n, k) [standard deviations of noise]."""
        return np.array([run.deviation(amplitudes) for run in self.runs])


@dataclass(frozen=True)
class Repeatability:
    """The two components of the variance of repeats, and their covariance."""

    noise: float
    """p0 [variances of the noise at rest]."""
    share: float
    """p1 [-]."""
    covariance: Floats
    """Of p0 and p1, by the Fisher information, (2, 2) [-]."""
    outlying: tuple[Group, ...] = ()
    """Groups that are not pooled: they scatter more than expected."""

    @classmethod
    def of(cls, groups: Sequence[Group]) -> "Repeatability | None":
        """From groups of repeats; None where fewer than two of known noise have repeats."""
        pooled = [group for group in groups if group.degrees_of_freedom and group.noise_known]
        outlying: list[Group] = []
        while len(pooled) >= _FEWEST and (odd := _outlier(pooled)):
            pooled.remove(odd)
            outlying.append(odd)
        return _maximum_likelihood(pooled, tuple(outlying)) if len(pooled) > 1 else None

    def variance(self, signal_to_noise: float) -> float:
        """Of a reading [variances of the noise]."""
        return self.noise + self.share * signal_to_noise**2

    def excludes(self, group: Group) -> bool:
        """Whether a group is an outlier and not pooled."""
        return group.names in {other.names for other in self.outlying}

    def degrees_of_freedom(self, signal_to_noise: float) -> float:
        """Degrees of freedom of the variance: 2 v^2 / var v (Satterthwaite; JCGM 100:2008, G.4), at least 1."""
        terms = np.array([1.0, signal_to_noise**2])
        return max(2.0 * self.variance(signal_to_noise) ** 2 / float(terms @ self.covariance @ terms), 1.0)


def _maximum_likelihood(groups: Sequence[Group], outlying: tuple[Group, ...] = ()) -> Repeatability:
    """The likeliest components, neither below zero: least sum of nu (log v + variance / v).

    Since their ratio is fitted too, v is too small by 1 in as many degrees of freedom as there are; with that
    corrected, 95 % intervals cover 95 % (Monte Carlo, tests of this module).
    """
    freedom, variance, square = _groups_table(groups)
    variance *= 1.0 + 1.0 / freedom.sum()
    unit = float(square.mean()) or 1.0  # scales both components to similar size
    terms = np.stack([np.ones_like(square), square / unit])
    ratio = _variance_ratio(freedom, variance, terms[1])
    noise = float(freedom @ (variance / (1.0 + ratio * terms[1])) / freedom.sum())
    weights = freedom / (2.0 * (noise * (1.0 + ratio * terms[1])) ** 2)
    scale = np.array([1.0, 1.0 / unit])
    covariance = np.linalg.pinv((terms * weights) @ terms.T, hermitian=True) * np.outer(scale, scale)
    return Repeatability(noise, noise * ratio / unit, covariance, outlying)


def _variance_ratio(freedom: Floats, variance: Floats, square: Floats) -> float:
    """The likeliest p1 / p0; for each ratio the likeliest p0 is a weighted mean."""
    from scipy.optimize import minimize_scalar

    def deviance(logarithm: Floats | float) -> Floats:
        factors = 1.0 + np.multiply.outer(np.exp(logarithm), square)
        mean = (freedom * variance / factors).sum(axis=-1) / freedom.sum()
        return np.asarray(freedom.sum() * np.log(mean) + (freedom * np.log(factors)).sum(axis=-1))

    clear = square[square > 0.0]
    if not clear.size:
        return 0.0
    tried = np.linspace(np.log(1e-3 / clear.max()), np.log(1e6 / clear.min()), _TRIED)
    best = int(np.argmin(deviance(tried)))
    if best == 0:
        return 0.0
    ends = float(tried[best - 1]), float(tried[min(best + 1, _TRIED - 1)])
    return float(np.exp(minimize_scalar(lambda at: float(deviance(at)), bounds=ends, method="bounded").x))


def _outlier(groups: Sequence[Group]) -> Group | None:
    """The group whose variance exceeds the expected one most, if significantly (OUTLYING); else None.

    Expected is the largest of what noise alone, a share alone and both predict from all other groups.
    """
    freedom, variance, square = _groups_table(groups)
    probabilities = []
    for index, group in enumerate(groups):
        rest = np.arange(len(groups)) != index
        expected = _maximum_likelihood([*groups[:index], *groups[index + 1 :]]).variance(group.signal_to_noise)
        noise = float(np.average(variance[rest], weights=freedom[rest]))
        share = float(np.average((variance / np.maximum(square, 1.0))[rest], weights=freedom[rest]))
        excess = group.variance / max(expected, noise, share * group.signal_to_noise**2)
        probabilities.append(f_tail(excess, group.degrees_of_freedom, float(freedom[rest].sum())))
    odd = int(np.argmin(probabilities))
    return groups[odd] if probabilities[odd] < OUTLYING / len(groups) else None


def _groups_table(groups: Sequence[Group]) -> tuple[Floats, Floats, Floats]:
    """Degrees of freedom, variances and squared signal-to-noise ratios, (m,) each."""
    table = np.array(
        [(group.degrees_of_freedom, group.variance, group.signal_to_noise**2) for group in groups], dtype=float
    )
    return table[:, 0], table[:, 1], table[:, 2]
