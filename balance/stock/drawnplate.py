"""A plate as a row of a stock draws it: shape, material, dimensions in millimetres, holes."""

import math
from collections.abc import Mapping

from ..errors import DataError
from .section import Hole, Rectangle, Ring, section

SHAPES = {
    "rectangle": ("length_mm", "width_mm"),
    "disc": ("diameter_mm",),
    "ring": ("diameter_mm", "bore_mm"),
}
"""Shapes, and the columns that each needs besides the thickness; ``holes_mm`` may be empty."""
_SIZES = ("length_mm", "width_mm", "diameter_mm", "bore_mm")
_M_PER_MM = 1e-3


def mass_and_inertia(row: Mapping[str, str], where: str, densities: Mapping[str, float]) -> tuple[float, float]:
    """Mass [kg] and inertia about the centre of mass [kg m2] of a row; ``densities`` by material [kg/m3]."""
    kind, material = (row["shape"] or "").strip(), (row["material"] or "").strip()
    if kind not in SHAPES:
        raise DataError(f"{where}: shape {kind!r}: expected {', '.join(SHAPES)}")
    if material not in densities:
        raise DataError(f"{where}: material {material!r}: expected {', '.join(densities)}")
    if extra := [key for key in _SIZES if key not in SHAPES[kind] and (row.get(key) or "").strip()]:
        raise DataError(f"{where}: a {kind} has no {extra[0]}: leave it empty")
    sizes = [_metres(row.get(key), key, where) for key in SHAPES[kind]]
    if kind == "ring" and sizes[1] >= sizes[0]:
        raise DataError(f"{where}: bore_mm is not smaller than diameter_mm")
    shape = Rectangle(*sizes) if kind == "rectangle" else Ring(*sizes)
    thickness = _metres(row["thickness_mm"], "thickness_mm", where)
    holes = _holes(row.get("holes_mm") or "", where)
    try:
        found = section(shape, thickness, densities[material], holes)
    except DataError as error:
        raise DataError(f"{where}: {error}") from error
    return found.mass, found.inertia


def _metres(text: str | None, key: str, where: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not 0.0 < value < 1e5:
        raise DataError(f"{where}: {key} is {text or 'empty'}: expected millimetres above zero")
    return value * _M_PER_MM


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
