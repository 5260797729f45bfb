"""The ratio of two amplitudes, and all the ratios that the readings speak for."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import normal_quantile, student_tail

from .condition import ConditionAmplitude, freedom_of
from .feldman_cousins import feldman_cousins_acceptance

_FINE = 401
_START = 1.0 / 64.0
_MOST = 60
"""Doublings after which a ratio is taken to have no upper end."""


@dataclass(frozen=True)
class Ratio:
    """Amplitude with counter-masses over amplitude without.

    A ratio r is judged by the amplitude a without that goes best with both readings: the least d_with(r a)^2 +
    d_without(a)^2, d the deviations of the readings in standard deviations; in Gaussian noise this is Fieller's
    theorem. From repeats, the root of it is Student's t with the degrees of freedom of the variance's shares.
    """

    balanced: ConditionAmplitude
    unbalanced: ConditionAmplitude

    @cached_property
    def defined(self) -> bool:
        """Whether anything vibrated above the noise without counter-masses: otherwise any ratio goes."""
        nothing = self.unbalanced.deviation(np.zeros(1))
        return bool(_normal(nothing, self.unbalanced.freedom)[0] > feldman_cousins_acceptance(np.zeros(1))[1][0])

    @cached_property
    def value(self) -> float | None:
        """The ratio of the middle values."""
        return self.balanced.amplitude / self.unbalanced.amplitude if self.defined else None

    @cached_property
    def below_noise(self) -> bool:
        """Whether what is left may be nothing: the amplitude with counter-masses is not above the noise."""
        return self._excess_high(0.0) >= 0.0

    def speaks_for(self, ratio: float) -> bool:
        """Whether a ratio is among those that the readings speak for; any is where none is defined."""
        return not self.defined or min(self._excess_low(ratio), self._excess_high(ratio)) >= 0.0

    @cached_property
    def interval(self) -> tuple[float, float] | None:
        """Of 95 %; None where the ratio is not defined or has no upper end."""
        if self.value is None:
            return None
        low = 0.0 if self.below_noise else _end(self._excess_high, self.value, 0.0)
        high = self.value + _START * float(self.balanced.tried[-1]) / self.unbalanced.amplitude
        for _ in range(_MOST):
            if self._excess_low(high) < 0.0:
                return low, _end(self._excess_low, self.value, high)
            high *= 2.0
        return None

    def _excess_low(self, ratio: float) -> float:
        """How far the reading lies above the lowest that speaks for a ratio."""
        score, distance = self._judged(ratio)
        return score - float(feldman_cousins_acceptance(np.array([distance]))[0][0])

    def _excess_high(self, ratio: float) -> float:
        """How far the reading lies below the highest that speaks for a ratio."""
        score, distance = self._judged(ratio)
        return float(feldman_cousins_acceptance(np.array([distance]))[1][0]) - score

    def _judged(self, ratio: float) -> tuple[float, float]:
        """The reading's deviation at a ratio, as a standard normal deviate, and the ratio's distance from zero."""
        tried = self.unbalanced.tried
        for _ in range(2):
            upper, lower = self.balanced.deviation(ratio * tried), self.unbalanced.deviation(tried)
            best = int(np.argmin(upper**2 + lower**2))
            near = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
            tried, kept = np.linspace(*near, _FINE), (upper[best], lower[best], tried[best])
        above, below, amplitude = kept
        total = max(above**2 + below**2, 1e-300)
        sign = np.sign(self.balanced.deviation(np.array([ratio * self.unbalanced.amplitude]))[0])
        free = freedom_of((self.balanced, self.unbalanced), (above**2 / total, below**2 / total))
        score = _normal(np.array([sign * total**0.5]), free)[0]
        distance = self.balanced.distance(np.array([ratio * amplitude]))
        return float(score), float(distance[0])


def _end(excess: Callable[[float], float], inside: float, outside: float) -> float:
    """Where an excess falls to zero on the way out; without noise that is where it starts."""
    from scipy.optimize import brentq

    return inside if excess(inside) <= 0.0 else float(brentq(excess, inside, outside))


def _normal(deviations: Floats, freedom: float) -> Floats:
    """Deviates of Student's t as those of a normal distribution."""
    if np.isinf(freedom):
        return deviations
    return np.asarray(
        np.sign(deviations) * -normal_quantile(np.maximum(student_tail(np.abs(deviations), freedom), 1e-300))
    )
