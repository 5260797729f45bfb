"""Intervals and regions of a vector from the covariance of its parts, and back. All are of 95 %."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, f, t

from .arrays import Floats
from .rotors.moduli import Complexes


@dataclass(frozen=True)
class Interval:
    """Half widths of the 95 % intervals of a vector's magnitude and angle."""

    magnitude: float
    """In the vector's unit."""
    angle: float
    """At most pi, where the vector is not told from none [rad]."""


@dataclass(frozen=True)
class Region:
    """Ellipse about a vector that holds the true one with 95 %."""

    half_axes: tuple[float, float]
    """Long and short, in the vector's unit."""
    angle: float
    """Of the long axis, counted as the vector's own [rad]."""

    def outline(self, points: int = 181) -> Complexes:
        """Its outline about zero, closed, (points,)."""
        u = np.linspace(0.0, 2.0 * np.pi, points)
        long, short = self.half_axes
        found: Complexes = (long * np.cos(u) + 1j * short * np.sin(u)) * np.exp(1j * self.angle)
        return found


def of_reading(value: complex, along: float, across: float) -> Floats:
    """Covariance of a reading's parts from the half widths of its 95 % intervals along and across it, (2, 2)."""
    c, s = (value.real / abs(value), value.imag / abs(value)) if value else (1.0, 0.0)
    turn = np.array([[c, -s], [s, c]])
    spread: Floats = turn @ np.diag(np.square([along, across]) / two_sided(np.inf) ** 2) @ turn.T
    return spread


def interval(value: complex, covariance: Floats, spare: float = np.inf) -> Interval:
    """Intervals of a vector's magnitude and angle from the covariance of its parts (2, 2)."""
    u = np.array([value.real, value.imag]) / abs(value) if value else np.array([1.0, 0.0])
    reach = two_sided(spare)
    along = reach * float(np.sqrt(u @ covariance @ u))
    across = reach * float(np.sqrt(np.array([-u[1], u[0]]) @ covariance @ np.array([-u[1], u[0]])))
    told = max(along, across) < abs(value)
    return Interval(along, float(np.arcsin(across / abs(value))) if told else np.pi)


def region(covariance: Floats, spare: float = np.inf) -> Region:
    """Ellipse of 95 % from the covariance of a vector's parts (2, 2)."""
    values, axes = np.linalg.eigh(covariance)
    short, long = all_round(spare) * np.sqrt(np.maximum(values, 0.0))
    return Region((float(long), float(short)), float(np.arctan2(axes[1, 1], axes[0, 1])))


def all_round(spare: float) -> float:
    """Standard deviations within which both parts of a vector lie with 95 %."""
    return float(np.sqrt(chi2.ppf(0.95, 2) if np.isinf(spare) else 2.0 * f.ppf(0.95, 2, spare)))


def deviation(within: float) -> float:
    """Standard deviation of what lies within so much with 95 %."""
    return within / two_sided(np.inf)


def two_sided(spare: float) -> float:
    """Standard deviations within which one part lies with 95 %."""
    return float(t.ppf(0.975, spare))
