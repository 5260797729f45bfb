"""Reading a linkage from a TOML file; every key that is wrong is named."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import datasets
from ..errors import CounterpoiseError, DataError
from ..quantities import parse
from . import expressions
from .description import GROUND, Body, End, Gear, Joint, Linkage, Part, Place, TwoPoint
from .expressions import Expression, Point, Symbol
from .placement import Placement, placements
from .tables import entries, known_keys, needed, pair, stated, table
from .wheel_reading import positive, wheel

_TOP = {
    "title", "source", "drive", "speed", "swing", "gravity", "lengths", "links", "joints", "reduction", "two_point",
    "gears", "turns_with", "start", "printed",
}  # fmt: skip
_LINK = {"mass", "inertia", "centre", "counter_mass", "gear_counter_mass", "fixed_to", "at", "angle"}
_PLACE = {"name", "at", "radius", "bar", "radius_of_gyration", "inertia"}
_GEAR = {"body", "joint", "teeth", "disc", "wheel", "counter"}


def load(name: str | Path) -> Linkage:
    """Load a shipped linkage by name, or a TOML file."""
    path = datasets.find(name, "linkages", ".toml")
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        return from_table(content, path.stem)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DataError(f"{path.name}: not a TOML file: {error}") from error
    except CounterpoiseError as error:
        raise type(error)(f"{path.name}: {error}") from error


def from_table(content: Mapping[str, Any], name: str) -> Linkage:
    """Build a linkage from the keys of its file. Raises DataError or UnitError, naming the key that is wrong."""
    known_keys(content, _TOP, "the file")
    reader = _Reader(content)
    linkage = Linkage(
        name=name,
        title=str(content.get("title", name)),
        symbols=reader.symbols,
        bodies=reader.bodies(),
        joints={key: reader.joint(key, value) for key, value in entries(content, "joints")},
        gears={key: reader.gear(key, value) for key, value in entries(content, "gears", required=False)},
        drive=str(content["drive"]) if "drive" in content else None,
        speed=_optional(content, "speed", "angular velocity"),
        swing=_angles(content["swing"], "swing") if "swing" in content else None,
        gravity=_gravity(content.get("gravity")),
        printed=table(content.get("printed", {}), "printed"),
    )
    return _with_bodies_named(linkage, content)


def _with_bodies_named(linkage: Linkage, content: Mapping[str, Any]) -> Linkage:
    """Fill in what refers to bodies by the name of one of their links."""
    start = {linkage.body(k).name: parse(str(v), "angle") for k, v in content.get("start", {}).items()}
    reduction = {linkage.body(k).name: linkage.joint(str(v)).name for k, v in content.get("reduction", {}).items()}
    two_point = {linkage.body(k).name: _two_point(linkage, k, v) for k, v in content.get("two_point", {}).items()}
    together = tuple(
        (linkage.body(a).name, GROUND if b == GROUND else linkage.body(b).name)
        for a, b in (pair(value, "turns_with") for value in content.get("turns_with", []))
    )
    gears = {key: replace(gear, body=linkage.body(gear.body).name) for key, gear in linkage.gears.items()}
    if linkage.drive is not None:
        linkage.joint(linkage.drive)
    reduction |= {body: shaped.joints[0] for body, shaped in two_point.items()}
    return replace(linkage, start=start, reduction=reduction, two_point=two_point, turns_with=together, gears=gears)


class _Reader:
    """Reads parts of one file: knows its named lengths, and where every link sits in its body."""

    def __init__(self, content: Mapping[str, Any]) -> None:
        self.links = {name: table(value, f"links.{name}") for name, value in entries(content, "links")}
        self.symbols: dict[str, Symbol] = {
            name: stated(value, "length", f"lengths.{name}")
            for name, value in entries(content, "lengths", required=False)
        }
        self.lengths = dict(self.symbols)
        if GROUND in self.links:
            raise DataError(f"links.{GROUND}: the ground is not described, it is there")
        self.where = placements(self.links, self.point)
        self.names = self._body_names()

    def bodies(self) -> dict[str, Body]:
        """Bodies by name; their masses and inertias become symbols."""
        parts: dict[str, list[Part]] = {}
        places: dict[str, list[Place]] = {}
        gear_places: dict[str, list[Place]] = {}
        for link, keys in self.links.items():
            known_keys(keys, _LINK, f"links.{link}")
            body = self.body_of(link)
            parts.setdefault(body, []).append(self._part(link, keys))
            places.setdefault(body, []).extend(self._places(link, keys, "counter_mass"))
            gear_places.setdefault(body, []).extend(self._places(link, keys, "gear_counter_mass"))
        return {
            body: Body(body, tuple(parts[body]), tuple(places[body]), _gear_places(places[body], gear_places[body]))
            for body in parts
        }

    def joint(self, name: str, content: object) -> Joint:
        """A joint: two links, each with the pin's place, or with a point and the direction of sliding."""
        keys = dict(table(content, f"joints.{name}"))
        kind = keys.pop("kind", "revolute")
        if kind not in {"revolute", "prismatic"}:
            raise DataError(f"joints.{name}: kind is {kind!r}: expected 'revolute' or 'prismatic'")
        if len(keys) != 2:
            raise DataError(f"joints.{name}: joins {', '.join(keys) or 'nothing'}: expected two links")
        first, second = (self._end(name, link, value, kind == "revolute") for link, value in keys.items())
        if first.body == second.body:
            raise DataError(f"joints.{name}: {' and '.join(keys)} are rigidly joined: a joint between them cannot move")
        return Joint(name, kind == "revolute", (first, second))

    def gear(self, name: str, content: object) -> Gear:
        """A gear pair."""
        where, keys = f"gears.{name}", table(content, f"gears.{name}")
        known_keys(keys, _GEAR, where)
        teeth = keys.get("teeth", [1, 1])
        if not (isinstance(teeth, list) and len(teeth) == 2 and all(isinstance(z, int) and z > 0 for z in teeth)):
            raise DataError(f"{where}: teeth is {teeth!r}: expected [Z, Z*], of the body's gear and the counter-gear")
        body = str(needed(keys, "body", where))
        counter = table(keys.get("counter", {}), f"{where}.counter")
        known_keys(counter, {"at", "on", "mass", "radius_of_gyration"}, f"{where}.counter")
        pivot = self._pivot(counter, f"{where}.counter") if "at" in counter else None
        mass, gyration = (positive(counter, key, f"{where}.counter") for key in ("mass", "radius_of_gyration"))
        joint = str(keys["joint"]) if "joint" in keys else None
        return Gear(name, body, joint, (teeth[0], teeth[1]), wheel(keys, where), pivot, mass, gyration)

    def point(self, value: object, where: str) -> Point:
        """A pair of lengths."""
        x, y = pair(value, where)
        return Point(self.length(x, where), self.length(y, where))

    def length(self, text: str, where: str) -> Expression:
        """A length, of named lengths or with a unit."""
        try:
            return expressions.read(text, self.lengths)
        except CounterpoiseError as error:
            raise DataError(f"{where}: {error}") from error

    def body_of(self, link: str) -> str:
        """Name of a link's body."""
        return self.names[self.where[link].root]

    def _body_names(self) -> dict[str, str]:
        members: dict[str, list[str]] = {}
        for link in self.links:
            members.setdefault(self.where[link].root, []).append(link)
        return {root: "+".join(links) for root, links in members.items()}

    def _part(self, link: str, keys: Mapping[str, Any]) -> Part:
        where = f"links.{link}"
        self.symbols[f"m{link}"] = mass = stated(needed(keys, "mass", where), "mass", f"{where}.mass")
        if not mass.value > 0:
            raise DataError(f"{where}.mass is {keys['mass']!r}: expected a positive mass")
        if "inertia" in keys:
            self.symbols[f"I{link}"] = inertia = stated(keys["inertia"], "inertia", f"{where}.inertia")
            if not inertia.value >= 0:
                raise DataError(f"{where}.inertia is {keys['inertia']!r}: expected zero or more")
        centre = self.point(needed(keys, "centre", where), f"{where}.centre")
        return Part(link, self.where[link].of(centre), "inertia" in keys)

    def _places(self, link: str, keys: Mapping[str, Any], kind: str) -> list[Place]:
        given = keys.get(kind, [])
        tables = [given] if isinstance(given, dict) else given
        if not isinstance(tables, list):
            raise DataError(
                f"links.{link}.{kind}: expected a table such as {{ at = ['-R2', '0 m'] }}, or a list of them"
            )
        names = [link] if len(tables) == 1 else [f"{link}{chr(97 + i)}" for i in range(len(tables))]
        mark = "" if kind == "counter_mass" else "z"
        return [self._place(f"{n}{mark}", link, t, f"links.{link}.{kind}") for n, t in zip(names, tables, strict=True)]

    def _place(self, name: str, link: str, content: object, where: str) -> Place:
        keys = table(content, where)
        known_keys(keys, _PLACE, where)
        if ("at" in keys) == ("radius" in keys):
            raise DataError(f"{where}: expected either at = [x, y] or radius = '...'")
        name = str(keys.get("name", name))
        if "inertia" in keys:
            self.symbols[f"I{name}*"] = stated(keys["inertia"], "inertia", f"{where}.inertia")
        at = self.where[link].of(self.point(keys["at"], f"{where}.at")) if "at" in keys else None
        radius, bar, gyration = (
            self.length(str(keys[key]), f"{where}.{key}") if key in keys else None
            for key in ("radius", "bar", "radius_of_gyration")
        )
        return Place(name, at, radius, bar, gyration, "inertia" in keys)

    def _end(self, joint: str, link: str, value: object, revolute: bool) -> End:
        where = f"joints.{joint}.{link}"
        if link != GROUND and link not in self.links:
            raise DataError(f"{where}: no such link: there are {GROUND}, {', '.join(self.links)}")
        at = Placement(GROUND) if link == GROUND else self.where[link]
        body = GROUND if link == GROUND else self.body_of(link)
        if value == "not given":
            if link != GROUND:
                raise DataError(f"{where}: only places on the ground may be 'not given'")
            return End(body, None)
        if revolute:
            return End(body, at.of(self.point(value, where)))
        keys = table(value, where)
        known_keys(keys, {"point", "along"}, where)
        along = parse(str(needed(keys, "along", where)), "angle")
        return End(body, at.of(self.point(needed(keys, "point", where), where)), along + at.angle)

    def _pivot(self, counter: Mapping[str, Any], where: str) -> Point:
        point = self.point(counter["at"], f"{where}.at")
        link = str(needed(counter, "on", where))
        if link == GROUND:
            return point
        if link not in self.links:
            raise DataError(f"{where}.on is {link!r}: expected the link in whose frame 'at' is given")
        return self.where[link].of(point)


def _gear_places(places: list[Place], own: list[Place]) -> tuple[Place, ...]:
    """Places for counter-masses against gears: those given, or else the places of the other counter-masses."""
    return tuple(own or [replace(place, name=f"{place.name}z", printed_inertia=False) for place in places])


def _two_point(linkage: Linkage, body: str, value: object) -> TwoPoint:
    where = f"two_point.{body}"
    keys = table(value, where)
    known_keys(keys, {"joints", "reshaped"}, where)
    first, second = (linkage.joint(name).name for name in pair(needed(keys, "joints", where), f"{where}.joints"))
    reshaped = str(needed(keys, "reshaped", where))
    if reshaped not in (part.link for part in linkage.body(body).parts):
        raise DataError(f"{where}: reshaped is {reshaped!r}: expected a link of {linkage.body(body).name}")
    return TwoPoint((first, second), reshaped)


def _optional(content: Mapping[str, Any], key: str, dimension: str) -> float | None:
    return stated(content[key], dimension, key).value if key in content else None


def _angles(value: object, where: str) -> tuple[float, float]:
    first, second = (parse(text, "angle") for text in pair(value, where))
    return first, second


def _gravity(value: object) -> tuple[float, float]:
    if value is None:
        return 0.0, 0.0
    x, y = (parse(text, "acceleration") for text in pair(value, "gravity"))
    return x, y
