"""Rotors from sheets: a TOML file, or the table of unbalances alone as CSV."""

import math
import re
from collections import Counter
from pathlib import Path

from .. import csvtable, datasets
from ..errors import DataError, UnitError
from ..quantities import factor_to_si
from ..sheet import Sheet
from .rotor import Plane, Rotor, Unbalance

_MODELS = {".xml", ".mjcf", ".urdf", ".sdf"}
_COLUMNS = {"mass": "mass", "radius": "length", "unbalance": "first moment", "angle": "angle", "at": "length"}
_HEADER = re.compile(r"\s*(\w+)\s*(?:\((.+)\)\s*)?")


def load(name: str | Path) -> Rotor:
    """Load a shipped rotor by name, a TOML sheet, or a CSV table of unbalances.

    Raises DataError, naming the mass and the key, for what is missing or wrong.
    """
    path = rotor_path(name)
    if path.suffix.lower() == ".csv":
        return Rotor(path.stem, tuple(read_table(path)))
    return from_sheet(Sheet.load(path), path.parent)


def rotor_path(name: str | Path) -> Path:
    """Where a rotor's sheet lies. Raises DataError for a mechanism: a linkage is no rotor."""
    path = Path(name)
    linkages = datasets.names("mechanisms", ".xml")
    if path.suffix.lower() in _MODELS or (not path.is_file() and str(name) in linkages):
        raise DataError(
            f"{name} is a mechanism: correction planes and the grades of ISO 21940-11 are for rigid rotors only, a "
            "linkage's shaking force does not turn with a shaft; use 'balance size' or 'balance linkage'"
        )
    return datasets.find(name, "rotors", ".toml", ".csv")


def from_sheet(sheet: Sheet, folder: Path) -> Rotor:
    """Build a rotor from its sheet; ``folder`` is where a table of masses is looked for."""
    if {"runs", "coefficients"} & set(sheet.keys()):
        raise DataError(f"{sheet.where} is a sheet of trial runs: use 'balance rotor influence'")
    name, source = sheet.text("name", sheet.where.removesuffix(".toml")), sheet.text("source", "")
    if isinstance(sheet.value("masses"), str):
        unbalances = read_table(folder / sheet.text("masses"))
    else:
        unbalances = [_unbalance(item) for item in sheet.sheets("masses")]
    planes = [_plane(item) for item in sheet.sheets("planes")] if "planes" in sheet else []
    bearings = sheet.quantities("bearings", "length") if "bearings" in sheet else []
    if bearings and (len(bearings) != 2 or bearings[0] == bearings[1]):
        raise sheet.refuse("bearings", f"is {sheet.value('bearings')!r}: expected two, in two places")
    published = sheet.sheet("published") if "published" in sheet else Sheet({}, sheet.where)
    printed = {key: published.vector(key, "first moment") for key in published.keys()}  # noqa: SIM118
    for key in printed:
        if key not in {plane.name for plane in planes}:
            raise published.refuse(key, "is no plane of this rotor")
    rotor = Rotor(
        name,
        tuple(unbalances),
        tuple(planes),
        tuple(bearings),
        sheet.maybe("speed", "angular velocity"),
        sheet.maybe("mass", "mass"),
        sheet.maybe("centre", "length", positive=False),
        printed,
        source,
    )
    sheet.finish()
    return rotor


def _unbalance(sheet: Sheet) -> Unbalance:
    """One mass: either mass and radius, or their product; its angle and place are required."""
    name = sheet.text("name")
    if "unbalance" in sheet:
        product = _not_negative(sheet, "unbalance", "first moment")
    else:
        product = sheet.quantity("mass", "mass") * _not_negative(sheet, "radius", "length")
    turned, at = sheet.quantity("angle", "angle"), sheet.quantity("at", "length")
    sheet.finish()
    return Unbalance(name, product * complex(math.cos(turned), math.sin(turned)), at)


def _not_negative(sheet: Sheet, key: str, dimension: str) -> float:
    """A quantity of zero or more. A mass may be negative: a hole; a radius or an unbalance has its angle."""
    found = sheet.quantity(key, dimension)
    if found < 0.0:
        raise sheet.refuse(
            key, f"is {sheet.value(key)!r}: expected zero or more; turn the angle by 180 degrees instead"
        )
    return found


def _plane(sheet: Sheet) -> Plane:
    name, at = sheet.text("name"), sheet.quantity("at", "length")
    plane = Plane(name, at, sheet.maybe("radius", "length"), sheet.maybe("mass", "mass"))
    sheet.finish()
    if plane.radius is not None and plane.mass is not None:
        raise DataError(f"{sheet.where}: gives both radius and mass: m_b r_b is fixed, choose one of them")
    return plane


def read_table(path: Path) -> list[Unbalance]:
    """Read unbalances from a CSV with the columns ``name, mass (kg), radius (mm), angle (deg), at (mm)``.

    Units stand in the header; ``unbalance (kg mm)`` may stand for mass and radius.
    """
    header, rows = csvtable.read(path, "masses")
    columns = _columns(header, path.name)
    if not rows:
        raise DataError(f"{path.name}: holds no masses")
    found = [_row(row, columns, len(header), f"{path.name}, line {line}") for line, row in rows]
    if again := [name for name, times in Counter(mass.name for mass in found).items() if times > 1]:
        raise DataError(f"{path.name}: mass {again[0]!r} is there twice: give each a name of its own")
    return found


def _columns(header: list[str], where: str) -> dict[str, tuple[int, float]]:
    """Position of each column and the factor of its unit to SI."""
    found: dict[str, tuple[int, float]] = {}
    for position, cell in enumerate(header):
        match = _HEADER.fullmatch(cell)
        name, unit = (match[1], match[2]) if match else (cell, None)
        if name in found or name not in {"name", *_COLUMNS}:
            raise DataError(
                f"{where}: column {cell!r} is not expected: there are name, {', '.join(_COLUMNS)}, once each"
            )
        if name != "name" and not unit:
            raise DataError(f"{where}: column {cell!r} has no unit: write for example 'radius (mm)'")
        try:
            found[name] = (position, 1.0 if name == "name" else factor_to_si(unit or "", _COLUMNS[name]))
        except UnitError as error:
            raise DataError(f"{where}: column {cell!r}: {error}") from error
    wanted = {"angle", "at"} | ({"unbalance"} if "unbalance" in found else {"mass", "radius"})
    if missing := sorted(wanted - set(found)):
        raise DataError(
            f"{where}: no column {missing[0]!r}: expected name, mass (kg), radius (mm), angle (deg), at (mm)"
        )
    return found


def _row(row: list[str], columns: dict[str, tuple[int, float]], width: int, where: str) -> Unbalance:
    name = (row[columns["name"][0]].strip() if "name" in columns and columns["name"][0] < len(row) else "") or where
    values: dict[str, float] = {}
    if len(row) > width and any(cell.strip() for cell in row[width:]):
        raise DataError(f"{where}: {len(row)} cells, the header has {width} columns: is there a comma in a number?")
    for column, (position, factor) in columns.items():
        if column == "name":
            continue
        cell = row[position].strip() if position < len(row) else ""
        if not cell:
            raise DataError(f"{where}: mass {name!r} has no {column}: a rotor is not computed without it")
        try:
            values[column] = float(cell) * factor
        except ValueError:
            values[column] = math.nan
        if not math.isfinite(values[column]):
            raise DataError(f"{where}: {column} of mass {name!r} is {cell!r}: expected a number")
        if values[column] < 0.0 and column in {"radius", "unbalance"}:
            raise DataError(
                f"{where}: {column} of mass {name!r} is {cell!r}: expected zero or more; turn the angle by 180 degrees"
            )
    product = values["unbalance"] if "unbalance" in values else values["mass"] * values["radius"]
    return Unbalance(name, product * complex(math.cos(values["angle"]), math.sin(values["angle"])), values["at"])
