"""Moment balance: inertias about the reduction joints, and the gears that cancel them, leaves to root.

A gear Z on a body of inertia I about its joint drives a counter-gear of inertia I_z = (Z*/Z) I the other way. On a
carrier, omega* = (1 + Z/Z*) omega_c - (Z/Z*) omega: the carrier gains I_z (1 + Z/Z*). (Ye and Smith's method; the
source's equations 3.14 to 3.19.) The inertia of a body without a gear passes through prismatic joints to one that turns
with it. A real gear as a disc has the pitch diameter 2 a Z / (Z + Z*), a the distance of the two axes.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from graphlib import CycleError, TopologicalSorter
from typing import Annotated

import numpy as np

from ..arrays import Floats
from ..errors import ModelError, SizingError
from ..results import INLINE, NO_VALUE, Key
from .expressions import Point
from .force_balance import (
    EquivalentLoad,
    ForceBalance,
    ReducedLinkage,
    balanced_body,
    check_point_mass,
    received_load,
)
from .linkage import GROUND, Gear, TwoPoint, Wheel


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
    pivot: Annotated[str, Key("counter_gear_pivot", "pivot", "s")]
    """Where the counter-gear is pivoted: as stated, else at a joint of its carrier, or anywhere on the ground."""
    inertia: Annotated[float, Key("counter_gear_inertia_kgm2", "I_z [kg m2]", ".4g")]
    """Of the counter-gear, I_z = (Z*/Z) I [kg m2]."""
    wheel_mass: Annotated[float, Key("gear_mass_kg", "m_z [kg]", partial(_unless_zero, ".4f"))]
    """Of the real gear on the body [kg]."""
    wheel_inertia: Annotated[float, Key("gear_inertia_kgm2", "I_m_z [kg m2]", partial(_unless_zero, ".4g"))]
    """About its own axis [kg m2]."""
    counter_mass: Annotated[float | None, Key("counter_gear_mass_kg", "m_z* [kg]", ".4f")]
    """Of the counter-gear [kg]; None where it is not given and its pivot is fixed."""

    def centres(self, reduced: ReducedLinkage) -> tuple[Floats, Floats]:
        """Pivot of the counter-gear and axis of the gear on the body, in the carrier's frame, (2,) each [m].

        The pivot is by default the carrier's own reduction joint; of a fixed pair, whose place has no effect, its axis.
        """
        own = self.joint if self.carrier == GROUND else reduced.tree[self.carrier]
        places = (
            self.gear.pivot or reduced.joint_point(own, self.carrier),
            reduced.joint_point(self.joint, self.carrier),
        )
        return places[0].at(reduced.values), places[1].at(reduced.values)


@dataclass(frozen=True)
class MomentBalance:
    """All bodies and gears of a complete balance."""

    bodies: Mapping[str, BodyMoment]
    gears: Mapping[str, GearResult]
    reshaped: Mapping[str, float]
    """Own inertia that a reshaped link of a two-point body must have [kg m2]."""


def moment_balance(
    reduced: ReducedLinkage, force: Mapping[str, ForceBalance], omit: Mapping[str, Collection[str]]
) -> MomentBalance:
    """Size the gears; ``omit`` names terms that a source omits from a body's inertia.

    Raises ModelError or SizingError, naming the body, where the method cannot balance it.
    """
    step = _Step(reduced, force, omit)
    for body in step.order():
        step.visit(body)
    return MomentBalance(step.bodies, step.gears, step.reshaped)


class _Step:
    """Visits bodies one by one, each after all that it depends on."""

    def __init__(
        self, reduced: ReducedLinkage, force: Mapping[str, ForceBalance], omit: Mapping[str, Collection[str]]
    ) -> None:
        self.reduced, self.linkage, self.values = reduced, reduced.linkage, reduced.values
        self.force, self.omit = force, omit
        for body in self.linkage.bodies.values():
            for part in body.parts:
                if not part.turns and body.name not in self.linkage.translating:
                    raise ModelError(f"link {part.link} of {self.linkage.name} turns: give its inertia")
        self.own: dict[str, Gear] = {}
        """The gear of every body that has one."""
        self.joint: dict[str, str] = {}
        """The joint that every gear sits at."""
        self.carrier: dict[str, str] = {}
        """The body that carries every gear pair, or the ground."""
        self._assign_gears()
        self.passes_to: dict[str, str] = {}
        """Bodies without a gear of their own, and the one that turns with them to which their inertia is added."""
        self._pass_on()
        self.bodies: dict[str, BodyMoment] = {}
        self.gears: dict[str, GearResult] = {}
        self.reshaped: dict[str, float] = {}

    def _assign_gears(self) -> None:
        """Raises ModelError for a gear at a joint, on a body or pivoted on a carrier that cannot have it."""
        linkage = self.linkage
        for gear in linkage.gears.values():
            if gear.body in self.own:
                first = self.own[gear.body].name
                raise ModelError(f"gears {first} and {gear.name} are both on body {gear.body}: keep one of them")
            if gear.body in linkage.two_point:
                raise ModelError(f"gear {gear.name}: body {gear.body} is two point masses and needs no gear: remove it")
            at = linkage.joint(gear.joint or self.reduced.tree[gear.body])
            if not at.joins(gear.body) or not at.revolute:
                raise ModelError(f"gear {gear.name}: joint {at.name} is not a revolute joint of body {gear.body}")
            self.own[gear.body], self.joint[gear.name] = gear, at.name
            self.carrier[gear.name] = at.other(gear.body)
        for gear in linkage.gears.values():
            on = self.carrier[gear.name]
            if gear.pivot_on not in (None, on):
                raise ModelError(
                    f"gear {gear.name}: its counter-gear is stated to be pivoted on {gear.pivot_on}, but the pair is "
                    f"carried by {on}: give its place on {on}, or another joint for the gear"
                )
            joint = linkage.joints[self.joint[gear.name]]
            places = [point.at(self.values) for point in (gear.pivot, joint.end(on).point) if point is not None]
            if len(places) == 2 and np.allclose(places[0], places[1], rtol=0.0, atol=1e-9):
                raise ModelError(
                    f"gear {gear.name}: its counter-gear is pivoted where {joint.name} is on {on}, on the gear's own "
                    f"axis: expected axes apart, so that teeth can mesh; change gears.{gear.name}.counter.at"
                )

    def _pass_on(self) -> None:
        """Prismatic transport: to the body that turns with it and has a gear, best one pivoted on the ground."""
        linkage, group = self.linkage, self.linkage.rotation_groups
        for body in linkage.bodies:
            if body in self.own or body in linkage.translating or body in linkage.two_point:
                continue
            partners = [other for other in self.own if group[other] == group[body]]
            if not partners:
                raise ModelError(
                    f"{linkage.name}: body {body} turns and has no gear, nor has one that always turns with it; add "
                    f'for example [gears.z{body}] with body = "{body}"'
                )
            self.passes_to[body] = min(partners, key=lambda other: self.carrier[self.own[other].name] != GROUND)

    def order(self) -> Iterable[str]:
        """Bodies after those that they carry, whose gears they carry, or whose inertia passes to them."""
        before: dict[str, list[str]] = {body: [] for body in self.linkage.bodies}
        for body in self.linkage.bodies:
            for _, parent in self.reduced.parents(body):
                before.get(parent, []).append(body)
        for gear in self.linkage.gears.values():
            before.get(self.carrier[gear.name], []).append(gear.body)
        for body, target in self.passes_to.items():
            before[target].append(body)
        try:
            return list(TopologicalSorter(before).static_order())
        except CycleError as error:
            raise ModelError(
                f"{self.linkage.name}: bodies {', '.join(error.args[1])} carry each other's gears in a circle: put a "
                "gear at another joint, or reduce one of them elsewhere"
            ) from error

    def visit(self, body: str) -> None:
        """Balance the gear masses on a body, sum its inertia, size its gear: I_z = (Z*/Z) I, and what it weighs."""
        extra = balanced_body(
            self.reduced, self.linkage.bodies[body], self._gear_loads(body), self.linkage.bodies[body].gear_places
        )
        if body in self.linkage.translating:
            check_point_mass(self.linkage, self.force[body], extra)
            self.bodies[body] = BodyMoment(body, extra, ())
            return
        terms = [term for term in self._terms(body, extra) if term.text not in self.omit.get(body, ())]
        self.bodies[body] = BodyMoment(body, extra, tuple(terms))
        if shaped := self.linkage.two_point.get(body):
            self.reshaped[shaped.reshaped] = self._reshaped(body, shaped)
        elif body not in self.passes_to:
            gear = self.own[body]
            inertia, gyration = self.bodies[body].inertia / gear.ratio, gear.counter_gyration
            weight = gear.counter_mass if gyration is None else inertia / gyration**2
            self.gears[gear.name] = GearResult(
                gear,
                self.joint[gear.name],
                self.carrier[gear.name],
                self._pivot(gear),
                inertia,
                *self._wheel(gear),
                weight,
            )

    def _pivot(self, gear: Gear) -> str:
        carrier = self.carrier[gear.name]
        return "as stated" if gear.pivot else "anywhere" if carrier == GROUND else self.reduced.tree[carrier]

    def _gear_loads(self, body: str) -> list[EquivalentLoad]:
        """Masses of gears on a body, its own and received."""
        extras = {name: done.extra for name, done in self.bodies.items()}
        loads = [load for load in received_load(self.reduced, extras, body, "m_z") if load.mass]
        for done in self.gears.values():
            if done.carrier == body:
                name = done.gear.name
                at = self.reduced.arm(self.reduced.joint_point(done.joint, body), body)
                pivot = self.reduced.arm(done.gear.pivot, body) if done.gear.pivot is not None else Point()
                pair = ((name, done.wheel_mass, at), (f"{name}*", self._carried(done, pivot), pivot))
                loads += [EquivalentLoad((f"m_{gear}",), mass, place, gear) for gear, mass, place in pair if mass]
        return loads

    def _carried(self, done: GearResult, pivot: Point) -> float:
        """Mass of a counter-gear that rides on a carrier. Raises ModelError where it moves and is not given."""
        if done.counter_mass is not None:
            return done.counter_mass
        if GROUND not in (parent for _, parent in self.reduced.parents(done.carrier)) or not pivot.is_zero:
            raise ModelError(
                f"gear {done.gear.name}: its counter-gear rides on {done.carrier}, whose pivot moves: give "
                "counter = { mass = '...' } or { radius_of_gyration = '...' }"
            )
        return 0.0

    def _terms(self, body: str, extra: ForceBalance) -> list[Term]:
        """I = sum(I_cg + m r^2) + received m r^2 + counter-masses' I* + m* p^2 + gears."""
        balance, parts = self.force[body], self.linkage.bodies[body].parts
        terms = [Term(part.inertia, self.values.get(part.inertia, 0.0)) for part in parts]
        for load in (*balance.loads, *extra.loads):
            if not load.at.is_zero:
                r2 = float(load.at.at(self.values) @ load.at.at(self.values))
                terms.append(Term(f"{load.text} {load.at.squared_text()}", load.mass * r2))
        for counter in (*balance.counters, *extra.counters):
            place, squared = counter.place, float(counter.position @ counter.position)
            if counter.inertia:
                terms.append(Term(f"I{place.name}*", counter.inertia))
            if place.point is not None:
                text = self.reduced.arm(place.point, body).squared_text()
            else:
                assert place.radius is not None
                text = f"{place.radius.power_text()}^2"
            terms.append(Term(f"{counter.symbol} {text}", counter.mass * squared))
        terms += [Term(f"I[{one}]", self.bodies[one].inertia) for one, to in self.passes_to.items() if to == body]
        for done in self.gears.values():
            if done.carrier == body:
                terms.append(Term(f"I_{done.gear.name}", done.inertia))
                terms.append(Term(f"I_{done.gear.name} Z/Z*", done.inertia * done.gear.ratio))
        own = self.own.get(body)
        if own is not None and own.wheel is not None:
            terms.append(Term(f"I_m_{own.name}", self._wheel(own)[1]))
        return terms

    def _wheel(self, gear: Gear) -> tuple[float, float]:
        """Mass [kg] and inertia [kg m2] of the gear on the body: m d^2 / 8 of a disc; zero where nothing is given."""
        wheel, carrier = gear.wheel, self.carrier[gear.name]
        if wheel is None:
            return 0.0, 0.0
        if isinstance(wheel, Wheel):
            return wheel.mass, wheel.inertia
        if carrier == GROUND and gear.pivot is None:
            raise ModelError(
                f"gear {gear.name}: a disc on the ground needs the pivot of its counter-gear: "
                "counter = { on = 'ground', at = [...] }"
            )
        pivot = gear.pivot or self.reduced.joint_point(self.reduced.tree[carrier], carrier)
        axis = self.reduced.joint_point(self.joint[gear.name], carrier)
        distance = float(np.linalg.norm(pivot.plus(axis, -1.0).at(self.values)))
        if not distance > 0:
            raise ModelError(f"gear {gear.name}: both gears would be on one axis: give its counter-gear another pivot")
        diameter = 2.0 * distance * gear.teeth[0] / sum(gear.teeth)
        mass = wheel.mass * (diameter / wheel.diameter) ** 2
        return mass, mass * diameter**2 / 8.0

    def _reshaped(self, body: str, shaped: TwoPoint) -> float:
        """Own inertia of the link that makes the body's I about A equal to m_B L^2."""
        arm, link, at = self.reduced.span(body), shaped.reshaped, shaped.joints[1]
        share = self.force[body].shares[at] + self.bodies[body].extra.shares[at]
        inertia = share * float(arm @ arm) - (self.bodies[body].inertia - self.values.get(f"I{link}", 0.0))
        if not inertia > 0:
            raise SizingError(
                f"two_point of {body}: link {link} would need an inertia of {inertia:.4g} kg m2: its other parts alone "
                "have more than two point masses at its joints allow; make them lighter or smaller"
            )
        return inertia
