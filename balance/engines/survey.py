"""Extremes of a shaking force over a turn, and what a counterweight leaves of it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from . import partial
from .peak import largest, turn
from .slidercrank import Complexes, SliderCrank

_SAMPLES = 7200


@dataclass(frozen=True)
class Extremes:
    """Over one turn [N]."""

    largest: float
    at_deg: float
    """Crank angle of the largest [deg]."""
    least: float
    rms: float
    x: tuple[float, float]
    """Least and largest component along the cylinder's axis."""
    y: tuple[float, float]
    """Least and largest component across."""


def extremes(force: Callable[[Floats], Complexes]) -> Extremes:
    """Extremes over a turn of a force, given as a function of crank angles (n,) [rad]."""
    values = force(turn(_SAMPLES))
    top, at = largest(lambda theta: np.abs(force(theta)))
    low, _ = largest(lambda theta: -np.abs(force(theta)))
    return Extremes(
        top,
        float(np.degrees(at)) % 360.0,
        -low,
        float(np.sqrt(np.mean(np.abs(values) ** 2))),
        (float(values.real.min()), float(values.real.max())),
        (float(values.imag.min()), float(values.imag.max())),
    )


def over_a_turn(crank: SliderCrank, counterweight: float, omega: float, model: partial.Model) -> Extremes:
    """Extremes of what a counterweight m_b r_b [kg m] leaves at constant speed [rad/s]."""
    return extremes(lambda theta: partial.remaining(crank, counterweight, theta, omega, model))
