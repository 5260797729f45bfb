"""A rigid rotor: its unbalances, its bearings, its correction planes, and the corrections that balance it in them.

Vectors are complex numbers: magnitude, and angle from the rotor's mark in the sense in which its file counts.

A rigid rotor is balanced when its unbalances and corrections have neither sum nor couple: sum U_i + sum U_p = 0 and
sum U_i z_i + sum U_p z_p = 0. In two planes there is one solution, U_R = -sum U_i (z_i - z_L) / (z_R - z_L); in one
plane the couple remains; in more planes the solution with the least sum of squares is taken.

About the first plane only the correction in the last one has a moment: the closing side of the polygon of U_i (z_i -
z_L) is U_R (z_R - z_L). Likewise about the last plane. The polygon of the unbalances and both corrections closes.
"""

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import DataError, SizingError
from ..results import Shown

NEAR = 30.0
"""Times the distance of the correction planes that a rotor's length is a finding."""
_ROUNDING = 1e-12
"""Part of a vector's magnitude in which a component is rounding."""


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


@dataclass(frozen=True)
class Correction(Shown, rows="rows", figure="balance.figures.rotating:draw_polygons"):
    """Corrections of a rotor in its planes, and the residual unbalance with them."""

    unbalances: tuple[Unbalance, ...]
    planes: tuple[Plane, ...]
    vectors: tuple[complex, ...]
    """Correction in each plane, mass times radius at the angle of the added mass [kg m]."""

    @property
    def in_planes(self) -> list[tuple[Plane, complex]]:
        """Each plane with its correction."""
        return list(zip(self.planes, self.vectors, strict=True))

    @property
    def after(self) -> tuple[Unbalance, ...]:
        """The unbalances with the corrections among them."""
        return (*self.unbalances, *(Unbalance(plane.name, u, plane.at) for plane, u in self.in_planes))

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The correction of each plane: its mass times radius, and the angle where mass is added."""
        sizes = [(plane.name, 1e3 * abs(vector), angle_deg(vector)) for plane, vector in self.in_planes]
        return [dict(zip(("plane", "correction_kg_mm", "angle_deg"), size, strict=True)) for size in sizes]

    def force(self) -> complex:
        """Residual static unbalance [kg m]."""
        return unbalance_force(self.after)

    def couple(self) -> complex:
        """Residual couple unbalance about the first plane [kg m2]."""
        return unbalance_couple(self.after, self.planes[0].at)

    def residual(self) -> float:
        """The larger of the residual force and the residual couple over the rotor's span [kg m]."""
        places = [u.at for u in self.after]
        return max(abs(self.force()), abs(self.couple()) / ((max(places) - min(places)) or 1.0))

    def is_balanced(self, tol: float) -> bool:
        """Whether force and couple over the span are at most ``tol`` [kg m]."""
        return self.residual() <= tol


def correct_planes(unbalances: Sequence[Unbalance], planes: Sequence[Plane]) -> Correction:
    """The corrections in ``planes`` that balance the unbalances; in one plane, the static balance.

    Raises SizingError where there is no plane, or two planes are in one place.
    """
    if not planes:
        raise SizingError("no correction plane is given: name at least one, with its place along the axis")
    for i, plane in enumerate(planes):
        if twin := [p.name for p in planes[:i] if p.at == plane.at]:
            raise SizingError(f"planes {twin[0]!r} and {plane.name!r} are both at {plane.at:g} m: give one of them")
    first = planes[0].at
    if len(planes) == 1:
        vectors = [-unbalance_force(unbalances)]
    elif len(planes) == 2:
        right = -unbalance_couple(unbalances, first) / (planes[1].at - first)
        vectors = [-unbalance_force(unbalances) - right, right]
    else:
        places = np.array([plane.at for plane in planes])
        middle, length = float(places.mean()), float(np.ptp(places))
        rows = np.array([np.ones_like(places), (places - middle) / length], dtype=complex)
        target = -np.array([unbalance_force(unbalances), unbalance_couple(unbalances, middle) / length])
        vectors = [complex(u) for u in np.linalg.lstsq(rows, target, rcond=None)[0]]
    return Correction(tuple(unbalances), tuple(planes), tuple(vectors))


def correction_findings(rotor: Rotor, correction: Correction) -> list[str]:
    """Planes so near each other that no couple can be corrected in them; empty where they are far enough apart."""
    planes, places = [plane.at for plane in correction.planes], [u.at for u in correction.unbalances]
    along = [*places, *planes, *rotor.bearings]
    apart, span = max(planes) - min(planes), max(along) - min(along)
    if len(planes) < 2 or apart * NEAR > span:
        return []
    names = " and ".join(plane.name for plane in correction.planes)
    largest = max(abs(vector) for vector in correction.vectors)
    return [
        f"planes {names} are {1e3 * apart:.4g} mm apart, unbalances, planes and bearings {1e3 * span:.4g} mm: against "
        f"the couple they need up to {1e3 * largest:.4g} kg mm each, and any error of these is a couple; take planes "
        "further apart"
    ]


def mass_and_radius(plane: Plane, vector: complex) -> tuple[float, float] | None:
    """Mass [kg] and radius [m] of a correction, from the one of them that the plane states; None if it states neither.

    m_b r_b = |U|: choose r_b and m_b follows, or choose m_b and r_b follows.
    """
    if plane.radius is not None and plane.mass is not None:
        raise DataError(f"plane {plane.name!r} gives both radius and mass: m_b r_b is fixed, choose one of them")
    if plane.radius is not None:
        return abs(vector) / plane.radius, plane.radius
    if plane.mass is not None:
        return plane.mass, abs(vector) / plane.mass
    return None


@dataclass(frozen=True)
class Polygon:
    """Vectors laid head to tail."""

    title: str
    unit: str
    """``kg m`` for a polygon of unbalances, ``kg m2`` for one of their moments."""
    names: tuple[str, ...]
    vectors: tuple[complex, ...]
    """Sides that are given."""
    closing_names: tuple[str, ...]
    closing: tuple[complex, ...]
    """Sides that the corrections add."""

    @property
    def vertices(self) -> tuple[complex, ...]:
        """Corners, from the origin on; the last is back at the origin where the polygon closes."""
        corners = [0j]
        for side in (*self.vectors, *self.closing):
            corners.append(corners[-1] + side)
        return tuple(corners)

    def gap(self) -> float:
        """Distance from the last corner to the first, in ``unit``."""
        return abs(self.vertices[-1])


def polygons(correction: Correction) -> list[Polygon]:
    """Of moments about the first plane, of moments about the last, and of unbalances; in one plane the last alone."""
    planes = correction.in_planes
    names = tuple(u.name for u in correction.unbalances)
    drawn = []
    for plane in [correction.planes[0], correction.planes[-1]] if len(planes) > 1 else []:
        sides = tuple(u.vector * (u.at - plane.at) for u in correction.unbalances)
        # the correction in the plane itself has no moment about it
        closing = {p.name: vector * (p.at - plane.at) for p, vector in planes if p.at != plane.at}
        title = f"Moments about plane {plane.name}"
        drawn.append(Polygon(title, "kg m2", names, sides, tuple(closing), tuple(closing.values())))
    sides = tuple(u.vector for u in correction.unbalances)
    drawn.append(
        Polygon("Unbalances", "kg m", names, sides, tuple(p.name for p in correction.planes), correction.vectors)
    )
    return drawn
