"""Reading what a description says of real gears."""

from collections.abc import Mapping
from typing import Any

from ..errors import DataError
from .description import Wheel
from .tables import known_keys, stated, table

_DIMENSION = {"mass": "mass", "inertia": "inertia", "diameter": "length", "radius_of_gyration": "length"}


def wheel(keys: Mapping[str, Any], where: str) -> Wheel | None:
    """The real gear on a body, as a disc or with mass and inertia; None where nothing is given."""
    if "disc" in keys and "wheel" in keys:
        raise DataError(f"{where}: expected either disc or wheel, not both")
    if "disc" in keys:
        disc = table(keys["disc"], f"{where}.disc")
        known_keys(disc, {"mass", "diameter"}, f"{where}.disc")
        mass, diameter = (positive(disc, key, f"{where}.disc") for key in ("mass", "diameter"))
        if mass is None or diameter is None:
            raise DataError(f"{where}.disc: expected the mass that a disc of some diameter has, and that diameter")
        return Wheel(mass, 0.0, diameter)
    if "wheel" not in keys:
        return None
    wheel = table(keys["wheel"], f"{where}.wheel")
    known_keys(wheel, {"mass", "inertia"}, f"{where}.wheel")
    mass, inertia = (positive(wheel, key, f"{where}.wheel") for key in ("mass", "inertia"))
    if mass is None or inertia is None:
        raise DataError(f"{where}.wheel: expected the mass and the inertia of the gear on the body")
    return Wheel(mass, inertia)


def positive(keys: Mapping[str, Any], key: str, where: str) -> float | None:
    """A positive quantity in SI, None where it is not given. Raises DataError for another."""
    if key not in keys:
        return None
    value = stated(keys[key], _DIMENSION[key], f"{where}.{key}").value
    if not value > 0:
        raise DataError(f"{where}.{key} is {keys[key]!r}: expected more than zero")
    return value
