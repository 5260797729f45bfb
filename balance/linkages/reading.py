"""Reading a linkage from a TOML file; every key that is wrong is named."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import datasets
from ..errors import CounterpoiseError, DataError, UnitError
from ..quantities import parse
from . import expressions
from .description import GROUND, Body, End, Gear, Joint, Linkage, Part, Place, TwoPoint
from .expressions import Expression, Point, Symbol
from .gear_reading import gear
from .place_reading import check_differ, check_sizes, for_gears, places
from .placement import Placement, placements
from .tables import entries, known_keys, needed, pair, stated, table

_TOP = {
    "title", "source", "drive", "speed", "swing", "gravity", "lengths", "links", "joints", "reduction", "two_point",
    "gears", "turns_with", "start", "printed",
}  # fmt: skip
_LINK = {"mass", "inertia", "centre", "counter_mass", "gear_counter_mass", "fixed_to", "at", "angle"}
RESERVED = {GROUND: "the ground is not described, it is there", "base": "the name of the frame that all stands on"}
"""Names that no link can have, and why."""


def load_linkage(name: str | Path) -> Linkage:
    """Load a shipped linkage by name, or a TOML file. Raises DataError or ModelError, naming the key."""
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
        swing=_swing(content["swing"]) if "swing" in content else None,
        gravity=_gravity(content.get("gravity")),
        printed=table(content.get("printed", {}), "printed"),
    )
    return _with_bodies_named(linkage, content)


def _with_bodies_named(linkage: Linkage, content: Mapping[str, Any]) -> Linkage:
    """Fill in what refers to bodies by the name of one of their links."""
    start = {linkage.body(k).name: stated(v, "angle", f"start.{k}").value for k, v in content.get("start", {}).items()}
    reduction = {linkage.body(k).name: linkage.joint(str(v)).name for k, v in content.get("reduction", {}).items()}
    two_point = {linkage.body(k).name: _two_point(linkage, k, v) for k, v in content.get("two_point", {}).items()}
    together = tuple(
        (linkage.body(a).name, GROUND if b == GROUND else linkage.body(b).name)
        for a, b in (pair(value, "turns_with") for value in content.get("turns_with", []))
    )
    gears = {key: replace(pair, body=linkage.body(pair.body).name) for key, pair in linkage.gears.items()}
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
        for name in RESERVED.keys() & self.links.keys():
            raise DataError(f"links.{name}: {RESERVED[name]}")
        _check_names(self.lengths)
        self.where = placements(self.links, self.point)
        self.names = self._body_names()

    def bodies(self) -> dict[str, Body]:
        """Bodies by name; their masses and inertias become symbols."""
        parts: dict[str, list[Part]] = {}
        own: dict[str, list[Place]] = {}
        gear_places: dict[str, list[Place]] = {}
        for link, keys in self.links.items():
            known_keys(keys, _LINK, f"links.{link}")
            body = self.body_of(link)
            parts.setdefault(body, []).append(self._part(link, keys))
            own.setdefault(body, []).extend(self._places(link, keys, "counter_mass"))
            gear_places.setdefault(body, []).extend(self._places(link, keys, "gear_counter_mass"))
        found = {
            body: Body(body, tuple(parts[body]), tuple(own[body]), for_gears(own[body], gear_places[body]))
            for body in parts
        }
        check_differ(found.values())
        return found

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
        return gear(name, content, self._on_link)

    def point(self, value: object, where: str) -> Point:
        """A pair of lengths."""
        x, y = pair(value, where)
        return Point(self.length(x, where), self.length(y, where))

    def length(self, text: object, where: str) -> Expression:
        """A length, of named lengths or with a unit."""
        if not isinstance(text, str):
            raise DataError(f"{where} is {text!r}: expected a text such as 'L2/2 + 10 mm'")
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
        found = places(link, keys.get(kind, []), kind, self.length, self.where[link])
        self.symbols |= {f"I{place.name}*": inertia for place, inertia in found if inertia is not None}
        values = {name: symbol.value for name, symbol in self.lengths.items()}
        for place, _ in found:
            check_sizes(place, values, f"links.{link}.{kind}")
        return [place for place, _ in found]

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
        along = stated(needed(keys, "along", where), "angle", f"{where}.along").value
        return End(body, at.of(self.point(needed(keys, "point", where), where)), along + at.angle)

    def _on_link(self, link: str, value: object, where: str) -> tuple[str, Point]:
        """A point in the frame of a link or of the ground, and the body that it is on, in its frame."""
        point = self.point(value, f"{where}.at")
        if link == GROUND:
            return GROUND, point
        if link not in self.links:
            raise DataError(f"{where}.on is {link!r}: expected the link in whose frame 'at' is given")
        return self.body_of(link), self.where[link].of(point)


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


def _check_names(lengths: Mapping[str, Symbol]) -> None:
    """Raise DataError for a length whose name is a unit: 2 m would be twice it, silently."""
    for name in lengths:
        try:
            parse(f"1 {name}", "length")
        except UnitError:
            continue
        raise DataError(f"lengths.{name}: the name is a unit of length: give it another")


def _swing(value: object) -> tuple[float, float]:
    first, second = (stated(text, "angle", "swing").value for text in pair(value, "swing"))
    if first == second:
        raise DataError(f"swing is {value!r}: both ends are the same angle, so nothing would move")
    return first, second


def _gravity(value: object) -> tuple[float, float]:
    if value is None:
        return 0.0, 0.0
    x, y = (stated(text, "acceleration", "gravity").value for text in pair(value, "gravity"))
    return x, y
