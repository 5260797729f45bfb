"""Mass and inertia of a flat plate from its outline, holes, thickness and density.

With areas A in place of masses, holes counted negative (polar second moment J about an area's own centre):
A = A_outline - sum A_i,  c = -sum A_i r_i / A,  J = J_outline - sum (J_i + A_i r_i^2) - A c^2,
m = density thickness A,  I = density thickness J  about the centre of mass.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import DataError

_ROUNDING = 1e-9


@dataclass(frozen=True)
class Hole:
    """A round hole through a plate."""

    x: float
    """Place of its centre, from the centre of the outline [m]."""
    y: float
    diameter: float
    """[m]"""


@dataclass(frozen=True)
class Outline:
    """A plane figure about its own centre."""

    area: float
    """[m2]"""
    polar: float
    """Polar second moment of area about its centre [m4]."""


@dataclass(frozen=True)
class Section:
    """What a plate of a density and thickness has."""

    mass: float
    """[kg]"""
    inertia: float
    """About the axis through its centre of mass, normal to the plate [kg m2]."""
    centre: tuple[float, float]
    """Centre of mass from the centre of the outline [m]."""

    @property
    def radius_of_gyration(self) -> float:
        """About the axis through its centre of mass, normal to the plate [m]."""
        return math.sqrt(self.inertia / self.mass)


@dataclass(frozen=True)
class Rectangle:
    """A rectangular outline."""

    length: float
    """Along x [m]."""
    width: float
    """Along y [m]."""

    def outline(self) -> Outline:
        """A = a b,  J = a b (a^2 + b^2) / 12."""
        area = self.length * self.width
        return Outline(area, area * (self.length**2 + self.width**2) / 12.0)

    def clearance(self, hole: Hole) -> float:
        """Least distance of a hole's rim from the outline; negative outside [m]."""
        along, across = self.length / 2 - abs(hole.x), self.width / 2 - abs(hole.y)
        return min(along, across) - hole.diameter / 2


@dataclass(frozen=True)
class Ring:
    """A round outline, with a bore or without."""

    diameter: float
    """[m]"""
    bore: float = 0.0
    """Diameter of the bore, zero for a disc [m]."""

    def outline(self) -> Outline:
        """A = pi (D^2 - d^2) / 4,  J = pi (D^4 - d^4) / 32."""
        return Outline(
            math.pi * (self.diameter**2 - self.bore**2) / 4.0, math.pi * (self.diameter**4 - self.bore**4) / 32.0
        )

    def clearance(self, hole: Hole) -> float:
        """Least distance of a hole's rim from the rims; negative outside [m]."""
        radius = math.hypot(hole.x, hole.y)
        outside = self.diameter / 2 - radius
        return (min(outside, radius - self.bore / 2) if self.bore else outside) - hole.diameter / 2


def plate_section(shape: Rectangle | Ring, thickness: float, density: float, holes: Sequence[Hole] = ()) -> Section:
    """Mass, inertia and centre of a plate of ``thickness`` [m] and ``density`` [kg/m3].

    Raises DataError for a hole that leaves the outline or meets another: its area would count twice.
    """
    _check(shape, holes)
    outline = shape.outline()
    areas = [math.pi * hole.diameter**2 / 4.0 for hole in holes]
    area = outline.area - sum(areas)
    x = -sum(a * hole.x for a, hole in zip(areas, holes, strict=True)) / area
    y = -sum(a * hole.y for a, hole in zip(areas, holes, strict=True)) / area
    removed = sum(a * (hole.diameter**2 / 8.0 + hole.x**2 + hole.y**2) for a, hole in zip(areas, holes, strict=True))
    polar = outline.polar - removed - area * (x**2 + y**2)
    return Section(density * thickness * area, density * thickness * polar, (x, y))


def _check(shape: Rectangle | Ring, holes: Sequence[Hole]) -> None:
    for i, hole in enumerate(holes, 1):
        if shape.clearance(hole) < -_ROUNDING:
            raise DataError(f"hole {i} leaves the plate: expected holes that lie within the outline and do not meet")
        for j, other in enumerate(holes[: i - 1], 1):
            apart = math.hypot(hole.x - other.x, hole.y - other.y)
            if apart < (hole.diameter + other.diameter) / 2 - _ROUNDING:
                raise DataError(f"holes {j} and {i} meet: expected holes that lie apart")
