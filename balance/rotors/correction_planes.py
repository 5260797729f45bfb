"""Correction in one plane, two planes or more.

Balanced is a rigid rotor whose unbalances and corrections have neither sum nor couple:
sum U_i + sum U_p = 0 and sum U_i z_i + sum U_p z_p = 0. Two planes do it in one way,
U_R = -sum U_i (z_i - z_L) / (z_R - z_L); one plane leaves a couple; of the many ways of more planes the one with the
least sum of squares is taken.

The graphical solution: vector polygons whose closing sides are the corrections.

About the first plane only the correction in the last one has a moment: the closing side of the polygon of U_i (z_i -
z_L) is U_R (z_R - z_L). Likewise about the last plane. The polygon of the unbalances and both corrections closes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import DataError, SizingError
from .rotor import Plane, Unbalance, unbalance_couple, unbalance_force


@dataclass(frozen=True)
class Correction:
    """Corrections of a rotor in its planes, and what they leave."""

    unbalances: tuple[Unbalance, ...]
    planes: tuple[Plane, ...]
    vectors: tuple[complex, ...]
    """Correction in each plane, mass times radius at the angle of the added mass [kg m]."""

    @property
    def after(self) -> tuple[Unbalance, ...]:
        """The unbalances with the corrections among them."""
        added = (Unbalance(p.name, u, p.at) for p, u in zip(self.planes, self.vectors, strict=True))
        return (*self.unbalances, *added)

    def force(self) -> complex:
        """Static unbalance that is left [kg m]."""
        return unbalance_force(self.after)

    def couple(self) -> complex:
        """Couple unbalance that is left, about the first plane [kg m2]."""
        return unbalance_couple(self.after, self.planes[0].at)

    def residual(self) -> float:
        """The larger of what is left of force and of couple over the rotor's span [kg m]."""
        return max(abs(self.force()), abs(self.couple()) / plane_span(self.after))

    def is_balanced(self, tol: float) -> bool:
        """Whether force and couple over the span are at most ``tol`` [kg m]."""
        return self.residual() <= tol


def correct_planes(unbalances: Sequence[Unbalance], planes: Sequence[Plane]) -> Correction:
    """The corrections in ``planes`` that balance the unbalances; in one plane, the static balance.

    Raises SizingError where there is no plane, or two planes stand in one place.
    """
    if not planes:
        raise SizingError("no correction plane is given: name at least one, with its place along the axis")
    for i, plane in enumerate(planes):
        if twin := [p.name for p in planes[:i] if p.at == plane.at]:
            raise SizingError(f"planes {twin[0]!r} and {plane.name!r} both stand at {plane.at:g} m: give one of them")
    first = planes[0].at
    if len(planes) == 1:
        vectors = [-unbalance_force(unbalances)]
    elif len(planes) == 2:
        right = -unbalance_couple(unbalances, first) / (planes[1].at - first)
        vectors = [-unbalance_force(unbalances) - right, right]
    else:
        vectors = _least(unbalances, planes)
    return Correction(tuple(unbalances), tuple(planes), tuple(vectors))


def _least(unbalances: Sequence[Unbalance], planes: Sequence[Plane]) -> list[complex]:
    """Of all corrections that leave neither force nor couple, those with the least sum of squares."""
    places = np.array([plane.at for plane in planes])
    middle, length = float(places.mean()), float(np.ptp(places))
    rows = np.array([np.ones_like(places), (places - middle) / length])
    target = -np.array([unbalance_force(unbalances), unbalance_couple(unbalances, middle) / length])
    return [complex(u) for u in np.linalg.lstsq(rows.astype(complex), target, rcond=None)[0]]


def plane_span(unbalances: Sequence[Unbalance]) -> float:
    """Largest distance along the axis between two of the unbalances [m]; 1 where all are in one plane."""
    places = [u.at for u in unbalances]
    return (max(places) - min(places)) or 1.0


def mounted_planes(plane: Plane, vector: complex) -> tuple[float, float] | None:
    """Mass [kg] and radius [m] of a correction, from the one of them that the plane gives; None if it gives neither.

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
    planes = correction.planes
    about = [planes[0], planes[-1]] if len(planes) > 1 else []
    found = []
    for plane in about:
        found.append(_moments(correction, plane.name, plane.at))
    names = tuple(u.name for u in correction.unbalances)
    given = tuple(u.vector for u in correction.unbalances)
    found.append(Polygon("Unbalances", "kg m", names, given, tuple(p.name for p in planes), correction.vectors))
    return found


def _moments(correction: Correction, name: str, about: float) -> Polygon:
    """Sides U (z - about); the correction in the plane itself has no moment and is left out."""
    given = tuple(u.vector * (u.at - about) for u in correction.unbalances)
    closing = [
        (plane.name, vector * (plane.at - about))
        for plane, vector in zip(correction.planes, correction.vectors, strict=True)
        if plane.at != about
    ]
    names = tuple(u.name for u in correction.unbalances)
    return Polygon(
        f"Moments about plane {name}", "kg m2", names, given, tuple(n for n, _ in closing), tuple(v for _, v in closing)
    )
