"""A rigid rotor: its unbalances, its correction planes, its bearings, and what the bearings carry at constant speed.

Vectors are complex numbers: magnitude, and angle from the rotor's mark in the sense in which its file counts.
"""

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ..errors import DataError


@dataclass(frozen=True)
class Unbalance:
    """A mass out of the axis, in one transverse plane of the rotor."""

    name: str
    vector: complex
    """Mass times radius, at its angle from the rotor's mark [kg m]."""
    at: float
    """Where along the axis [m]."""


@dataclass(frozen=True)
class Plane:
    """A plane in which correction masses may be mounted."""

    name: str
    at: float
    """Where along the axis [m]."""
    radius: float | None = None
    """Radius of the correction mass, where that is chosen [m]."""
    mass: float | None = None
    """Correction mass, where that is chosen [kg]."""


@dataclass(frozen=True)
class Rotor:
    """A rigid rotor as its file describes it."""

    name: str
    unbalances: tuple[Unbalance, ...]
    planes: tuple[Plane, ...] = ()
    bearings: tuple[float, ...] = ()
    """Where the two bearings are along the axis [m]; empty where that is not known."""
    speed: float | None = None
    """Speed of rotation [rad/s]."""
    mass: float | None = None
    """Mass of the whole rotor [kg]."""
    centre: float | None = None
    """Where its centre of mass is along the axis [m]."""
    published: Mapping[str, complex] = field(default_factory=dict)
    """Corrections by plane that the source publishes, for comparison [kg m]."""
    source: str = ""


def unbalance_force(unbalances: Sequence[Unbalance]) -> complex:
    """Sum of the unbalances: the static unbalance [kg m]. Times omega^2 it is the rotating force [N]."""
    return sum((u.vector for u in unbalances), 0j)


def unbalance_couple(unbalances: Sequence[Unbalance], about: float) -> complex:
    """Sum of unbalance times distance from ``about`` [kg m2]: the couple's unbalance, in the plane of the forces.

    The moment vector itself is a quarter turn ahead: axis x force.
    """
    return sum((u.vector * (u.at - about) for u in unbalances), 0j)


def bearing_loads(unbalances: Sequence[Unbalance], bearings: Sequence[float], speed: float) -> tuple[complex, complex]:
    """Rotating force of the unbalances on the two bearings, at angles from the rotor's mark [N].

    F_B = omega^2 sum U_i (z_i - z_A) / (z_B - z_A), F_A the rest: the couple is in it. Bearings [m], speed [rad/s].
    Raises DataError where there are not two bearings in two places.
    """
    if len(bearings) != 2 or bearings[0] == bearings[1]:
        raise DataError(f"bearings: expected two, in two places, found {', '.join(f'{z:g} m' for z in bearings)}")
    first, second = bearings
    share = [(u.at - first) / (second - first) for u in unbalances]
    right = speed**2 * sum((u.vector * s for u, s in zip(unbalances, share, strict=True)), 0j)
    left = speed**2 * sum((u.vector * (1.0 - s) for u, s in zip(unbalances, share, strict=True)), 0j)
    return left, right


def bearing_weights(mass: float, centre: float, bearings: Sequence[float], gravity: float) -> tuple[float, float]:
    """Shares of the two bearings in the weight of a horizontal rotor, fixed in space [N]."""
    first, second = bearings
    right = mass * gravity * (centre - first) / (second - first)
    return mass * gravity - right, right


def angle_deg(vector: complex) -> float:
    """Angle of a vector from the mark, 0 up to 360 [deg]; 0 for a vector of no length."""
    turned = math.degrees(cmath.phase(vector)) % 360.0
    return 0.0 if turned == 360.0 else turned + 0.0


def polar_form(vector: complex, factor: float = 1.0, digits: int = 6, unit: str = "") -> str:
    """``133.752 g @ 348.041 deg`` for people, the magnitude times ``factor``; below 1e-9 it is 0."""
    named = f" {unit}" if unit else ""
    if factor * abs(vector) < 1e-9:
        return f"0{named}"
    return f"{factor * abs(vector):.{digits}g}{named} @ {round(angle_deg(vector), 3) % 360.0:.3f} deg"


_ROUNDING = 1e-12
"""Part of a vector's magnitude in which a component is rounding."""


def vector_document(vector: complex, unit: str, factor: float = 1.0) -> dict[str, float]:
    """A vector for JSON: magnitude, angle and components, the magnitude's unit in the keys; rounding is zero."""
    least = _ROUNDING * abs(vector)
    vector = complex(*(part if abs(part) > least else 0.0 for part in (vector.real, vector.imag)))
    return {
        f"magnitude_{unit}": factor * abs(vector),
        "angle_deg": angle_deg(vector),
        f"x_{unit}": factor * vector.real,
        f"y_{unit}": factor * vector.imag,
    }
