"""Linkage files (``datasets/linkages``): links, joints, places for counter-masses, gears, what a source publishes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Discriminator, Field, Tag

from .. import datasets
from ..errors import DataError, UnitError
from ..input_files import Count, FromText, OneOrMore, Quantity, Table, Text, in_file, model_from_table, read_toml
from ..units import parse
from . import expressions
from .expressions import ORIGIN, Expression, Point, Symbol
from .linkage import (
    GROUND,
    Body,
    Disc,
    End,
    Gear,
    Joint,
    Linkage,
    Name,
    Part,
    Place,
    PositiveLength,
    PositiveMass,
    Published,
    TwoPoint,
    Wheel,
)

RESERVED = {GROUND: "the ground needs no description", "base": "the name of the frame of the base"}
"""Names that no link can have, and why."""


class _Stated(Quantity):
    """A quantity as written, with the rounding of its last digit."""

    def parse(self, text: str, _context: object = None) -> Symbol:
        """The text as a symbol. Raises UnitError."""
        super().parse(text)
        return expressions.symbol(text, self.dimensions[0])


def _size(text: str, lengths: Mapping[str, Symbol], or_zero: bool = False) -> Expression:
    """A length above zero, ``or_zero``, with the named lengths as stated."""
    found = expressions.read_length(text, lengths)
    size = found.at({name: symbol.value for name, symbol in lengths.items()})
    if not size > 0.0 and not (or_zero and size == 0.0):
        raise UnitError(f"{text!r} is {size:.6g} m: expected more than zero")
    return found


def _without_units(lengths: dict[str, Symbol]) -> dict[str, Symbol]:
    """Refuse a length whose name is a unit: 2 m would be twice it, silently."""
    for name in lengths:
        try:
            parse(f"1 {name}", "length")
        except UnitError:
            continue
        raise ValueError(f"the name {name!r} is a unit of length: give it another")
    return lengths


Length = Annotated[Expression, FromText(expressions.read_length, "L2/2 + 10 mm", ("length",))]
Size = Annotated[Expression, FromText(_size, "L2/2 + 10 mm", ("length",))]
SizeOrZero = Annotated[Expression, FromText(partial(_size, or_zero=True), "L2/2 + 10 mm", ("length",))]


def _not_reserved(links: object) -> object:
    for name in RESERVED.keys() & links.keys() if isinstance(links, dict) else ():
        raise ValueError(f"{name!r} is no name for a link: {RESERVED[name]}")
    return links


Lengths = Annotated[dict[str, Annotated[Symbol, _Stated("length")]], AfterValidator(_without_units)]
PlanePoint = tuple[Length, Length]
Angle = Annotated[float, Quantity("angle")]
Acceleration = Annotated[float, Quantity("acceleration")]
StatedInertia = Annotated[Symbol, _Stated("inertia", at_least=0.0)]
Teeth = tuple[Annotated[Count, Field(gt=0)], Annotated[Count, Field(gt=0)]]


class PlaceTable(Table):
    """Where a counter-mass may go: at a point, or at a radius from the body's joint, on the side that needs it."""

    name: Name | None = None
    """Name of the counter-mass; that of its link where it is left out."""
    at: PlanePoint | None = None
    """Point in the link's frame [m]."""
    radius: Size | None = None
    """Distance from the body's joint, in place of a point [m]."""
    bar: Size | None = None
    """Its length, where it is made as a homogeneous bar [m]."""
    radius_of_gyration: SizeOrZero | None = None
    """Its radius of gyration about its own centre of mass [m]."""
    inertia: StatedInertia | None = None
    """Its inertia about its own centre of mass, whatever its mass [kg m2]."""

    def _check(self) -> None:
        if (self.at is None) == (self.radius is None):
            raise DataError("expected either at = [x, y] or radius = '...'")
        shapes = ("bar", "radius_of_gyration", "inertia")
        if len(given := [key for key in shapes if getattr(self, key) is not None]) > 1:
            raise DataError(f"{' and '.join(given)} are both given: expected one of {', '.join(shapes)}")


class LinkTable(Table):
    """A link; its frame has its x axis along the link."""

    mass: Annotated[Symbol, _Stated("mass", above=0.0)]
    """Mass of the link [kg]."""
    inertia: StatedInertia | None = None
    """Inertia about its own centre of mass; a link that only translates needs none [kg m2]."""
    centre: PlanePoint
    """Centre of mass in the link's frame, [x, y] [m]."""
    counter_mass: Annotated[tuple[PlaceTable, ...], OneOrMore] = ()
    """Places for counter-masses against its own mass and those that it receives."""
    gear_counter_mass: Annotated[tuple[PlaceTable, ...], OneOrMore] = ()
    """Places for counter-masses against the masses of gears."""
    fixed_to: Name | None = None
    """Link that it is rigidly joined to."""
    at: PlanePoint | None = None
    """Origin of its frame in that of the link that it is fixed to [m]."""
    angle: Angle | None = None
    """Angle of its frame in that of the link that it is fixed to [rad]."""

    def _check(self) -> None:
        if self.fixed_to is None and (idle := [key for key in ("at", "angle") if getattr(self, key) is not None]):
            raise DataError(f"{idle[0]} is for a link that is fixed_to another")


class SlideTable(Table):
    """A line of sliding on a link or on the ground."""

    point: PlanePoint
    """A point of the line in the link's frame [m]."""
    along: Angle
    """Direction of sliding in the link's frame [rad]."""


def _given(place: type) -> BeforeValidator:
    """A place on the ground may be ``not given``."""
    known: Any = place | Literal["not given"]
    return BeforeValidator(lambda value: None if value == "not given" else value, json_schema_input_type=known)


class _JointTable(Table):
    model_config = ConfigDict(extra="allow")

    @property
    def ends(self) -> dict[str, Any]:
        """Place of the joint on each of its links."""
        return self.__pydantic_extra__ or {}

    def _check(self) -> None:
        if len(self.ends) != 2:
            raise DataError(f"joins {', '.join(self.ends) or 'nothing'}: expected two links")
        for link, end in self.ends.items():
            if end is None and link != GROUND:
                raise DataError(f"{link}: only places on the ground may be 'not given'")


class RevoluteTable(_JointTable):
    """A revolute joint: under the name of each of its two links the pin's place, or ``not given`` on the ground."""

    kind: Literal["revolute"] = "revolute"
    """``revolute`` or ``prismatic``."""
    __pydantic_extra__: dict[str, Annotated[PlanePoint | None, _given(PlanePoint)]]


class PrismaticTable(_JointTable):
    """A prismatic joint: under the name of each of its two links a line of sliding (linkage: slide)."""

    kind: Literal["prismatic"]
    """``revolute`` or ``prismatic``."""
    __pydantic_extra__: dict[str, Annotated[SlideTable | None, _given(SlideTable)]]


JointTable = Annotated[
    Annotated[RevoluteTable, Tag("revolute")] | Annotated[PrismaticTable, Tag("prismatic")],
    Discriminator(lambda value: value.get("kind", "revolute") if isinstance(value, dict) else "revolute"),
]


class CounterGearTable(Table):
    """The counter-gear."""

    at: PlanePoint | None = None
    """Its pivot in the frame of the link that it is on [m]; left out: at the joint by which that link is reduced."""
    on: Name | None = None
    """Link that its pivot is on, or ``ground``."""
    mass: PositiveMass | None = None
    """Its mass [kg]."""
    radius_of_gyration: PositiveLength | None = None
    """Its radius of gyration, in place of its mass [m]."""

    def _check(self) -> None:
        if (self.at is None) != (self.on is None):
            given, other = ("at", "on") if self.on is None else ("on", "at")
            raise DataError(f"{given} is given and {other} is missing: expected at = [x, y] and on = 'LINK'")
        if self.mass is not None and self.radius_of_gyration is not None:
            raise DataError("mass and radius_of_gyration are both given: the inertia is known, so give one")


class GearTable(Table):
    """A gear pair: a gear on a body drives a counter-gear the other way."""

    body: Name
    """Link that the gear is fixed to."""
    joint: Name | None = None
    """Revolute joint that it sits at; the body's reduction joint where it is left out."""
    teeth: Teeth = (1, 1)
    """Teeth of the body's gear and of the counter-gear, [Z, Z*]."""
    disc: Disc | None = None
    """The gear on the body as a disc."""
    wheel: Wheel | None = None
    """The gear on the body with mass and inertia."""
    counter: CounterGearTable = CounterGearTable()
    """The gear that turns the other way."""

    def _check(self) -> None:
        if self.disc is not None and self.wheel is not None:
            raise DataError("expected either disc or wheel, not both")


class LinkageTable(Table):
    """A planar linkage and what may be done to balance it."""

    title: Text | None = None
    """Title of the linkage."""
    source: str = ""
    """Where it is from."""
    drive: Name | None = None
    """Driven joint."""
    speed: Annotated[float, Quantity("angular velocity")] | None = None
    """Mean speed of the driven joint [rad/s]."""
    swing: tuple[Angle, Angle] | None = None
    """Ends of the driven joint's motion where it makes no full turns [rad]."""
    gravity: tuple[Acceleration, Acceleration] = (0.0, 0.0)
    """Gravity along x and y [m/s2]."""
    lengths: Lengths = Field(default_factory=dict)
    """Named lengths [m], for use in others such as ``L2/2 + 10 mm``."""
    links: Annotated[dict[str, LinkTable], Field(min_length=1), BeforeValidator(_not_reserved)]
    """Links by name."""
    joints: Annotated[dict[str, JointTable], Field(min_length=1)]
    """Joints by name."""
    gears: dict[str, GearTable] = Field(default_factory=dict)
    """Gear pairs by name."""
    reduction: dict[str, Name] = Field(default_factory=dict)
    """Reduction joint of a body, under the name of one of its links."""
    two_point: dict[str, TwoPoint] = Field(default_factory=dict)
    """Bodies that two point masses replace, each under the name of one of its links."""
    turns_with: tuple[tuple[Name, Name], ...] = ()
    """Pairs of links that always turn together without a prismatic joint, as in a parallelogram."""
    start: dict[str, Angle] = Field(default_factory=dict)
    """Approximate angle of every body in one position, which chooses the assembly branch [rad]."""
    built: dict[str, Text | Teeth] = Field(default_factory=dict)
    """Masses and inertias as built, by symbol such as ``"m2*"``, and teeth of stock gears, [Z, Z*] [kg, kg m2]."""
    printed: Published = Published()
    """What a source publishes for it."""

    def _check(self) -> None:
        if self.swing is not None and self.swing[0] == self.swing[1]:
            raise DataError("swing: both ends are the same angle, so nothing would move: give two")


class _LengthsTable(Table):
    """The lengths alone, which the rest of the file refers to."""

    model_config = ConfigDict(extra="ignore")
    lengths: Lengths = Field(default_factory=dict)


def load_linkage(name: str | Path) -> Linkage:
    """Load a shipped linkage by name, or a TOML file. Raises DataError or ModelError, naming the key."""
    path = datasets.find_dataset(name, "linkages", ".toml")
    return linkage_from_table(read_toml(path), path.stem, path.name)


def linkage_from_table(content: Mapping[str, Any], name: str, source: str = "linkage") -> Linkage:
    """Build a linkage from the keys of its file, which messages call ``source``.

    Raises DataError or ModelError, naming the key that is wrong.
    """
    lengths = model_from_table(_LengthsTable, content, source).lengths
    table = model_from_table(LinkageTable, content, source, context=lengths)
    with in_file(source):
        return _Builder(table).linkage(name)


@dataclass(frozen=True)
class _Placement:
    """The frame of a link in the frame of its body."""

    root: str
    """The link whose frame is the body's."""
    origin: Point = ORIGIN
    angle: float = 0.0
    """[rad]."""

    def of(self, point: Point) -> Point:
        """A point of the link in the body's frame."""
        return self.origin.plus(point.turned(self.angle))


class _Builder:
    """Puts a linkage together, with the place of every link in its body, and every symbol."""

    def __init__(self, table: LinkageTable) -> None:
        self.table = table
        self.symbols = dict(table.lengths)
        self.where: dict[str, _Placement] = {}
        for link in table.links:
            self._place(link, ())
        members: dict[str, list[str]] = {}
        for link, placement in self.where.items():
            members.setdefault(placement.root, []).append(link)
        self.names = {link: "+".join(members[placement.root]) for link, placement in self.where.items()}

    def linkage(self, name: str) -> Linkage:
        """The linkage: its bodies and joints, then what refers to them, bodies by the name of one of their links."""
        table, bodies = self.table, self._bodies()
        joints = {key: self._joint(key, joint) for key, joint in table.joints.items()}
        bare = Linkage(name, table.title or name, self.symbols, bodies, joints)

        def body(key: str, link: str) -> str:
            with in_file(key):
                return bare.body(link).name

        def joint(key: str, name: str) -> str:
            with in_file(key):
                return bare.joint(name).name

        two_point = {}
        for link, shaped in table.two_point.items():
            on = bodies[body("two_point", link)]
            for each in shaped.joints:
                joint(f"two_point.{link}", each)
            if shaped.reshaped not in (part.link for part in on.parts):
                raise DataError(f"two_point.{link}: reshaped is {shaped.reshaped!r}: expected a link of {on.name}")
            two_point[on.name] = shaped
        reduction = {body("reduction", link): joint("reduction", each) for link, each in table.reduction.items()}
        return replace(
            bare,
            gears={
                key: self._gear(key, body(f"gears.{key}.body", gear.body), gear) for key, gear in table.gears.items()
            },
            reduction=reduction | {on: shaped.joints[0] for on, shaped in two_point.items()},
            two_point=two_point,
            turns_with=tuple(
                (body("turns_with", a), GROUND if b == GROUND else body("turns_with", b)) for a, b in table.turns_with
            ),
            drive=None if table.drive is None else joint("drive", table.drive),
            speed=table.speed,
            swing=table.swing,
            gravity=table.gravity,
            start={body("start", link): angle for link, angle in table.start.items()},
            published=None if table.printed == Published() else table.printed,
            built=table.built,
        )

    def _place(self, link: str, behind: tuple[str, ...]) -> _Placement:
        """Placement of a link. Raises DataError where it is fixed to nothing, or in a circle."""
        table = self.table.links[link]
        if link in behind:
            raise DataError(f"links.{link}: fixed in a circle: {' to '.join([*behind, link])}")
        if table.fixed_to is None:
            self.where[link] = _Placement(link)
        elif table.fixed_to not in self.table.links:
            raise DataError(f"links.{link}.fixed_to: {table.fixed_to!r}: expected one of {', '.join(self.table.links)}")
        elif link not in self.where:
            under = self._place(table.fixed_to, (*behind, link))
            origin = under.of(Point(*table.at)) if table.at else under.origin
            self.where[link] = _Placement(under.root, origin, under.angle + (table.angle or 0.0))
        return self.where[link]

    def _bodies(self) -> dict[str, Body]:
        """Bodies by name; their masses and inertias become symbols."""
        parts: dict[str, list[Part]] = {}
        own: dict[str, list[Place]] = {}
        for_gears: dict[str, list[Place]] = {}
        for link, table in self.table.links.items():
            body = self.names[link]
            self.symbols[f"m{link}"] = table.mass
            if table.inertia is not None:
                self.symbols[f"I{link}"] = table.inertia
            centre = self.where[link].of(Point(*table.centre))
            parts.setdefault(body, []).append(Part(link, centre, table.inertia is not None))
            own.setdefault(body, []).extend(self._places(link, table.counter_mass, ""))
            for_gears.setdefault(body, []).extend(self._places(link, table.gear_counter_mass, "z"))
        for body in parts:  # places against gears are those given, or else the places of the other counter-masses
            for_gears[body] = for_gears[body] or [
                replace(place, name=f"{place.name}z", stated_inertia=False) for place in own[body]
            ]
        seen: dict[str, str] = {}
        for body in parts:
            for place in (*own[body], *for_gears[body]):
                if place.name in seen:  # only one of them would be among the results
                    raise DataError(
                        f"counter-masses on {seen[place.name]} and {body} are both named {place.name!r}: give one of "
                        "them another name = '...'"
                    )
                seen[place.name] = body
        return {body: Body(body, tuple(parts[body]), tuple(own[body]), tuple(for_gears[body])) for body in parts}

    def _places(self, link: str, tables: tuple[PlaceTable, ...], mark: str) -> list[Place]:
        names = [link] if len(tables) == 1 else [f"{link}{chr(97 + i)}" for i in range(len(tables))]
        places = []
        for name, table in zip(names, tables, strict=True):
            called = table.name or f"{name}{mark}"
            at = self.where[link].of(Point(*table.at)) if table.at else None
            if table.inertia is not None:
                self.symbols[f"I{called}*"] = table.inertia
            shape = (
                (table.bar, 12) if table.bar else (table.radius_of_gyration, 1) if table.radius_of_gyration else None
            )
            places.append(Place(called, at, table.radius, shape, table.inertia is not None))
        return places

    def _joint(self, name: str, table: RevoluteTable | PrismaticTable) -> Joint:
        first, second = (self._end(f"joints.{name}.{link}", link, value) for link, value in table.ends.items())
        if first.body == second.body:
            links = " and ".join(table.ends)
            raise DataError(f"joints.{name}: {links} are rigidly joined: a joint between them cannot move")
        return Joint(name, table.kind == "revolute", (first, second))

    def _end(self, key: str, link: str, value: PlanePoint | SlideTable | None) -> End:
        body, frame = self._body(key, link)
        if value is None:
            return End(body, None)
        if isinstance(value, SlideTable):
            return End(body, frame.of(Point(*value.point)), value.along + frame.angle)
        return End(body, frame.of(Point(*value)))

    def _body(self, key: str, link: str) -> tuple[str, _Placement]:
        """Body of a link or of the ground, and the link's frame in it."""
        if link == GROUND:
            return GROUND, _Placement(GROUND)
        if link not in self.names:
            raise DataError(f"{key}: {link!r}: no such link: there are {GROUND}, {', '.join(self.names)}")
        return self.names[link], self.where[link]

    def _gear(self, name: str, body: str, table: GearTable) -> Gear:
        counter, carrier, pivot = table.counter, None, None
        if counter.on is not None and counter.at is not None:
            carrier, frame = self._body(f"gears.{name}.counter.on", counter.on)
            pivot = frame.of(Point(*counter.at))
        return Gear(
            name, body, table.joint, table.teeth, table.disc or table.wheel, pivot, carrier, counter.mass,
            counter.radius_of_gyration,
        )  # fmt: skip
