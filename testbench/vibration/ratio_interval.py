"""The ratio of two amplitudes, and its interval: every ratio that the readings do not contradict.

Amplitudes cannot be negative, so neither can their ratio. The interval is that of Feldman and Cousins, Phys. Rev. D 57,
3873 (1998), table X: the readings that are accepted for a mean are chosen by likelihood ratio, so that the interval is
one-sided where there is nothing and two-sided where there is something, never empty, and covers the truth with the
stated probability at every mean. An interval cut off at zero, or whose kind is chosen after the reading, does not.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import LEVEL, normal_probability, normal_quantile, student_tail

from .condition import ConditionAmplitude, pooled_degrees_of_freedom

_FINE = 65
"""Amplitudes between three of a grid among which the likeliest is searched: to less than 1e-3 standard deviations."""
_TOLERANCE = 1e-8
"""Of an end, relative and absolute."""
_FIRST_STEP = 1.0 / 64.0
"""First step of the search for the upper end, of the largest amplitude with counter-masses."""
_DOUBLINGS = 60
"""Doublings of the ratio after which it is taken to have no upper end."""
_MEANS = np.linspace(0.0, 2.0, 81)
"""Means for which acceptance is solved [standard deviations]; above, the bound at zero has no effect."""


@dataclass(frozen=True)
class Ratio:
    """Amplitude with counter-masses over amplitude without.

    The statistic of a ratio r is the least d_with(r a)^2 + d_without(a)^2 over the amplitude a without, d the
    deviations of the readings in standard deviations; in Gaussian noise this is Fieller's theorem. From repeats, its
    root is Student's t with the degrees of freedom of both variances.
    """

    balanced: ConditionAmplitude
    unbalanced: ConditionAmplitude

    @cached_property
    def defined(self) -> bool:
        """Whether anything vibrated above the noise without counter-masses; otherwise every ratio is possible."""
        nothing = self.unbalanced.deviation(np.zeros(1))
        return bool(
            normal_deviates(nothing, self.unbalanced.degrees_of_freedom)[0]
            > feldman_cousins_acceptance(np.zeros(1))[1][0]
        )

    @cached_property
    def value(self) -> float | None:
        """The ratio of both amplitudes [-]; None where it is not defined."""
        return self.balanced.amplitude / self.unbalanced.amplitude if self.defined else None

    @cached_property
    def below_noise(self) -> bool:
        """Whether the amplitude with counter-masses is not above the noise, so that the ratio may be zero."""
        return self._excess_high(0.0) >= 0.0

    def accepts(self, ratio: float) -> bool:
        """Whether the interval contains a ratio; every one where the ratio is not defined."""
        return not self.defined or min(self._excess_low(ratio), self._excess_high(ratio)) >= 0.0

    @cached_property
    def interval(self) -> tuple[float, float] | None:
        """Of 95 % [-], infinite where there is no upper end; None where the ratio is not defined."""
        if self.value is None:
            return None
        low = 0.0 if self.below_noise else _end(self._excess_high, self.value, 0.0)
        high = self.value + _FIRST_STEP * float(self.balanced.amplitudes[-1]) / self.unbalanced.amplitude
        for _ in range(_DOUBLINGS):
            if self._excess_low(high) < 0.0:
                return low, _end(self._excess_low, self.value, high)
            high *= 2.0
        return low, np.inf

    def _excess_low(self, ratio: float) -> float:
        """The reading less the lowest that is accepted for a ratio."""
        score, distance = self._standardized(ratio)
        return score - float(feldman_cousins_acceptance(np.array([distance]))[0][0])

    def _excess_high(self, ratio: float) -> float:
        """The highest reading that is accepted for a ratio less the reading."""
        score, distance = self._standardized(ratio)
        return float(feldman_cousins_acceptance(np.array([distance]))[1][0]) - score

    def _standardized(self, ratio: float) -> tuple[float, float]:
        """The reading's deviation at a ratio, as a standard normal deviate, and the ratio's distance from zero."""
        if ratio not in self._known:
            self._known[ratio] = self._standardized_anew(ratio)
        return self._known[ratio]

    @cached_property
    def _lower(self) -> Floats:
        """Of the amplitudes without counter-masses that are tried first, whatever the ratio, (k,)."""
        return self.unbalanced.deviation(self.unbalanced.amplitudes)

    @cached_property
    def _known(self) -> dict[float, tuple[float, float]]:
        return {}

    def _standardized_anew(self, ratio: float) -> tuple[float, float]:
        tried, lower = self.unbalanced.amplitudes, self._lower
        upper = self.balanced.deviation(ratio * np.append(tried, self.unbalanced.amplitude))
        sign, best = np.sign(upper[-1]), int(np.argmin(upper[:-1] ** 2 + lower**2))
        tried = np.linspace(tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)], _FINE)
        upper, lower = self.balanced.deviation(ratio * tried), self.unbalanced.deviation(tried)
        best = int(np.argmin(upper**2 + lower**2))
        above, below, amplitude = upper[best], lower[best], tried[best]
        total = max(above**2 + below**2, 1e-300)
        free = pooled_degrees_of_freedom((self.balanced, self.unbalanced), (above**2 / total, below**2 / total))
        score = normal_deviates(np.array([sign * total**0.5]), free)[0]
        distance = self.balanced.distance(np.array([ratio * amplitude]))
        return float(score), float(distance[0])


def _end(excess: Callable[[float], float], inside: float, outside: float) -> float:
    """Zero of an excess between two ratios; the inner one where the excess is zero there already (no noise)."""
    from scipy.optimize import brentq

    return inside if excess(inside) <= 0.0 else float(brentq(excess, inside, outside, xtol=_TOLERANCE, rtol=_TOLERANCE))


def normal_deviates(deviations: Floats, degrees_of_freedom: float) -> Floats:
    """Normal deviates of the same probability as deviates of Student's t (k,)."""
    if np.isinf(degrees_of_freedom):
        return deviations
    tail = np.maximum(student_tail(np.abs(deviations), degrees_of_freedom), 1e-300)
    return np.asarray(np.sign(deviations) * -normal_quantile(tail))


def feldman_cousins_acceptance(mean: Floats) -> tuple[Floats, Floats]:
    """Lowest and highest accepted reading less the mean, each (n,), for ``mean`` (n,); all [standard deviations]."""
    mean = np.maximum(mean, 1e-6)
    high = np.interp(mean, _MEANS, _highest_accepted())
    return _lowest_accepted(mean, high), high


def _lowest_accepted(mean: Floats, high: Floats) -> Floats:
    """The lower end with the likelihood ratio of the upper one, against the likeliest mean that is not negative."""
    return np.where(mean >= high, -high, -(mean**2 + high**2) / (2.0 * mean))


@cache
def _highest_accepted() -> Floats:
    """The upper ends at ``_MEANS``, with the lower ends enclosing LEVEL of the readings, (81,)."""
    from scipy.optimize import brentq

    def excess(high: float, mean: float) -> float:
        low = float(_lowest_accepted(np.array(mean), np.array(high)))
        return normal_probability(high) - normal_probability(low) - LEVEL

    return np.array([brentq(excess, 1.0, 3.0, args=(max(float(mean), 1e-6),)) for mean in _MEANS])
