"""Corrections in one plane, two planes or more; and the vector polygons of the graphical solution.

A rigid rotor is balanced when its unbalances and corrections have neither sum nor couple: sum U_i + sum U_p = 0 and
sum U_i z_i + sum U_p z_p = 0. In two planes there is one solution, U_R = -sum U_i (z_i - z_L) / (z_R - z_L); in one
plane the couple remains; in more planes the solution with the least sum of squares is taken.

About the first plane only the correction in the last one has a moment: the closing side of the polygon of U_i (z_i -
z_L) is U_R (z_R - z_L). Likewise about the last plane. The polygon of the unbalances and both corrections closes.
"""

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import DataError, SizingError
from ..results import Shown
from .rotor import Plane, Rotor, Unbalance, unbalance_couple, unbalance_force

if TYPE_CHECKING:
    import pandas

NEAR = 30.0
"""Times the distance of the correction planes that a rotor's length is a finding."""


@dataclass(frozen=True)
class Correction(Shown, figure="balance.figures.rotating:draw_polygons"):
    """Corrections of a rotor in its planes, and the residual unbalance with them."""

    unbalances: tuple[Unbalance, ...]
    planes: tuple[Plane, ...]
    vectors: tuple[complex, ...]
    """Correction in each plane, mass times radius at the angle of the added mass [kg m]."""

    @property
    def after(self) -> tuple[Unbalance, ...]:
        """The unbalances with the corrections among them."""
        added = (Unbalance(p.name, u, p.at) for p, u in self._pairs)
        return (*self.unbalances, *added)

    def table(self) -> "pandas.DataFrame":
        """The correction of each plane: its mass times radius, and the angle where mass is added."""
        import pandas

        rows = [(p.name, 1e3 * abs(u), math.degrees(cmath.phase(u)) % 360.0) for p, u in self._pairs]
        return pandas.DataFrame(rows, columns=["plane", "correction_kg_mm", "angle_deg"])

    @property
    def _pairs(self) -> list[tuple[Plane, complex]]:
        return list(zip(self.planes, self.vectors, strict=True))

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
    planes = correction._pairs
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
