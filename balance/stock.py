"""Stock plates: what is on the shelf to make counter-masses of."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from . import datasets
from .errors import DataError


@dataclass(frozen=True)
class Plate:
    """Plates of one mass."""

    name: str
    mass: float
    """Mass of one plate [kg]."""
    quantity: int
    """How many there are, for all sites together."""


def load(name: str | Path) -> list[Plate]:
    """Load a shipped stock by name, or a CSV file with the columns ``name,mass_kg,quantity``.

    Raises DataError, naming the row, for anything else.
    """
    import csv

    path = datasets.find(name, "stock", ".csv")
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file, strict=True))
    except (csv.Error, UnicodeDecodeError) as error:
        raise DataError(f"{path.name}: not a CSV file in UTF-8: {error}") from error
    if not rows or set(rows[0]) - {None} != {"name", "mass_kg", "quantity"}:
        raise DataError(f"{path.name}: expected the columns name,mass_kg,quantity and at least one plate")
    plates = [_plate(row, f"{path.name}, plate {i}") for i, row in enumerate(rows, 1)]
    if len({plate.name for plate in plates}) < len(plates):
        raise DataError(f"{path.name}: two plates have the same name; give one row with a quantity")
    return plates


def _plate(row: dict[str, str], where: str) -> Plate:
    if None in row:  # what csv makes of cells beyond the last column
        raise DataError(f"{where}: more cells than columns: {row}")
    try:
        plate = Plate(row["name"].strip(), float(row["mass_kg"]), int(row["quantity"]))
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
