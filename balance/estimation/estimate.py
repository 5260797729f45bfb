"""Values with their covariance, and every quantile that the product takes: no other module calls one.

An interval of level p about a value is value +- k u with u the standard uncertainty and k the coverage factor,
Student's t for the degrees of freedom (JCGM 100:2008, G.3). A systematic part that no repetition shows, of which bounds
alone are known, widens an interval by its bounds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ..arrays import Floats

LEVEL = 0.95
"""Coverage probability of intervals and regions where none is named."""
LEVEL_TEXT = f"{100 * LEVEL:g} %"
"""The same as text."""


@dataclass(frozen=True)
class Estimate:
    """One or several values of one unit with their covariance; single values have ``value``, ``interval()``."""

    values: Floats
    """(k,)"""
    covariance: Floats
    """(k, k), of the values' unit squared."""
    degrees_of_freedom: float = np.inf
    """Of the covariance; infinite where it is known."""
    name: str = ""
    unit: str = ""
    systematic: tuple[float, float] = (0.0, 0.0)
    """Bounds, lower <= 0 <= upper, of what the covariance does not contain."""

    def __post_init__(self) -> None:
        if self.covariance.shape != (len(self.values), len(self.values)):
            raise ValueError(f"covariance {self.covariance.shape} of {len(self.values)} values")

    @classmethod
    def single(
        cls,
        value: float,
        standard_uncertainty: float,
        degrees_of_freedom: float = np.inf,
        name: str = "",
        unit: str = "",
    ) -> "Estimate":
        """Of one value."""
        return cls(np.array([value]), np.array([[standard_uncertainty**2]]), degrees_of_freedom, name, unit)

    @property
    def value(self) -> float:
        """The single value."""
        (value,) = self.values
        return float(value)

    @property
    def standard_uncertainty(self) -> float:
        """Of the single value."""
        ((variance,),) = self.covariance
        return float(np.sqrt(max(float(variance), 0.0)))

    def half_width(self, level: float = LEVEL) -> float:
        """Half of the single value's interval, without bounds of what is systematic."""
        return coverage_factor(self.degrees_of_freedom, level) * self.standard_uncertainty

    def interval(self, level: float = LEVEL) -> tuple[float, float]:
        """Lower and upper end of the single value's interval."""
        half, (low, high) = self.half_width(level), self.systematic
        return self.value + low - half, self.value + high + half

    def shifted(self, change: float) -> "Estimate":
        """The values, each plus what is known exactly."""
        return replace(self, values=self.values + change)

    def containing(self, others: Sequence[float]) -> "Estimate":
        """The single value with what is systematic bounded by values that other choices of method give."""
        away = [0.0, *(other - self.value for other in others)]
        return replace(self, systematic=(min(away), max(away)))

    def region(self, level: float = LEVEL) -> "Region":
        """Ellipse about two values that contains the true pair."""
        sizes, axes = np.linalg.eigh(self.covariance)
        short, long = joint_coverage_factor(2, self.degrees_of_freedom, level) * np.sqrt(np.maximum(sizes, 0.0))
        return Region((float(long), float(short)), float(np.arctan2(axes[1, 1], axes[0, 1])))


@dataclass(frozen=True)
class Region:
    """Ellipse about a pair of values."""

    half_axes: tuple[float, float]
    """Long and short, in the values' unit."""
    angle: float
    """Of the long axis from the first value's axis to the second's [rad]."""

    def outline(self, points: int = 181) -> "np.typing.NDArray[np.complex128]":
        """Its outline about zero, first value + i second value, closed, (points,) [unit of the values]."""
        u = np.linspace(0.0, 2.0 * np.pi, points)
        long, short = self.half_axes
        return np.asarray((long * np.cos(u) + 1j * short * np.sin(u)) * np.exp(1j * self.angle))


def coverage_factor(degrees_of_freedom: float = np.inf, level: float = LEVEL) -> float:
    """Standard uncertainties to either side within which one value lies: Student's t, normal for infinity."""
    return student_quantile(0.5 + 0.5 * level, degrees_of_freedom)


def joint_coverage_factor(dimensions: int, degrees_of_freedom: float = np.inf, level: float = LEVEL) -> float:
    """Standard uncertainties, in every direction, within which so many values lie together (chi-square, Fisher's F)."""
    if np.isinf(degrees_of_freedom):
        return float(np.sqrt(scipy.special.chdtri(dimensions, 1.0 - level)))
    return float(np.sqrt(dimensions * scipy.special.fdtri(dimensions, degrees_of_freedom, level)))


def standard_deviation_within(half_width: float, level: float = LEVEL) -> float:
    """Standard deviation of what is normally distributed and lies within +- ``half_width`` at a level."""
    return half_width / coverage_factor(np.inf, level)


def effective_degrees_of_freedom(variances: Floats, degrees_of_freedom: Floats | float) -> float:
    """Of a sum of variances (n,) [unit squared], each with its own (Welch, Satterthwaite; JCGM 100:2008, G.4.1)."""
    doubt = float(np.sum(np.square(variances) / degrees_of_freedom))
    total = float(np.sum(variances))
    return total**2 / doubt if doubt > 0.0 else np.inf


def student_quantile(probability: float, degrees_of_freedom: float = np.inf) -> float:
    """What Student's t stays below with a probability."""
    if np.isinf(degrees_of_freedom):
        return float(scipy.special.ndtri(probability))
    return float(scipy.special.stdtrit(degrees_of_freedom, probability))


def student_tail(t: Floats, degrees_of_freedom: float) -> Floats:
    """Probability that Student's t exceeds ``t`` [-], of any shape (...,)."""
    return np.asarray(scipy.special.stdtr(degrees_of_freedom, -np.asarray(t)))


def normal_quantile(probability: Floats) -> Floats:
    """What the standard normal distribution stays below with probabilities [-] of any shape (...,)."""
    return np.asarray(scipy.special.ndtri(probability))


def normal_probability(value: float) -> float:
    """Probability that the standard normal distribution stays below ``value``."""
    return float(scipy.special.ndtr(value))


def log_normal_probability(value: Floats) -> Floats:
    """Logarithm of the same, [-] of any shape (...,), exact far out in the tail."""
    return np.asarray(scipy.special.log_ndtr(value))


def chi_square_tail(chi_square: float, degrees_of_freedom: float) -> float:
    """Probability that chi-square exceeds a value."""
    return float(scipy.special.chdtrc(degrees_of_freedom, chi_square))


def f_tail(ratio: float, degrees_of_freedom: float, degrees_below: float) -> float:
    """Probability that Fisher's F, degrees of freedom of numerator and denominator, exceeds a ratio."""
    return float(scipy.special.fdtrc(degrees_of_freedom, degrees_below, ratio))


def beta_quantile(probability: float, first: float, second: float) -> float:
    """What the beta distribution stays below with a probability."""
    return float(scipy.special.betaincinv(first, second, probability))
