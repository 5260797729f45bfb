"""Partial balance of one slider-crank by a counterweight on the crank.

The counterweight m_b r_b opposite the pin balances the rotating unbalance and a fraction c of the reciprocating one:
m_b r_b = (rotating) + c m r. What is left is m r omega^2 (f(theta) - c e^(i theta)), f the reciprocating force.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..arrays import Floats
from . import series
from .peak import largest
from .slidercrank import Complexes, SliderCrank

Model = Literal["order1", "order2", "exact"]
MODELS: tuple[Model, ...] = ("order1", "order2", "exact")
"""First order alone; first and second; the exact motion."""


def reciprocation(crank: SliderCrank, theta: Floats, model: Model) -> Floats:
    """Reciprocating force for m r omega^2 = 1, (n,)."""
    if model == "exact":
        return crank.reciprocation(theta)
    orders = {k: c for k, c in series.second_order(crank).items() if model == "order2" or k == 1}
    return np.asarray(sum((c * np.exp(1j * k * np.asarray(theta))).real for k, c in orders.items()))


def remaining(
    crank: SliderCrank, counterweight: float, theta: Floats, omega: float, model: Model = "exact"
) -> Complexes:
    """Shaking force at constant speed with a counterweight m_b r_b [kg m] opposite the pin, (n,) [N]."""
    inline = crank.reciprocating_mass * crank.radius * reciprocation(crank, theta, model)
    return omega**2 * (inline + (crank.rotating - counterweight) * np.exp(1j * np.asarray(theta)))


def counterweight(crank: SliderCrank, fraction: float) -> float:
    """m_b r_b for the rotating unbalance and a fraction of the reciprocating one [kg m]."""
    return crank.rotating + fraction * crank.reciprocating_mass * crank.radius


@dataclass(frozen=True)
class Best:
    """The fraction whose largest shaking force is least."""

    fraction: float
    largest: float
    """Largest |F| / (m r omega^2)."""
    slopes: tuple[float, float]
    """Slopes of the largest force just below and above: of opposite sign at the least."""

    def is_optimal(self, tol: float) -> bool:
        """Whether the largest force falls before the fraction and rises behind it."""
        return self.slopes[0] <= tol and self.slopes[1] >= -tol


def best_fraction(crank: SliderCrank, model: Model = "exact") -> Best:
    """Minimise over c the largest over theta of |f - c e^(i theta)|^2 = f^2 - 2 c f cos theta + c^2, convex in c.

    Bisection on the sign of its slope, -2 f cos theta + 2 c at the theta of the largest force.
    """
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if _slope(crank, middle, model) > 0.0:
            high = middle
        else:
            low = middle
    fraction = 0.5 * (low + high)
    step = 1e-6
    slopes = _slope(crank, fraction - step, model), _slope(crank, fraction + step, model)
    return Best(fraction, float(np.sqrt(_largest(crank, fraction, model)[0])), slopes)


def least_rms_fraction(crank: SliderCrank) -> float:
    """The fraction of least mean square: c_1 / 2 of the exact series, a half for any cylinder without offset."""
    return series.exact(crank, 1)[1].real / 2.0


def _slope(crank: SliderCrank, fraction: float, model: Model) -> float:
    theta = np.array([_largest(crank, fraction, model)[1]])
    return float(2.0 * (fraction - reciprocation(crank, theta, model) * np.cos(theta))[0])


def _largest(crank: SliderCrank, fraction: float, model: Model) -> tuple[float, float]:
    """Largest |f - c e^(i theta)|^2 and where [rad]."""
    return largest(lambda theta: _square(crank, fraction, theta, model))


def _square(crank: SliderCrank, fraction: float, theta: Floats, model: Model) -> Floats:
    f = reciprocation(crank, theta, model)
    return np.asarray(f**2 - 2.0 * fraction * f * np.cos(theta) + fraction**2)
