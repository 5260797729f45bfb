"""Stock plates to make counter-masses of: weighed, or drawn with shape, material, thickness and holes.

Mass and inertia of a drawn plate follow from areas A in place of masses, holes counted negative (polar second moment J
about an area's own centre):
A = A_outline - sum A_i,  c = -sum A_i r_i / A,  J = J_outline - sum (J_i + A_i r_i^2) - A c^2,
m = density thickness A,  I = density thickness J  about the centre of mass.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from .. import datasets
from ..errors import DataError, suggestion
from ..input_files import FromText, NoUnderscores, Positive, Table, Text, csv_rows, load_model

_ROUNDING = 1e-9


@dataclass(frozen=True)
class Hole:
    """A round hole through a plate."""

    x: float
    """Position of its centre, from the centre of the outline [m]."""
    y: float
    diameter: float
    """[m]"""


@dataclass(frozen=True)
class Section:
    """Mass, inertia and centre of mass of a plate."""

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

    def outline(self) -> tuple[float, float]:
        """Area A = a b [m2] and polar second moment J = a b (a^2 + b^2) / 12 about its centre [m4]."""
        area = self.length * self.width
        return area, area * (self.length**2 + self.width**2) / 12.0

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

    def outline(self) -> tuple[float, float]:
        """Area A = pi (D^2 - d^2) / 4 [m2] and polar second moment J = pi (D^4 - d^4) / 32 about its centre [m4]."""
        return math.pi * (self.diameter**2 - self.bore**2) / 4.0, math.pi * (self.diameter**4 - self.bore**4) / 32.0

    def clearance(self, hole: Hole) -> float:
        """Least distance of a hole's rim from the rims; negative outside [m]."""
        radius = math.hypot(hole.x, hole.y)
        outside = self.diameter / 2 - radius
        return (min(outside, radius - self.bore / 2) if self.bore else outside) - hole.diameter / 2


def plate_section(shape: Rectangle | Ring, thickness: float, density: float, holes: Sequence[Hole] = ()) -> Section:
    """Mass, inertia and centre of a plate of ``thickness`` [m] and ``density`` [kg/m3].

    Raises DataError for a hole beyond the outline or overlapping another: its area would count twice.
    """
    for i, hole in enumerate(holes, 1):
        if shape.clearance(hole) < -_ROUNDING:
            raise DataError(f"hole {i} is not within the plate: expected holes inside the outline that do not overlap")
        for j, other in enumerate(holes[: i - 1], 1):
            distance = math.hypot(hole.x - other.x, hole.y - other.y)
            if distance < (hole.diameter + other.diameter) / 2 - _ROUNDING:
                raise DataError(f"holes {j} and {i} overlap: expected holes apart from each other")
    whole, turning = shape.outline()
    areas = [math.pi * hole.diameter**2 / 4.0 for hole in holes]
    area = whole - sum(areas)
    x = -sum(a * hole.x for a, hole in zip(areas, holes, strict=True)) / area
    y = -sum(a * hole.y for a, hole in zip(areas, holes, strict=True)) / area
    removed = sum(a * (hole.diameter**2 / 8.0 + hole.x**2 + hole.y**2) for a, hole in zip(areas, holes, strict=True))
    polar = turning - removed - area * (x**2 + y**2)
    return Section(density * thickness * area, density * thickness * polar, (x, y))


_Millimetres = Annotated[float, Field(gt=0.0, lt=1e5, allow_inf_nan=False), NoUnderscores] | None
_M_PER_MM = 1e-3
_KG_PER_M3_IN_G_PER_MM3 = 1e6
_SIZES = ("thickness_mm", "length_mm", "width_mm", "diameter_mm", "bore_mm")
SHAPES = {"rectangle": _SIZES[:3], "disc": ("thickness_mm", "diameter_mm"), "ring": (_SIZES[0], *_SIZES[3:])}
"""Shapes, and the columns that each needs."""
SHIPPED = "kiper2019"
"""The shipped materials: those of the source's plates."""


def _holes(text: str, _context: object) -> tuple[Hole, ...]:
    """Holes ``x y diameter; x y diameter`` from the centre of the outline [mm]."""
    found = []
    for part in filter(str.strip, text.split(";")):
        try:
            hole = Hole(*(float(word) * _M_PER_MM for word in part.split()))
        except (TypeError, ValueError) as error:
            raise DataError(f"{part.strip()!r}: expected 'x y diameter; x y diameter'") from error
        if not (math.isfinite(hole.x) and math.isfinite(hole.y) and 0.0 < hole.diameter < math.inf):
            raise DataError(f"{part.strip()!r}: expected a diameter above zero")
        found.append(hole)
    return tuple(found)


@dataclass(frozen=True)
class Plate:
    """A kind of plate in stock."""

    name: str
    mass: float
    """Mass of one plate [kg]."""
    quantity: int
    """How many there are, for all sites together."""
    inertia: float | None = None
    """About the axis through its own centre of mass, normal to the plate [kg m2]; None where it is not known."""


class StockRow(Table):
    """A kind of plate, a row of the CSV: weighed (name, mass_kg, quantity), or as drawn, without a mass.

    Numbers may be in other units, which the column then names: `mass_g`, `length_in`, `mass (lb)`.
    """

    name: Text
    """Name of the plate, used once."""
    mass_kg: Annotated[float, Field(gt=0.0, lt=1e6, allow_inf_nan=False), NoUnderscores] | None = None
    """Mass of one plate, weighed [kg]. A column `mass_g` in its place holds grams; likewise lengths and densities."""
    quantity: Annotated[int, Field(ge=0, lt=10_000), NoUnderscores]
    """How many there are, for all sites together."""
    shape: Literal["rectangle", "disc", "ring"] | None = None
    """Outline: a rectangle has length and width, a disc a diameter, a ring a bore too."""
    material: Text | None = None
    """One of the materials whose densities are known; shipped: 7075 aluminium 2810, steel 7830, 5000 aluminium
    2647.27 kg/m3 (`balance files materials`); any name with a density of its own."""
    density_kg_per_m3: Annotated[float, Field(gt=50.0, lt=3e4, allow_inf_nan=False), NoUnderscores] | None = None
    """Density of a plate as drawn, of a material that is not shipped [kg/m3]; 7850 for steel."""
    thickness_mm: _Millimetres = None
    """Thickness of the plate [mm]."""
    length_mm: _Millimetres = None
    """Length of a rectangle [mm]."""
    width_mm: _Millimetres = None
    """Width of a rectangle [mm]."""
    diameter_mm: _Millimetres = None
    """Diameter of a disc or ring [mm]."""
    bore_mm: _Millimetres = None
    """Bore of a ring [mm]."""
    holes_mm: Annotated[tuple[Hole, ...], FromText(_holes, "-50 0 11; 50 0 11")] = ()
    """Round holes ``x y diameter; x y diameter``, from the centre of the outline [mm], in no other unit."""

    def _check(self) -> None:
        if (self.mass_kg is None) == (self.shape is None):
            raise DataError(f"expected either mass_kg, of a plate weighed, or shape, as drawn: {', '.join(SHAPES)}")
        needed = SHAPES[self.shape] if self.shape else ()
        for key in _SIZES if self.shape else (*_SIZES, "material", "density_kg_per_m3", "holes_mm"):
            if bool(getattr(self, key)) != (key in needed):
                weighed = "is given: a plate that was weighed has no sizes, material or holes: leave it empty"
                of = f"is nothing of a {self.shape}" if self.shape else weighed
                raise DataError(f"{key} {'is empty: expected a number above zero' if key in needed else of}")
        if self.density_kg_per_m3 and (known := load_densities().get(self.material or "")):
            raise DataError(
                f"density_kg_per_m3 is given, though {self.material} has {known:g} kg/m3: leave it empty, or name the "
                "material otherwise"
            )
        if self.shape == "ring" and not (self.bore_mm or 0.0) < (self.diameter_mm or 0.0):
            raise DataError("bore_mm is not smaller than diameter_mm")
        if self.shape:
            self.plate()

    def section(self, density: float) -> Section:
        """Mass, inertia and centre of a plate as drawn, of a density [kg/m3]."""
        thickness, *sizes = (getattr(self, key) * _M_PER_MM for key in SHAPES[self.shape or ""])
        shape = Rectangle(*sizes) if self.shape == "rectangle" else Ring(*sizes)
        return plate_section(shape, thickness, density, self.holes_mm)

    def plate(self) -> Plate:
        """The plate. Raises DataError for holes that do not fit, and a material whose density is not known."""
        if self.mass_kg is not None:
            return Plate(self.name, self.mass_kg, self.quantity)
        drawn = self.section(self.density_kg_per_m3 or self._known_density())
        return Plate(self.name, drawn.mass, self.quantity, drawn.inertia)

    def _known_density(self) -> float:
        material, known = self.material or "", load_densities()
        if material not in known:
            raise DataError(
                f"material {material!r}: expected {', '.join(known)}{suggestion(material, known)}; of another material "
                "state the density in a column density_kg_per_m3"
            )
        return known[material]


def load_stock(name: str | Path) -> list[Plate]:
    """Load a shipped stock by name, or a CSV file of plates that were weighed, or as drawn.

    Raises DataError, naming the row, for anything else.
    """
    path = datasets.find_dataset(name, "stock", ".csv")
    plates = [row.plate() for row in csv_rows(StockRow, path)]
    if not plates:
        raise DataError(f"{path.name}: expected at least one plate")
    return plates


def plates_mass(names: Sequence[str], plates: Sequence[Plate]) -> float:
    """Mass of a set of plates by name [kg]. Raises DataError, listing the stock, for a name that is not in it."""
    known = {plate.name: plate.mass for plate in plates}
    if unknown := [name for name in names if name not in known]:
        raise DataError(f"no plate {unknown[0]!r} in stock: there are {', '.join(known)}")
    return sum(known[name] for name in names)


class MaterialsTable(Table):
    """Densities of materials."""

    source: str = ""
    """Where they are from."""
    density_g_per_mm3: dict[str, Annotated[Positive, Field(lt=0.1)]]
    """Densities by material [g/mm3]: steel has 0.00783."""


def load_densities(name: str | Path = SHIPPED) -> Mapping[str, float]:
    """Densities by material [kg/m3], from shipped materials by name or a TOML file with ``[density_g_per_mm3]``.

    Raises DataError, naming the material, for a density that is no number above zero.
    """
    table = load_model(MaterialsTable, datasets.find_dataset(name, "materials", ".toml"))
    return {material: density * _KG_PER_M3_IN_G_PER_MM3 for material, density in table.density_g_per_mm3.items()}
