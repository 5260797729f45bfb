"""Partial balance of one slider-crank by a counterweight on the crank.

The counterweight m_b r_b opposite the pin balances the rotating unbalance and a fraction c of the reciprocating one:
m_b r_b = (rotating) + c m r. The residual force is m r omega^2 (f(theta) - c e^(i theta)), f the reciprocating force.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np

from ..arrays import Complexes, Floats, root_mean_square
from ..results import Key
from . import slider_crank
from .slider_crank import SliderCrank

_GRID = 3600
"""Crank angles at which an extreme is first looked for."""
_SAMPLES = 7200
"""Crank angles of a mean square."""
Model = Literal["order1", "order2", "exact"]
MODELS: tuple[Model, ...] = ("order1", "order2", "exact")
"""First order alone; first and second; the exact motion."""
_ANGLE_DECIMALS = 5
"""Of the angle of a largest value [deg]: about a largest value, rounding of the value hides changes of the angle."""


def largest_over_turn(function: Callable[[Floats], Floats]) -> tuple[float, float]:
    """Largest value over a turn of a ``function`` of crank angles (n,) [rad], in its unit, and its angle [rad].

    Searched on ever finer grids.
    """
    theta, step = crank_angles(_GRID), 2 * np.pi / _GRID
    best = float(theta[int(np.argmax(function(theta)))])
    for _ in range(9):
        theta = best + step * np.linspace(-1.0, 1.0, 21)
        best = float(theta[int(np.argmax(function(theta)))])
        step /= 10.0
    return float(function(np.array([best]))[0]), best


def crank_angles(count: int) -> Floats:
    """So many crank angles over one turn, its end excluded, (count,) [rad]."""
    return 2 * np.pi * np.arange(count) / count


def reciprocating_force(crank: SliderCrank, theta: Floats, model: Model) -> Floats:
    """Reciprocating force by m r omega^2 at crank angles (n,) [rad], (n,) [-]."""
    if model == "exact":
        return crank.reciprocation(theta)
    orders = {k: c for k, c in slider_crank.second_order(crank).items() if model == "order2" or k == 1}
    return np.asarray(sum((c * np.exp(1j * k * np.asarray(theta))).real for k, c in orders.items()))


def residual_force(
    crank: SliderCrank, counterweight: float, theta: Floats, omega: float, model: Model = "exact"
) -> Complexes:
    """Shaking force at crank angles (n,) [rad] and constant speed [rad/s], (n,) [N].

    The ``counterweight`` m_b r_b [kg m] is opposite the pin.
    """
    inline = crank.reciprocating_mass * crank.radius * reciprocating_force(crank, theta, model)
    return omega**2 * (inline + (crank.rotating_unbalance - counterweight) * np.exp(1j * np.asarray(theta)))


def counterweight(crank: SliderCrank, fraction: float) -> float:
    """m_b r_b for the rotating unbalance and a fraction of the reciprocating one [kg m]."""
    return crank.rotating_unbalance + fraction * crank.reciprocating_mass * crank.radius


class BestCounterweight(NamedTuple):
    """The fraction whose largest shaking force is least."""

    fraction: float
    largest: float
    """Largest |F| / (m r omega^2)."""


def best_fraction(crank: SliderCrank, model: Model = "exact") -> BestCounterweight:
    """Minimise over c the largest over theta of |f - c e^(i theta)|^2 = f^2 - 2 c f cos theta + c^2, convex in c.

    Bisection on the sign of its slope, -2 f cos theta + 2 c at the theta of the largest force.
    """

    def largest(fraction: float) -> tuple[float, float]:
        def square(theta: Floats) -> Floats:
            f = reciprocating_force(crank, theta, model)
            return np.asarray(f**2 - 2.0 * fraction * f * np.cos(theta) + fraction**2)

        return largest_over_turn(square)

    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        theta = np.array([largest(middle)[1]])
        if (middle - reciprocating_force(crank, theta, model) * np.cos(theta))[0] > 0.0:
            high = middle
        else:
            low = middle
    fraction = 0.5 * (low + high)
    return BestCounterweight(fraction, float(np.sqrt(largest(fraction)[0])))


def least_rms_fraction(crank: SliderCrank) -> float:
    """The fraction of least mean square: c_1 / 2 of the exact series, a half for any cylinder without offset."""
    return slider_crank.exact_series(crank, 1)[1].real / 2.0


@dataclass(frozen=True)
class Extremes:
    """Of a shaking force over one turn [N]."""

    largest: Annotated[float, Key("F_max_N")]
    at_deg: Annotated[float, Key("F_max_at_deg")]
    """Crank angle of the largest [deg]."""
    least: Annotated[float, Key("F_min_N")]
    rms: Annotated[float, Key("F_rms_N")]
    x: Annotated[tuple[float, float], Key("Fx_N")]
    """Least and largest component along the cylinder's axis."""
    y: Annotated[tuple[float, float], Key("Fy_N")]
    """Least and largest component across."""


def residual_extremes(crank: SliderCrank, counterweight: float, omega: float, model: Model) -> Extremes:
    """Extremes of the residual force with a counterweight m_b r_b [kg m] at constant speed [rad/s]."""

    def force(theta: Floats) -> Complexes:
        return residual_force(crank, counterweight, theta, omega, model)

    values = force(crank_angles(_SAMPLES))
    top, at = largest_over_turn(lambda theta: np.abs(force(theta)))
    low, _ = largest_over_turn(lambda theta: -np.abs(force(theta)))
    return Extremes(
        top,
        round(float(np.degrees(at)), _ANGLE_DECIMALS) % 360.0,
        -low,
        root_mean_square(values),
        (float(values.real.min()), float(values.real.max())),
        (float(values.imag.min()), float(values.imag.max())),
    )
