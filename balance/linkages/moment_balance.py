"""Moment balance: inertias about the reduction joints, and the gears that cancel them, leaves to root.

A gear Z on a body of inertia I about its joint drives a counter-gear of inertia I_z = (Z*/Z) I the other way. On a
carrier, omega* = (1 + Z/Z*) omega_c - (Z/Z*) omega: the carrier gains I_z (1 + Z/Z*). (Ye and Smith's method; the
source's equations 3.14 to 3.19.) The inertia of a body without a gear passes through prismatic joints to one that turns
with it. A real gear as a disc has the pitch diameter 2 a Z / (Z + Z*), a the distance of the two axes.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from graphlib import CycleError, TopologicalSorter
from typing import Annotated

import numpy as np

from ..arrays import Floats
from ..errors import ModelError, SizingError
from ..results import INLINE, NO_VALUE, Key
from .expressions import Point
from .force_balance import (
    CounterMass,
    EquivalentLoad,
    ForceBalance,
    balanced_body,
    check_point_mass,
    joint_point,
    received_load,
    span_vector,
    tree_parents,
)
from .linkage import GROUND, Gear, Linkage, Wheel, rotation_groups, translating_bodies


@dataclass(frozen=True)
class Gearing:
    """Gears by body."""

    own: Mapping[str, Gear]
    """The gear of every body that has one."""
    joint: Mapping[str, str]
    """The joint that every gear sits at."""
    carrier: Mapping[str, str]
    """The body that carries every gear pair, or the ground."""
    passes_to: Mapping[str, str]
    """Bodies without a gear of their own, and the one that turns with them to which their inertia is added."""


def gearing(linkage: Linkage, tree: Mapping[str, str]) -> Gearing:
    """Assign gears. Raises ModelError, naming the body, where one that turns has none, or two."""
    translating = translating_bodies(linkage)
    for body in linkage.bodies.values():
        for part in body.parts:
            if not part.turns and body.name not in translating:
                raise ModelError(f"link {part.link} of {linkage.name} turns: give its inertia")
    own: dict[str, Gear] = {}
    joint: dict[str, str] = {}
    for gear in linkage.gears.values():
        if gear.body in own:
            raise ModelError(
                f"gears {own[gear.body].name} and {gear.name} are both on body {gear.body}: keep one of them"
            )
        if gear.body in linkage.two_point:
            raise ModelError(f"gear {gear.name}: body {gear.body} is two point masses and needs no gear: remove it")
        own[gear.body] = gear
        at = linkage.joint(gear.joint or tree[gear.body])
        if not at.joins(gear.body) or not at.revolute:
            raise ModelError(f"gear {gear.name}: joint {at.name} is not a revolute joint of body {gear.body}")
        joint[gear.name] = at.name
    carrier = {name: linkage.joints[joint[name]].other(gear.body) for name, gear in linkage.gears.items()}
    for gear in linkage.gears.values():
        on = carrier[gear.name]
        if gear.pivot_on not in (None, on):
            raise ModelError(
                f"gear {gear.name}: its counter-gear is stated to be pivoted on {gear.pivot_on}, but the pair is "
                f"carried by {on}: give its place on {on}, or another joint for the gear"
            )
    return Gearing(own, joint, carrier, _passes_to(linkage, own, carrier))


def _passes_to(linkage: Linkage, own: Mapping[str, Gear], carrier: Mapping[str, str]) -> dict[str, str]:
    """Prismatic transport: to the body that turns with it and has a gear, best one pivoted on the ground."""
    group, translating, passes_to = rotation_groups(linkage), translating_bodies(linkage), {}
    for body in linkage.bodies:
        if body in own or body in translating or body in linkage.two_point:
            continue
        partners = [other for other in own if group[other] == group[body]]
        if not partners:
            raise ModelError(
                f"{linkage.name}: body {body} turns and has no gear, nor has one that always turns with it; add for "
                f'example [gears.z{body}] with body = "{body}"'
            )
        passes_to[body] = min(partners, key=lambda other: carrier[own[other].name] != GROUND)
    return passes_to


@dataclass(frozen=True)
class Term:
    """One term of a body's inertia."""

    text: Annotated[str, Key("term")]
    """In symbols."""
    value: Annotated[float, Key("inertia_kgm2")]
    """[kg m2]."""


@dataclass(frozen=True)
class BodyMoment:
    """Masses of gears on a body, and its inertia about its reduction joint with everything that it carries."""

    body: str
    extra: ForceBalance
    """Masses of gears, its own and received, and the counter-masses against them."""
    terms: tuple[Term, ...]

    @property
    def inertia(self) -> float:
        """About the reduction joint [kg m2]."""
        return sum(term.value for term in self.terms)


def _unless_zero(form: str, value: float) -> str:
    return format(value, form) if value else NO_VALUE


@dataclass(frozen=True)
class GearResult:
    """A gear pair, sized."""

    gear: Annotated[Gear, INLINE]
    joint: Annotated[str, Key("", "at", "s")]
    carrier: Annotated[str, Key("", "carrier", "s")]
    inertia: Annotated[float, Key("counter_gear_inertia_kgm2", "I_z [kg m2]", ".4g")]
    """Of the counter-gear, I_z = (Z*/Z) I [kg m2]."""
    wheel_mass: Annotated[float, Key("gear_mass_kg", "m_z [kg]", partial(_unless_zero, ".4f"))]
    """Of the real gear on the body [kg]."""
    wheel_inertia: Annotated[float, Key("gear_inertia_kgm2", "I_m_z [kg m2]", partial(_unless_zero, ".4g"))]
    """About its own axis [kg m2]."""
    counter_mass: Annotated[float | None, Key("counter_gear_mass_kg", "m_z* [kg]", ".4f")]
    """Of the counter-gear [kg]; None where it is not given and its pivot is fixed."""

    def centres(self, linkage: Linkage, tree: Mapping[str, str], values: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Pivot of the counter-gear and axis of the gear on the body, in the carrier's frame, (2,) each [m].

        The pivot is by default the carrier's own reduction joint; of a fixed pair, whose place has no effect, its axis.
        """
        own = self.joint if self.carrier == GROUND else tree[self.carrier]
        pivot = self.gear.pivot if self.gear.pivot is not None else joint_point(linkage, own, self.carrier)
        return pivot.at(values), joint_point(linkage, self.joint, self.carrier).at(values)


@dataclass(frozen=True)
class MomentBalance:
    """All bodies and gears of a complete balance."""

    bodies: Mapping[str, BodyMoment]
    gears: Mapping[str, GearResult]
    reshaped: Mapping[str, float]
    """Own inertia that a reshaped link of a two-point body must have [kg m2]."""


def moment_balance(
    linkage: Linkage,
    tree: Mapping[str, str],
    values: Mapping[str, float],
    force: Mapping[str, ForceBalance],
    omit: Mapping[str, Collection[str]],
) -> MomentBalance:
    """Size the gears; ``omit`` names terms that a source omits from a body's inertia.

    Raises ModelError or SizingError, naming the body, where the method cannot balance it.
    """
    step = _Step(linkage, tree, values, force, omit, gearing(linkage, tree))
    for body in step.order():
        step.visit(body)
    return MomentBalance(step.bodies, step.gears, step.reshaped)


@dataclass
class _Step:
    """Visits bodies one by one, each after all that it depends on."""

    linkage: Linkage
    tree: Mapping[str, str]
    values: Mapping[str, float]
    force: Mapping[str, ForceBalance]
    omit: Mapping[str, Collection[str]]
    pairs: Gearing
    bodies: dict[str, BodyMoment] = field(default_factory=dict)
    gears: dict[str, GearResult] = field(default_factory=dict)
    reshaped: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.translating = translating_bodies(self.linkage)

    def order(self) -> Iterable[str]:
        """Bodies after those that they carry, whose gears they carry, or whose inertia passes to them."""
        before: dict[str, list[str]] = {body: [] for body in self.linkage.bodies}
        for body in self.linkage.bodies:
            for _, parent in tree_parents(self.linkage, self.tree, body):
                before.get(parent, []).append(body)
        for gear in self.linkage.gears.values():
            before.get(self.pairs.carrier[gear.name], []).append(gear.body)
        for body, target in self.pairs.passes_to.items():
            before[target].append(body)
        try:
            return list(TopologicalSorter(before).static_order())
        except CycleError as error:
            raise ModelError(
                f"{self.linkage.name}: bodies {', '.join(error.args[1])} carry each other's gears in a circle: put a "
                "gear at another joint, or reduce one of them elsewhere"
            ) from error

    def visit(self, body: str) -> None:
        """Balance the gear masses on a body, sum its inertia, size its gear."""
        extra = self._extra(body)
        if body not in self.translating:
            terms = [term for term in self._terms(body, extra) if term.text not in self.omit.get(body, ())]
        else:
            check_point_mass(self.linkage, self.force[body], extra)
            terms = []
        self.bodies[body] = BodyMoment(body, extra, tuple(terms))
        if shaped := self.linkage.two_point.get(body):
            self.reshaped[shaped.reshaped] = self._reshaped(body, shaped.reshaped, shaped.joints)
        elif body not in self.translating and body not in self.pairs.passes_to:
            self._size(self.pairs.own[body])

    def _extra(self, body: str) -> ForceBalance:
        linkage, tree, values = self.linkage, self.tree, self.values
        extras = {name: done.extra for name, done in self.bodies.items()}
        loads = [load for load in received_load(linkage, tree, extras, body, "m_z") if load.mass]
        origin = joint_point(linkage, tree[body], body)
        for done in self.gears.values():
            if done.carrier == body:
                at = joint_point(linkage, done.joint, body).plus(origin, -1.0)
                loads += self._load(done.gear.name, done.wheel_mass, at)
                pivot = done.gear.pivot.plus(origin, -1.0) if done.gear.pivot is not None else Point()
                loads += self._load(f"{done.gear.name}*", self._carried(done, pivot), pivot)
        places = linkage.bodies[body].gear_places
        return balanced_body(
            linkage, tree, values, linkage.bodies[body], loads, places, body in self.translating and not places
        )

    @staticmethod
    def _load(gear: str, mass: float, at: Point) -> list[EquivalentLoad]:
        return [EquivalentLoad((f"m_{gear}",), mass, at, gear)] if mass else []

    def _carried(self, done: GearResult, pivot: Point) -> float:
        """Mass of a counter-gear that rides on a carrier. Raises ModelError where it moves and is not given."""
        if done.counter_mass is not None:
            return done.counter_mass
        rides = GROUND not in (parent for _, parent in tree_parents(self.linkage, self.tree, done.carrier))
        if rides or not pivot.is_zero:
            raise ModelError(
                f"gear {done.gear.name}: its counter-gear rides on {done.carrier}, whose pivot moves: give "
                "counter = { mass = '...' } or { radius_of_gyration = '...' }"
            )
        return 0.0

    def _terms(self, body: str, extra: ForceBalance) -> list[Term]:
        """I = sum(I_cg + m r^2) + received m r^2 + counter-masses' I* + m* p^2 + gears."""
        balance, terms = self.force[body], []
        for part in self.linkage.bodies[body].parts:
            terms.append(Term(part.inertia, self.values.get(part.inertia, 0.0)))
        for load in (*balance.loads, *extra.loads):
            if not load.at.is_zero:
                r2 = float(load.at.at(self.values) @ load.at.at(self.values))
                terms.append(Term(f"{load.text} {load.at.squared_text()}", load.mass * r2))
        for counter in (*balance.counters, *extra.counters):
            terms += self._counter_terms(counter, body)
        for source, target in self.pairs.passes_to.items():
            if target == body:
                terms.append(Term(f"I[{source}]", self.bodies[source].inertia))
        for done in self.gears.values():
            if done.carrier == body:
                terms.append(Term(f"I_{done.gear.name}", done.inertia))
                terms.append(Term(f"I_{done.gear.name} Z/Z*", done.inertia * done.gear.ratio))
        own = self.pairs.own.get(body)
        if own is not None and own.wheel is not None:
            terms.append(Term(f"I_m_{own.name}", self._wheel(own)[1]))
        return terms

    def _counter_terms(self, counter: CounterMass, body: str) -> list[Term]:
        """Its own inertia, and its mass at its place."""
        squared = float(counter.position @ counter.position)
        place = counter.place
        if place.point is not None:
            text = place.point.plus(joint_point(self.linkage, self.tree[body], body), -1.0).squared_text()
        else:
            assert place.radius is not None
            text = f"{place.radius.power_text()}^2"
        own = [Term(f"I{place.name}*", counter.inertia)] if counter.inertia else []
        return [*own, Term(f"{counter.symbol} {text}", counter.mass * squared)]

    def _size(self, gear: Gear) -> None:
        """I_z = (Z*/Z) I, and what it weighs."""
        inertia = self.bodies[gear.body].inertia / gear.ratio
        mass, own = self._wheel(gear)
        weight = gear.counter_mass
        if gear.counter_gyration is not None:
            weight = inertia / gear.counter_gyration**2
        joint, carrier = self.pairs.joint[gear.name], self.pairs.carrier[gear.name]
        self.gears[gear.name] = GearResult(gear, joint, carrier, inertia, mass, own, weight)

    def _wheel(self, gear: Gear) -> tuple[float, float]:
        """Mass [kg] and inertia [kg m2] of the gear on the body: m d^2 / 8 of a disc; zero where nothing is given."""
        wheel, joint, carrier = gear.wheel, self.pairs.joint[gear.name], self.pairs.carrier[gear.name]
        if wheel is None:
            return 0.0, 0.0
        if isinstance(wheel, Wheel):
            return wheel.mass, wheel.inertia
        if carrier == GROUND and gear.pivot is None:
            raise ModelError(
                f"gear {gear.name}: a disc on the ground needs the pivot of its counter-gear: "
                "counter = { on = 'ground', at = [...] }"
            )
        pivot = gear.pivot if gear.pivot is not None else joint_point(self.linkage, self.tree[carrier], carrier)
        distance = float(np.linalg.norm(pivot.plus(joint_point(self.linkage, joint, carrier), -1.0).at(self.values)))
        if not distance > 0:
            raise ModelError(f"gear {gear.name}: both gears would be on one axis: give its counter-gear another pivot")
        diameter = 2.0 * distance * gear.teeth[0] / sum(gear.teeth)
        mass = wheel.mass * (diameter / wheel.diameter) ** 2
        return mass, mass * diameter**2 / 8.0

    def _reshaped(self, body: str, link: str, joints: tuple[str, str]) -> float:
        """Own inertia of the link that makes the body's I about A equal to m_B L^2."""
        arm = span_vector(self.linkage, self.values, body)
        share = self.force[body].shares[joints[1]] + self.bodies[body].extra.shares[joints[1]]
        others = self.bodies[body].inertia - self.values.get(f"I{link}", 0.0)
        inertia = share * float(arm @ arm) - others
        if not inertia > 0:
            raise SizingError(
                f"two_point of {body}: link {link} would need an inertia of {inertia:.4g} kg m2: its other parts alone "
                "have more than two point masses at its joints allow; make them lighter or smaller"
            )
        return inertia
