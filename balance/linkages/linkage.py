"""A planar linkage as described: bodies of rigidly joined links, joints, places for counter-masses, gears."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from ..errors import ModelError
from ..input_files import Quantity, Table, Text
from ..results import Key
from .expressions import Expression, Point, Symbol

GROUND = "ground"
PositiveMass = Annotated[float, Quantity("mass", above=0.0)]
PositiveLength = Annotated[float, Quantity("length", above=0.0)]
Force = Annotated[float, Quantity("force")]
Moment = Annotated[float, Quantity("moment")]
Name = Annotated[Text, BeforeValidator(lambda value: str(value) if type(value) is int else value)]
"""Name of a link, joint or body; links are often numbered."""


@dataclass(frozen=True)
class Part:
    """A link as a part of its body."""

    link: str
    centre: Point
    """Centre of mass in the body's frame."""
    turns: bool = True
    """Whether an inertia is given; a link that only translates needs none."""

    @property
    def mass(self) -> str:
        """Symbol of its mass [kg]."""
        return f"m{self.link}"

    @property
    def inertia(self) -> str:
        """Symbol of its inertia about its own centre of mass [kg m2]."""
        return f"I{self.link}"


@dataclass(frozen=True)
class Place:
    """Where a counter-mass may go: at a point, or at a radius about the body's joint on the side that is needed."""

    name: str
    point: Point | None
    """In the body's frame; None for a place at a radius."""
    radius: Expression | None = None
    shape: tuple[Expression, int] | None = None
    """Length l and divisor d of its inertia m l^2 / d: 12 of a homogeneous bar, 1 of a radius of gyration, None of a
    point mass."""
    stated_inertia: bool = False
    """Whether its inertia is stated as a number, under the symbol ``I<name>*``, whatever the mass."""

    def inertia(self, mass: float, values: Mapping[str, float]) -> float:
        """Inertia about its own centre [kg m2]: m l^2 / d, or as stated."""
        if self.stated_inertia:
            return values[f"I{self.name}*"] if mass > 0 else 0.0
        return mass * self.shape[0].at(values) ** 2 / self.shape[1] if self.shape else 0.0

    def inertia_text(self) -> str | None:
        """How its inertia follows from its mass, in symbols; None where it does not."""
        if self.stated_inertia or self.shape is None:
            return None
        length, divisor = self.shape
        return f"I{self.name}* = m{self.name}* {length.power_text()}^2{f'/{divisor}' if divisor > 1 else ''}"


@dataclass(frozen=True)
class Body:
    """Rigidly joined links that move as one; its frame is that of the link that is fixed to no other."""

    name: str
    parts: tuple[Part, ...]
    places: tuple[Place, ...]
    """Where counter-masses against its own and received masses may go."""
    gear_places: tuple[Place, ...]
    """Where counter-masses against the masses of gears may go."""


@dataclass(frozen=True)
class End:
    """One side of a joint."""

    body: str
    point: Point | None
    """The pin, or a point of the line of sliding, in the body's frame; None where it is not given (ground only)."""
    along: float = 0.0
    """Direction of sliding in the body's frame [rad]."""


@dataclass(frozen=True)
class Joint:
    """A revolute or prismatic joint between two bodies."""

    name: str
    revolute: bool
    ends: tuple[End, End]
    both: bool = False
    """Sliding in both directions, between bodies that turn together without a joint, as in a parallelogram."""

    def end(self, body: str) -> End:
        """The side of ``body``."""
        return self.ends[0] if self.ends[0].body == body else self.ends[1]

    def other(self, body: str) -> str:
        """The body on the other side."""
        return self.ends[1].body if self.ends[0].body == body else self.ends[0].body

    def joins(self, body: str) -> bool:
        """Whether ``body`` is one of the two."""
        return body in (self.ends[0].body, self.ends[1].body)


class Disc(Table):
    """A gear as a disc whose mass grows with the square of its diameter."""

    mass: PositiveMass
    """Mass of a disc of this diameter [kg]."""
    diameter: PositiveLength
    """The diameter [m]."""


class Wheel(Table):
    """A gear with mass and inertia."""

    mass: PositiveMass
    """Mass of the gear on the body [kg]."""
    inertia: Annotated[float, Quantity("inertia", above=0.0)]
    """Inertia of the gear on the body about its own axis [kg m2]."""


@dataclass(frozen=True)
class Gear:
    """A gear pair: Z teeth, fixed to a body at a revolute joint, drive a counter-gear of Z* teeth the other way.

    On the ground the pair is fixed; on a carrier, the body across the joint, the counter-gear is a planet.
    """

    name: Annotated[str, Key("", "gear", "s")]
    body: Annotated[str, Key("", "body", "s")]
    joint: str | None
    """The revolute joint that it sits at; None for the body's reduction joint."""
    teeth: Annotated[tuple[int, int], Key("", "Z:Z*", lambda teeth: "{}:{}".format(*teeth))]
    """Z on the body, Z* of the counter-gear."""
    wheel: Disc | Wheel | None
    """The real gear on the body; None for one without mass."""
    pivot: Point | None
    """Pivot of the counter-gear in the carrier's frame; None for the carrier's own reduction joint."""
    pivot_on: str | None
    """The body that the pivot is stated to be on: the carrier."""
    counter_mass: float | None
    """Mass of the counter-gear and what gives it its inertia [kg]; None where it is not given."""
    counter_gyration: float | None
    """Or its radius of gyration [m]: its mass then follows from its inertia."""

    @property
    def ratio(self) -> float:
        """Z / Z*: the counter-gear turns, relative to the carrier, so much faster than the body, the other way."""
        return self.teeth[0] / self.teeth[1]


class TwoPoint(Table):
    """A body shaped so that two point masses at two of its joints replace it: I = m_A m_B L^2 / (m_A + m_B)."""

    joints: tuple[Name, Name]
    """The two joints; the first is the body's reduction joint."""
    reshaped: Name
    """Link whose own inertia is made to satisfy the condition."""


class Contradiction(Table):
    """Where a source contradicts itself."""

    about: Text
    """Which of its numbers, or which stage."""
    why: str
    """What is wrong with it."""
    omit: dict[str, list[str]] = Field(default_factory=dict)
    """Terms that it omits from the inertia of bodies, by link."""


class Published(Table):
    """What a source publishes for the linkage, to be compared with and never returned as a result."""

    values: dict[str, Text] = Field(default_factory=dict)
    """Masses and inertias by symbol, such as ``"m2*" = "1.451 kg"``, as published [kg, kg m2]."""
    rms: dict[Literal["before", "force", "complete"], tuple[Force, Force, Moment, Moment]] = Field(default_factory=dict)
    """RMS values by stage, [FX, FY, M, torque] [N, N m]."""
    restored: dict[str, str] = Field(default_factory=dict)
    """What had to be restored in the published copy, by symbol."""
    contradiction: tuple[Contradiction, ...] = ()
    """Where the source contradicts itself."""


@dataclass(frozen=True)
class Linkage:
    """A planar linkage and what may be done to balance it."""

    name: str
    title: str
    symbols: Mapping[str, Symbol]
    """Named lengths, masses ``m<link>`` and inertias ``I<link>``, ``I<place>*``."""
    bodies: Mapping[str, Body]
    """Moving bodies by name: that of their links, joined by +."""
    joints: Mapping[str, Joint]
    reduction: Mapping[str, str] = field(default_factory=dict)
    """Reduction joint of bodies where the file states it."""
    two_point: Mapping[str, TwoPoint] = field(default_factory=dict)
    gears: Mapping[str, Gear] = field(default_factory=dict)
    turns_with: tuple[tuple[str, str], ...] = ()
    """Pairs of bodies that always turn together without a prismatic joint, as in a parallelogram."""
    drive: str | None = None
    """Driven joint."""
    speed: float | None = None
    """Mean speed of the driven joint [rad/s]."""
    swing: tuple[float, float] | None = None
    """Ends of the driven joint's motion where it makes no full turns [rad]."""
    gravity: tuple[float, float] = (0.0, 0.0)
    """[m/s2]."""
    start: Mapping[str, float] = field(default_factory=dict)
    """Approximate angle of every body in one position, which chooses the assembly branch [rad]."""
    published: Published | None = None
    """What a source publishes for it, to be compared with."""
    built: Mapping[str, str | tuple[int, int]] = field(default_factory=dict)
    """Masses and inertias as built, with their units, by symbol; teeth by gear."""

    @property
    def values(self) -> dict[str, float]:
        """The symbols at their stated values, SI."""
        return {name: symbol.value for name, symbol in self.symbols.items()}

    @property
    def is_placed(self) -> bool:
        """Whether the places of all joints on the ground are given, so that it can be simulated."""
        return all(end.point is not None for joint in self.joints.values() for end in joint.ends)

    @cached_property
    def rotation_groups(self) -> dict[str, str]:
        """For every body and the ground, a name that it shares with those that always turn together with it.

        They are joined by a prismatic joint, or stated to turn together, as in a parallelogram.
        """
        group = {name: name for name in (GROUND, *self.bodies)}
        pairs = [(j.ends[0].body, j.ends[1].body) for j in self.joints.values() if not j.revolute]
        for first, second in [*pairs, *self.turns_with]:
            old, new = group[second], group[first]
            group = {body: new if value == old else value for body, value in group.items()}
        return group

    @cached_property
    def translating(self) -> frozenset[str]:
        """Bodies that cannot turn."""
        group = self.rotation_groups
        return frozenset(body for body in self.bodies if group[body] == group[GROUND])

    def body(self, name: str) -> Body:
        """A moving body by the name of one of its links. Raises ModelError, listing the bodies, if there is none."""
        for body in self.bodies.values():
            if name == body.name or name in (part.link for part in body.parts):
                return body
        raise ModelError(f"{self.name} has no moving link {name!r}: there are {', '.join(self.bodies)}")

    def joint(self, name: str) -> Joint:
        """A joint by name. Raises ModelError, listing the joints, if there is none."""
        if name not in self.joints:
            raise ModelError(f"{self.name} has no joint {name!r}: there are {', '.join(self.joints)}")
        return self.joints[name]

    def joints_of(self, body: str, revolute: bool = True) -> list[Joint]:
        """Revolute or prismatic joints of a body."""
        return [joint for joint in self.joints.values() if joint.revolute is revolute and joint.joins(body)]
