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
from ..input_files import Positive, Table, Text, csv_cells, load_model, model_from_table, read_text

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
class Outline:
    """A plane figure about its own centre."""

    area: float
    """[m2]"""
    polar: float
    """Polar second moment of area about its centre [m4]."""


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

    Raises DataError for a hole beyond the outline or overlapping another: its area would count twice.
    """
    for i, hole in enumerate(holes, 1):
        if shape.clearance(hole) < -_ROUNDING:
            raise DataError(f"hole {i} is not within the plate: expected holes inside the outline that do not overlap")
        for j, other in enumerate(holes[: i - 1], 1):
            distance = math.hypot(hole.x - other.x, hole.y - other.y)
            if distance < (hole.diameter + other.diameter) / 2 - _ROUNDING:
                raise DataError(f"holes {j} and {i} overlap: expected holes apart from each other")
    outline = shape.outline()
    areas = [math.pi * hole.diameter**2 / 4.0 for hole in holes]
    area = outline.area - sum(areas)
    x = -sum(a * hole.x for a, hole in zip(areas, holes, strict=True)) / area
    y = -sum(a * hole.y for a, hole in zip(areas, holes, strict=True)) / area
    removed = sum(a * (hole.diameter**2 / 8.0 + hole.x**2 + hole.y**2) for a, hole in zip(areas, holes, strict=True))
    polar = outline.polar - removed - area * (x**2 + y**2)
    return Section(density * thickness * area, density * thickness * polar, (x, y))


_Millimetres = Annotated[float, Field(gt=0.0, lt=1e5, allow_inf_nan=False)] | None


class StockRow(Table):
    """A kind of plate, a row of the CSV: weighed (name, mass_kg, quantity), or as drawn, without a mass."""

    name: Text
    """Name of the plate, used once."""
    mass_kg: Annotated[float, Field(gt=0.0, lt=1e6, allow_inf_nan=False)] | None = None
    """Mass of one plate, weighed [kg]."""
    quantity: Annotated[int, Field(ge=0, lt=10_000)]
    """How many there are, for all sites together."""
    shape: Literal["rectangle", "disc", "ring"] | None = None
    """Outline: a rectangle has length and width, a disc a diameter, a ring a bore too."""
    material: Text | None = None
    """One of the materials whose densities are known: `balance files materials`."""
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
    holes_mm: str = ""
    """Round holes ``x y diameter; x y diameter``, from the centre of the outline [mm]."""


WEIGHED = ("name", "mass_kg", "quantity")
"""Columns of a stock that was weighed."""
DRAWN = (
    "name", "quantity", "shape", "material", "thickness_mm", "length_mm", "width_mm", "diameter_mm", "bore_mm",
    "holes_mm",
)  # fmt: skip
"""Columns of a stock as drawn; those that none of its shapes needs may be absent."""


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


def load_stock(name: str | Path) -> list[Plate]:
    """Load a shipped stock by name, or a CSV file with the columns WEIGHED or DRAWN, as spreadsheets write it.

    Raises DataError, naming the row, for anything else.
    """
    path = datasets.find_dataset(name, "stock", ".csv")
    header, rows = csv_cells(read_text(path), path.name)
    header = [cell.strip() for cell in header]
    columns = set(header)
    drawn = {"shape", "material", "thickness_mm"} <= columns <= set(DRAWN) and {"name", "quantity"} <= columns
    if not rows or (not drawn and columns != set(WEIGHED)):
        raise DataError(
            f"{path.name}: {len(rows)} plates, its columns are {', '.join(header) or 'none'}: expected at least one "
            f"plate, and the columns {','.join(WEIGHED)}, or of plates as drawn {','.join(DRAWN)}"
        )
    densities: Mapping[str, float] = load_densities() if drawn else {}
    named = [dict(zip(header, cells, strict=False)) for _, cells in rows]
    plates = [_plate(row, f"{path.name}, plate {i}", densities) for i, row in enumerate(named, 1)]
    if len({plate.name for plate in plates}) < len(plates):
        raise DataError(f"{path.name}: two plates have the same name; give one row with a quantity")
    return plates


def _plate(row: dict[str, str], where: str, densities: Mapping[str, float]) -> Plate:
    cells = {key: cell.strip() for key, cell in row.items() if cell.strip()}
    plate = model_from_table(StockRow, cells, where)
    if densities:
        mass, inertia = mass_and_inertia(plate, where, densities)
        return Plate(plate.name, mass, plate.quantity, inertia)
    if plate.mass_kg is None:
        raise DataError(f"{where}: mass_kg: missing: expected the mass of one plate in kg")
    return Plate(plate.name, plate.mass_kg, plate.quantity)


def plates_mass(names: Sequence[str], plates: Sequence[Plate]) -> float:
    """Mass of a set of plates by name [kg]. Raises DataError, listing the stock, for a name that is not in it."""
    known = {plate.name: plate.mass for plate in plates}
    if unknown := [name for name in names if name not in known]:
        raise DataError(f"no plate {unknown[0]!r} in stock: there are {', '.join(known)}")
    return sum(known[name] for name in names)


SHAPES = {
    "rectangle": ("length_mm", "width_mm"),
    "disc": ("diameter_mm",),
    "ring": ("diameter_mm", "bore_mm"),
}
"""Shapes, and the columns that each needs besides the thickness; ``holes_mm`` may be empty."""
_SIZES = ("length_mm", "width_mm", "diameter_mm", "bore_mm")
_M_PER_MM = 1e-3


def mass_and_inertia(row: StockRow, where: str, densities: Mapping[str, float]) -> tuple[float, float]:
    """Mass [kg] and inertia about the centre of mass [kg m2] of a row; ``densities`` by material [kg/m3]."""
    if row.shape is None:
        raise DataError(f"{where}: shape: missing: expected {', '.join(SHAPES)}")
    material = row.material or ""
    if material not in densities:
        near = suggestion(material, densities)
        raise DataError(f"{where}: material {material!r}: expected {', '.join(densities)}{near}")
    given = {key: getattr(row, key) for key in ("thickness_mm", *_SIZES) if getattr(row, key) is not None}
    if extra := [key for key in _SIZES if key not in SHAPES[row.shape] and key in given]:
        raise DataError(f"{where}: a {row.shape} has no {extra[0]}: leave it empty")
    if lacking := [key for key in ("thickness_mm", *SHAPES[row.shape]) if key not in given]:
        raise DataError(f"{where}: {lacking[0]} is empty: expected millimetres above zero")
    sizes = [given[key] * _M_PER_MM for key in SHAPES[row.shape]]
    if row.shape == "ring" and sizes[1] >= sizes[0]:
        raise DataError(f"{where}: bore_mm is not smaller than diameter_mm")
    shape = Rectangle(*sizes) if row.shape == "rectangle" else Ring(*sizes)
    holes = _holes(row.holes_mm, where)
    try:
        found = plate_section(shape, given["thickness_mm"] * _M_PER_MM, densities[material], holes)
    except DataError as error:
        raise DataError(f"{where}: {error}") from error
    return found.mass, found.inertia


def _holes(text: str, where: str) -> list[Hole]:
    """Holes ``x y diameter; x y diameter`` from the centre of the outline [mm]."""
    found = []
    for part in filter(str.strip, text.split(";")):
        try:
            x, y, diameter = (float(word) * _M_PER_MM for word in part.split())
        except ValueError as error:
            raise DataError(f"{where}: holes_mm {part.strip()!r}: expected 'x y diameter; x y diameter'") from error
        if not (math.isfinite(x) and math.isfinite(y) and 0.0 < diameter < math.inf):
            raise DataError(f"{where}: holes_mm {part.strip()!r}: expected a diameter above zero")
        found.append(Hole(x, y, diameter))
    return found


SHIPPED = "kiper2019"
"""The shipped materials: those of the source's plates."""
_KG_PER_M3_IN_G_PER_MM3 = 1e6


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
