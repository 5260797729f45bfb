"""Stock plates: what is on the shelf to make counter-masses of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from .. import datasets
from ..errors import DataError

WEIGHED = ("name", "mass_kg", "quantity")
"""Columns of a stock that was weighed."""
DRAWN = (
    "name", "quantity", "shape", "material", "thickness_mm", "length_mm", "width_mm", "diameter_mm", "bore_mm",
    "holes_mm",
)  # fmt: skip
"""Columns of a stock as drawn; those that none of its shapes needs may be left out."""


@dataclass(frozen=True)
class Plate:
    """Plates of one mass."""

    name: str
    mass: float
    """Mass of one plate [kg]."""
    quantity: int
    """How many there are, for all sites together."""
    inertia: float | None = None
    """About the axis through its own centre of mass, normal to the plate [kg m2]; None where it is not known."""


def load(name: str | Path) -> list[Plate]:
    """Load a shipped stock by name, or a CSV file with the columns WEIGHED or DRAWN.

    Raises DataError, naming the row, for anything else.
    """
    path = datasets.find(name, "stock", ".csv")
    rows = _rows(path)
    columns = set(rows[0]) - {None} if rows else set()
    drawn = {"shape", "material", "thickness_mm"} <= columns <= set(DRAWN) and {"name", "quantity"} <= columns
    if not drawn and columns != set(WEIGHED):
        raise DataError(
            f"{path.name}: expected the columns {','.join(WEIGHED)} and at least one plate, or of plates as drawn "
            f"{','.join(DRAWN)}"
        )
    densities: Mapping[str, float] = {}
    if drawn:
        from . import materials

        densities = materials.load()
    plates = [_plate(row, f"{path.name}, plate {i}", densities) for i, row in enumerate(rows, 1)]
    if len({plate.name for plate in plates}) < len(plates):
        raise DataError(f"{path.name}: two plates have the same name; give one row with a quantity")
    return plates


def _rows(path: Path) -> list[dict[str, str]]:
    import csv

    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            return list(csv.DictReader(file, strict=True))
    except (csv.Error, UnicodeDecodeError) as error:
        raise DataError(f"{path.name}: not a CSV file in UTF-8: {error}") from error


def _plate(row: dict[str, str], where: str, densities: Mapping[str, float]) -> Plate:
    if None in row:  # what csv makes of cells beyond the last column
        raise DataError(f"{where}: more cells than columns: {row}")
    if densities:
        from . import drawnplate

        mass, inertia = drawnplate.mass_and_inertia(row, where, densities)
        row = {"name": row["name"], "quantity": row["quantity"], "mass_kg": repr(mass)}
    else:
        inertia = None
    try:
        plate = Plate(row["name"].strip(), float(row["mass_kg"]), int(row["quantity"]), inertia)
    except (TypeError, ValueError, AttributeError) as error:
        raise DataError(f"{where}: expected a name, a mass in kg and a whole quantity, found {row}") from error
    if not plate.name or not 0 < plate.mass < 1e6 or not 0 <= plate.quantity < 10_000:
        raise DataError(f"{where}: expected a name, a mass above zero and a quantity of zero or more, found {row}")
    return plate


def mass_of(names: Sequence[str], plates: Sequence[Plate]) -> float:
    """Mass of a set of plates by name [kg]. Raises DataError, listing the stock, for a name that is not in it."""
    known = {plate.name: plate.mass for plate in plates}
    if unknown := [name for name in names if name not in known]:
        raise DataError(f"no plate {unknown[0]!r} in stock: there are {', '.join(known)}")
    return sum(known[name] for name in names)
