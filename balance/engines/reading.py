"""Engines from sheets."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .. import datasets
from ..errors import DataError
from ..rotors.rotor import Unbalance
from ..sheet import Sheet
from .engine import Cylinder, Engine
from .slidercrank import SliderCrank

DEFAULT_RATIO = 0.25
"""Crank radius over rod length where a sheet gives no sizes."""


def load(name: str | Path, ratio: float = DEFAULT_RATIO) -> Engine:
    """Load a shipped engine by name, or a TOML sheet. Raises DataError, naming the key that is wrong.

    A sheet without [slider_crank] is a layout: its engine has m r = 1 kg m, the spacing 1 m, and r / l = ``ratio``.
    """
    path = datasets.find(name, "engines", ".toml")
    return from_sheet(Sheet.load(path), ratio)


def layout(name: str | Path, ratio: float = DEFAULT_RATIO) -> Engine:
    """The same as a layout, its sizes left aside, for comparing engines."""
    sheet = Sheet.load(datasets.find(name, "engines", ".toml"))
    return _engine(sheet, _unit_crank(ratio), 1.0, keep_sizes=False)


def from_sheet(sheet: Sheet, ratio: float = DEFAULT_RATIO) -> Engine:
    """Build an engine from its sheet."""
    if "slider_crank" not in sheet:
        engine = _engine(sheet, _unit_crank(ratio), 1.0, keep_sizes=False)
    else:
        crank = slider_crank(sheet.sheet("slider_crank"))
        one = len(sheet.numbers("at")) < 2 if "at" in sheet else True
        spacing = sheet.quantity("spacing", "length", 0.0 if one else None, positive=True)
        engine = _engine(sheet, crank, spacing, keep_sizes=True)
    sheet.finish()
    return engine


def slider_crank(sheet: Sheet) -> SliderCrank:
    """Build one slider-crank from its table."""
    crank = _turning_round(
        sheet,
        sheet.quantity("crank_radius", "length", positive=True),
        sheet.quantity("rod_length", "length", positive=True),
        sheet.quantity("crank_mass", "mass", 0.0),
        sheet.quantity("crank_centre", "length", 0.0),
        sheet.quantity("crank_inertia", "inertia", 0.0),
        sheet.quantity("rod_mass", "mass", 0.0),
        sheet.quantity("rod_centre", "length", 0.0),
        sheet.quantity("rod_inertia", "inertia", 0.0),
        sheet.quantity("piston_mass", "mass"),
        sheet.quantity("offset", "length", 0.0),
    )
    for key, value in (
        ("rod_mass", crank.rod_mass),
        ("crank_mass", crank.crank_mass),
        ("piston_mass", crank.piston_mass),
        ("rod_inertia", crank.rod_inertia),
        ("crank_inertia", crank.crank_inertia),
    ):
        if value < 0.0:
            unit = "kg" if key.endswith("mass") else "kg m2"
            raise sheet.refuse(key, f"is {value:g} {unit}: expected zero or more")
    if crank.rod_mass > 0.0 and "rod_centre" not in sheet:
        raise sheet.refuse("rod_centre", "is missing: how far the rod's centre of mass is from the crank pin")
    sheet.finish()
    return crank


def _turning_round(sheet: Sheet, *sizes: float) -> SliderCrank:
    """A slider-crank; one that cannot turn right round is refused with the sheet's name."""
    try:
        return SliderCrank(*sizes)
    except DataError as error:
        raise DataError(f"{sheet.where}: {error}") from error


def _unit_crank(ratio: float) -> SliderCrank:
    if not 0.0 < ratio < 1.0:
        raise DataError(f"ratio r / l is {ratio:g}: expected more than 0 and less than 1")
    return SliderCrank(1.0, 1.0 / ratio, piston_mass=1.0)


def _engine(sheet: Sheet, crank: SliderCrank, spacing: float, keep_sizes: bool) -> Engine:
    throws = sheet.quantities("throws", "angle")
    count = len(throws)
    if not count:
        raise sheet.refuse("throws", "is empty: expected one angle for each cylinder")
    banks = sheet.quantities("banks", "angle") if "banks" in sheet else [0.0] * count
    places = sheet.numbers("at") if "at" in sheet else list(map(float, range(count)))
    for key, found in (("banks", banks), ("at", places)):
        if len(found) != count:
            raise sheet.refuse(key, f"has {len(found)} values: expected one for each of the {count} throws")
    cylinders = zip(places, throws, banks, strict=True)
    weights = [_counterweight(item, spacing) for item in sheet.sheets("counterweights")] if _has_weights(sheet) else []
    speed = sheet.maybe("speed", "angular velocity")
    return Engine(
        sheet.text("name", sheet.where.removesuffix(".toml")),
        tuple(Cylinder(z * spacing, phi, beta, crank) for z, phi, beta in cylinders),
        tuple(weights) if keep_sizes else (),
        _strokes(sheet),
        _order(sheet, count),
        speed if keep_sizes else None,
        normalised=not keep_sizes,
        source=sheet.text("source", ""),
    )


def _has_weights(sheet: Sheet) -> bool:
    if "counterweights" in sheet and "slider_crank" not in sheet:
        raise sheet.refuse("counterweights", "need [slider_crank]: a layout has no sizes to weigh them against")
    return "counterweights" in sheet


def _counterweight(sheet: Sheet, spacing: float) -> Unbalance:
    """An unbalance on the crankshaft; its place in spacings, as the cylinders'."""
    found = Unbalance(sheet.text("name"), sheet.vector("unbalance", "first moment"), spacing * sheet.number("at"))
    sheet.finish()
    return found


def _strokes(sheet: Sheet) -> int:
    strokes = sheet.number("strokes", 4)
    if strokes not in (2, 4):
        raise sheet.refuse("strokes", f"is {strokes:g}: expected 2 or 4")
    return int(strokes)


def _order(sheet: Sheet, count: int) -> tuple[int, ...]:
    if "firing_order" not in sheet:
        return ()
    numbers: Sequence[float] = sheet.numbers("firing_order")
    if sorted(numbers) != list(range(1, count + 1)):
        given = ", ".join(f"{n:g}" for n in numbers)
        raise sheet.refuse("firing_order", f"is [{given}]: expected the cylinders 1 to {count}, once each")
    return tuple(int(np.rint(n)) for n in numbers)
