"""Reading gear pairs, and what a description says of real gears."""

from collections.abc import Callable, Mapping
from typing import Any

from ..errors import DataError
from .description import Gear, Wheel
from .expressions import Point
from .tables import known_keys, needed, stated, table

_GEAR = {"body", "joint", "teeth", "disc", "wheel", "counter"}
_COUNTER = {"at", "on", "mass", "radius_of_gyration"}

_DIMENSION = {"mass": "mass", "inertia": "inertia", "diameter": "length", "radius_of_gyration": "length"}


OnLink = Callable[[str, object, str], tuple[str, Point]]
"""Reads a point in a link's frame: the body that it is on, and the point in that body's frame."""


def gear(name: str, content: object, on_link: OnLink) -> Gear:
    """A gear pair. Raises DataError, naming the key that is wrong."""
    where, keys = f"gears.{name}", table(content, f"gears.{name}")
    known_keys(keys, _GEAR, where)
    teeth = keys.get("teeth", [1, 1])
    if not (isinstance(teeth, list) and len(teeth) == 2 and all(type(z) is int and z > 0 for z in teeth)):
        raise DataError(f"{where}: teeth is {teeth!r}: expected [Z, Z*], of the body's gear and the counter-gear")
    body = str(needed(keys, "body", where))
    joint = str(keys["joint"]) if "joint" in keys else None
    counter, under = table(keys.get("counter", {}), f"{where}.counter"), f"{where}.counter"
    known_keys(counter, _COUNTER, under)
    carrier, pivot = _pivot(counter, under, on_link)
    mass, gyration = (positive(counter, key, under) for key in ("mass", "radius_of_gyration"))
    if mass is not None and gyration is not None:
        raise DataError(f"{under}: mass and radius_of_gyration are both given: the inertia is known, so give one")
    return Gear(name, body, joint, (teeth[0], teeth[1]), wheel(keys, where), pivot, carrier, mass, gyration)


def _pivot(counter: Mapping[str, Any], where: str, on_link: OnLink) -> tuple[str | None, Point | None]:
    """Pivot of the counter-gear and the body that it is said to be on."""
    if ("at" in counter) != ("on" in counter):
        given, other = ("at", "on") if "at" in counter else ("on", "at")
        raise DataError(f"{where}: {given} is given and {other} is missing: expected at = [x, y] and on = 'LINK'")
    return on_link(str(counter["on"]), counter["at"], where) if "at" in counter else (None, None)


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
