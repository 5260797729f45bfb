"""Reading where counter-masses may go."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from ..errors import DataError
from .description import Body, Place
from .expressions import Expression, Point, Symbol
from .placement import Placement
from .tables import known_keys, pair, stated, table

_PLACE = {"name", "at", "radius", "bar", "radius_of_gyration", "inertia"}
_SHAPES = ("bar", "radius_of_gyration", "inertia")

Length = Callable[[object, str], Expression]
"""Reads a length, of named lengths or with a unit."""


def places(link: str, given: object, kind: str, length: Length, frame: Placement) -> list[tuple[Place, Symbol | None]]:
    """Places of one link in its body's frame, each with the inertia that is given for its counter-mass [kg m2]."""
    tables = [given] if isinstance(given, dict) else given
    if not isinstance(tables, list):
        raise DataError(f"links.{link}.{kind}: expected a table such as {{ at = ['-R2', '0 m'] }}, or a list of them")
    names = [link] if len(tables) == 1 else [f"{link}{chr(97 + i)}" for i in range(len(tables))]
    mark = "" if kind == "counter_mass" else "z"
    return [
        _place(f"{name}{mark}", content, f"links.{link}.{kind}", length, frame)
        for name, content in zip(names, tables, strict=True)
    ]


def for_gears(own: Sequence[Place], given: Sequence[Place]) -> tuple[Place, ...]:
    """Places for counter-masses against gears: those given, or else the places of the other counter-masses."""
    return tuple(given or [replace(place, name=f"{place.name}z", printed_inertia=False) for place in own])


def check_sizes(place: Place, values: Mapping[str, float], where: str) -> None:
    """Raise DataError for a radius or a bar of no length or less, or a radius of gyration below zero."""
    for key, size in (("radius", place.radius), ("bar", place.bar), ("radius_of_gyration", place.gyration)):
        if size is not None and (size.at(values) < 0 or (size.at(values) == 0 and size is not place.gyration)):
            raise DataError(f"{where}.{key} is {size.at(values):.6g} m: expected more than zero")


def check_differ(bodies: Iterable[Body]) -> None:
    """Raise DataError for two counter-masses of one name: only one of them would be among the results."""
    seen: dict[str, str] = {}
    for body in bodies:
        for place in (*body.places, *body.gear_places):
            if place.name in seen:
                raise DataError(
                    f"counter-masses on {seen[place.name]} and {body.name} are both named {place.name!r}: give one of "
                    "them another name = '...'"
                )
            seen[place.name] = body.name


def _place(name: str, content: object, where: str, length: Length, frame: Placement) -> tuple[Place, Symbol | None]:
    keys = table(content, where)
    known_keys(keys, _PLACE, where)
    if ("at" in keys) == ("radius" in keys):
        raise DataError(f"{where}: expected either at = [x, y] or radius = '...'")
    if len(shapes := [key for key in _SHAPES if key in keys]) > 1:
        raise DataError(f"{where}: {' and '.join(shapes)} are both given: expected one of {', '.join(_SHAPES)}")
    inertia = stated(keys["inertia"], "inertia", f"{where}.inertia") if "inertia" in keys else None
    if inertia is not None and not inertia.value >= 0:
        raise DataError(f"{where}.inertia is {keys['inertia']!r}: expected zero or more")
    at = None
    if "at" in keys:
        x, y = (length(text, f"{where}.at") for text in pair(keys["at"], f"{where}.at"))
        at = frame.of(Point(x, y))
    radius, bar, gyration = (
        length(keys[key], f"{where}.{key}") if key in keys else None for key in ("radius", "bar", "radius_of_gyration")
    )
    return Place(str(keys.get("name", name)), at, radius, bar, gyration, inertia is not None), inertia
