"""Correction in one plane, two planes or more.

Balanced is a rigid rotor whose unbalances and corrections have neither sum nor couple:
sum U_i + sum U_p = 0 and sum U_i z_i + sum U_p z_p = 0. Two planes do it in one way,
U_R = -sum U_i (z_i - z_L) / (z_R - z_L); one plane leaves a couple; of the many ways of more planes the one with the
least sum of squares is taken.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import DataError, SizingError
from .rotor import Plane, Unbalance, couple, force


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
        return force(self.after)

    def couple(self) -> complex:
        """Couple unbalance that is left, about the first plane [kg m2]."""
        return couple(self.after, self.planes[0].at)

    def residual(self) -> float:
        """The larger of what is left of force and of couple over the rotor's span [kg m]."""
        return max(abs(self.force()), abs(self.couple()) / span(self.after))

    def is_balanced(self, tol: float) -> bool:
        """Whether force and couple over the span are at most ``tol`` [kg m]."""
        return self.residual() <= tol


def correct(unbalances: Sequence[Unbalance], planes: Sequence[Plane]) -> Correction:
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
        vectors = [-force(unbalances)]
    elif len(planes) == 2:
        right = -couple(unbalances, first) / (planes[1].at - first)
        vectors = [-force(unbalances) - right, right]
    else:
        vectors = _least(unbalances, planes)
    return Correction(tuple(unbalances), tuple(planes), tuple(vectors))


def _least(unbalances: Sequence[Unbalance], planes: Sequence[Plane]) -> list[complex]:
    """Of all corrections that leave neither force nor couple, those with the least sum of squares."""
    places = np.array([plane.at for plane in planes])
    middle, length = float(places.mean()), float(np.ptp(places))
    rows = np.array([np.ones_like(places), (places - middle) / length])
    target = -np.array([force(unbalances), couple(unbalances, middle) / length])
    return [complex(u) for u in np.linalg.lstsq(rows.astype(complex), target, rcond=None)[0]]


def span(unbalances: Sequence[Unbalance]) -> float:
    """Largest distance along the axis between two of the unbalances [m]; 1 where all are in one plane."""
    places = [u.at for u in unbalances]
    return (max(places) - min(places)) or 1.0


def mounted(plane: Plane, vector: complex) -> tuple[float, float] | None:
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
