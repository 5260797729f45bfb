"""Force balance, leaves to root: every body becomes a point mass at its reduction joint.

The reduction tree gives every body the revolute joint to which its mass is reduced, all leading to the ground. With own
parts and the point masses received from the bodies that it carries, S = sum(m r) about that joint; its counter-masses
satisfy sum(m* p) = -S, m* >= 0. A body that only translates is a point mass at its revolute joint.

The two-point alternative: a body shaped so that point masses at two of its joints replace it, and no gear is needed.
m_B = S / L, m_A = m - m_B about joint A; its inertia must be I_cg = m_A m_B L^2 / (m_A + m_B).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from math import inf, prod

import numpy as np

from ..arrays import Floats
from ..errors import ModelError, SizingError
from .expressions import Point
from .linkage import GROUND, Body, Linkage, Place

ROUNDING = 1e-13
"""Share of its terms below which a first moment is rounding error."""
MOST_TREES = 20_000
"""Combinations of joints beyond which the shortest paths to the ground are taken."""


@dataclass(frozen=True)
class EquivalentLoad:
    """A point mass on a body, or one of its parts."""

    symbols: tuple[str, ...]
    """Symbols whose sum is its mass, such as m3, m3*."""
    mass: float
    """[kg]."""
    at: Point
    """From the body's reduction joint, in the body's frame."""
    source: str = ""
    """Where it is from: a link, a received body, a gear."""

    @property
    def text(self) -> str:
        """Its mass in symbols."""
        return self.symbols[0] if len(self.symbols) == 1 else f"({' + '.join(self.symbols)})"


@dataclass(frozen=True)
class CounterMass:
    """A counter-mass: its place, mass and position."""

    place: Place
    mass: float
    """[kg]."""
    position: Floats
    """From the body's reduction joint, in the body's frame, (2,) [m]."""
    inertia: float
    """About its own centre [kg m2]."""

    @property
    def symbol(self) -> str:
        """Such as m3*."""
        return f"m{self.place.name}*"


@dataclass(frozen=True)
class ForceBalance:
    """A body whose centre of mass, with what it carries, is at its reduction joint."""

    body: str
    joint: str
    loads: tuple[EquivalentLoad, ...]
    counters: tuple[CounterMass, ...]
    shares: Mapping[str, float]
    """Point masses that replace it, by joint: one, or two of a two-point body [kg]."""
    residual: Floats
    """Residual first moment about the reduction joint, (2,) [kg m]."""

    @property
    def mass(self) -> float:
        """Of the body with all that it carries [kg]."""
        return sum(self.shares.values())

    @property
    def symbols(self) -> tuple[str, ...]:
        """Symbols whose sum is its mass."""
        counters = {counter.symbol: counter.symbol for counter in self.counters}
        symbols: list[str] = []
        for load in self.loads:
            symbols += load.symbols
            symbols += [counters.pop(f"{load.text}*")] if f"{load.text}*" in counters else []
        return (*symbols, *counters)


@dataclass(frozen=True)
class ReducedLinkage:
    """A linkage with its reduction tree: the revolute joint of every body to which its mass is reduced."""

    linkage: Linkage
    values: Mapping[str, float]
    """Symbols at which it is computed, SI."""
    tree: Mapping[str, str]
    """Reduction joint of every body."""

    def parents(self, body: str) -> list[tuple[str, str]]:
        """Joints to which a body's mass is reduced, each with the body across: one, or two of a two-point body."""
        shaped = self.linkage.two_point.get(body)
        names = shaped.joints if shaped else (self.tree[body],)
        return [(name, self.linkage.joints[name].other(body)) for name in names]

    def depth(self, body: str, most: int | None = None) -> float:
        """Joints between a body and the ground; infinite in a circle, where they are more than ``most``."""
        most = len(self.tree) if most is None else most
        if body == GROUND:
            return 0
        return 1 + max(self.depth(parent, most - 1) for _, parent in self.parents(body)) if most >= 0 else inf

    def leaves_first(self) -> list[str]:
        """Bodies so that every one comes before the bodies that carry it."""
        return sorted(self.linkage.bodies, key=lambda body: -self.depth(body))

    def joint_point(self, joint: str, body: str) -> Point:
        """A joint's place in a body's frame. Raises ModelError for a place on the ground that is not given."""
        point = self.linkage.joints[joint].end(body).point
        if point is None:
            raise ModelError(f"joint {joint} of {self.linkage.name}: its place on {body} is not given")
        return point

    def arm(self, point: Point, body: str) -> Point:
        """From a body's reduction joint to a point, in the body's frame."""
        return point.plus(self.joint_point(self.tree[body], body), -1.0)

    def span(self, body: str) -> Floats:
        """Between the joints of a two-point body, (2,) [m]. Raises ModelError where they are none of the body's."""
        joints = self.linkage.two_point[body].joints
        for joint in joints:
            if not self.linkage.joints[joint].joins(body) or not self.linkage.joints[joint].revolute:
                raise ModelError(f"two_point of {body}: joint {joint} is not a revolute joint of it")
        arm = self.joint_point(joints[1], body).plus(self.joint_point(joints[0], body), -1.0).at(self.values)
        if not arm.any():
            raise ModelError(
                f"two_point of {body}: joints {' and '.join(joints)} are in one point: give two that are apart"
            )
        return arm


def reduction_tree(linkage: Linkage, values: Mapping[str, float]) -> ReducedLinkage:
    """Reduction joint of every body: as stated, or else the choice of least counter-mass.

    Raises ModelError, naming the body, where one has no revolute path to the ground.
    """
    choices = {body: _choices(linkage, body) for body in linkage.bodies}
    _check_paths(linkage)
    if prod(len(joints) for joints in choices.values()) > MOST_TREES:
        distance = {GROUND: 0.0}  # joints to the ground by the shortest path
        for _ in linkage.bodies:
            for body, joints in choices.items():
                distance[body] = 1 + min(distance.get(linkage.joints[j].other(body), inf) for j in joints)
        choices = {
            body: [min(joints, key=lambda joint: distance[linkage.joints[joint].other(body)])]
            for body, joints in choices.items()
        }
    best, least, refusal = None, inf, None
    for names in product(*choices.values()):
        reduced = ReducedLinkage(linkage, values, dict(zip(choices, names, strict=True)))
        if not all(reduced.depth(body) < inf for body in choices):
            continue
        try:
            mass = sum(c.mass for balanced in force_balance(reduced).values() for c in balanced.counters)
        except SizingError as error:
            refusal = refusal or error
            continue
        if best is None or mass < least - 1e-9 * abs(least):
            best, least = reduced, mass
    if best is None:
        first = ReducedLinkage(linkage, values, {body: joints[0] for body, joints in choices.items()})
        circular = [body for body in choices if first.depth(body) == inf]
        stated = [f"{body} at {' and '.join(joint for joint, _ in first.parents(body))}" for body in circular]
        raise refusal or ModelError(
            f"{linkage.name}: the reductions of {', '.join(stated)} lead in a circle, not to the ground: change one"
        )
    return best


def _choices(linkage: Linkage, body: str) -> list[str]:
    own = [joint.name for joint in linkage.joints_of(body)]
    if body not in linkage.reduction:
        return own
    named = linkage.reduction[body]
    joint = linkage.joints[named]
    if not joint.joins(body):
        raise ModelError(f"reduction of {body}: joint {named} is not one of its own: {', '.join(own) or 'none'}")
    if not joint.revolute:
        raise ModelError(f"reduction of {body}: mass does not pass through the prismatic joint {named}")
    return [named]


def _check_paths(linkage: Linkage) -> None:
    """Raise ModelError for a body without a revolute path to the ground."""
    reached = {GROUND}
    for _ in linkage.bodies:
        reached |= {b for b in linkage.bodies if any(joint.other(b) in reached for joint in linkage.joints_of(b))}
    for body in linkage.bodies:
        if body not in reached:
            joints = ", ".join(j.name for kind in (True, False) for j in linkage.joints_of(body, kind)) or "none"
            raise ModelError(
                f"{linkage.name}: body {body} has no revolute path to the ground (its joints: {joints}); mass does "
                "not pass through prismatic joints, so the method cannot balance it"
            )


def force_balance(reduced: ReducedLinkage) -> dict[str, ForceBalance]:
    """Counter-masses of every body, leaves first. Raises SizingError, naming the body, where its places cannot."""
    done: dict[str, ForceBalance] = {}
    for name in reduced.leaves_first():
        body = reduced.linkage.bodies[name]
        loads = [
            EquivalentLoad((part.mass,), reduced.values[part.mass], reduced.arm(part.centre, name), part.link)
            for part in body.parts
        ]
        done[name] = balanced_body(reduced, body, [*loads, *received_load(reduced, done, name)], body.places)
    return done


def received_load(
    reduced: ReducedLinkage, done: Mapping[str, ForceBalance], body: str, mass: str = "m"
) -> list[EquivalentLoad]:
    """Point masses that a body receives from those that it carries; ``mass`` begins the symbols of two-point ones."""
    found = []
    for child, balance in done.items():
        for joint, parent in reduced.parents(child):
            if parent == body and balance.shares[joint]:
                symbols = balance.symbols if len(balance.shares) == 1 else (f"{mass}[{child} at {joint}]",)
                at = reduced.arm(reduced.joint_point(joint, body), body)
                found.append(EquivalentLoad(symbols, balance.shares[joint], at, child))
    return found


def balanced_body(
    reduced: ReducedLinkage, body: Body, loads: Sequence[EquivalentLoad], places: Sequence[Place]
) -> ForceBalance:
    """Counter-masses against the loads of one body; one that only translates needs no place for any."""
    joint, values = reduced.tree[body.name], reduced.values
    at = np.array([load.at.at(values) for load in loads]).reshape(-1, 2)
    mass = np.array([load.mass for load in loads])
    first, terms = mass @ at, np.abs(mass) @ np.abs(at)
    first[np.abs(first) <= ROUNDING * terms] = 0.0
    total = float(mass.sum())
    if body.name in reduced.linkage.two_point:
        return _two_point_balance(reduced, body, tuple(loads), places, first, total)
    if not places and body.name in reduced.linkage.translating:
        return ForceBalance(body.name, joint, tuple(loads), (), {joint: total}, first)
    counters = solve_force_balance(first, places, reduced.joint_point(joint, body.name), values, body.name)
    total += sum(c.mass for c in counters)
    residual = first + sum((c.mass * c.position for c in counters), np.zeros(2))
    return ForceBalance(body.name, joint, tuple(loads), counters, {joint: total}, residual)


def _two_point_balance(
    reduced: ReducedLinkage,
    body: Body,
    loads: tuple[EquivalentLoad, ...],
    places: Sequence[Place],
    first: Floats,
    total: float,
) -> ForceBalance:
    """Counter-masses that bring the centre of mass onto the line of the two joints, and the two point masses.

    ``first`` is the first moment of the loads about the reduction joint, (2,) [kg m], ``total`` their mass [kg].
    """
    joints = reduced.linkage.two_point[body.name].joints
    arm = reduced.span(body.name)
    length = float(np.linalg.norm(arm))
    across = np.array([-arm[1], arm[0]]) / length
    counters: tuple[CounterMass, ...] = ()
    off = float(across @ first)
    if abs(off) > ROUNDING * total * length:
        at = [(place, reduced.arm(place.point, body.name).at(reduced.values)) for place in places if place.point]
        fit = [(-off / float(across @ x), place, x) for place, x in at if across @ x * off < 0]
        if not fit:
            raise SizingError(
                f"two_point of {body.name}: its centre of mass is off the line of the two joints (first moment "
                f"{off:.4g} kg m); two point masses can only replace a body whose centre is on that line: give a "
                "counter_mass place on the other side"
            )
        mass, place, position = min(fit, key=lambda found: found[0])
        counters = (CounterMass(place, mass, position, place.inertia(mass, reduced.values)),)
        first, total = first + mass * position, total + mass
    share = float(first @ arm) / length**2
    if total and not 0.0 < share < total:
        raise SizingError(
            f"two_point of {body.name}: its centre of mass is not between {joints[0]} and {joints[1]}: one of the two "
            f"point masses would be {min(share, total - share):.4g} kg: choose other joints"
        )
    shares = {joints[0]: total - share, joints[1]: share}
    return ForceBalance(body.name, reduced.tree[body.name], loads, counters, shares, np.zeros(2))


def solve_force_balance(
    first: Floats, places: Sequence[Place], origin: Point, values: Mapping[str, float], body: str
) -> tuple[CounterMass, ...]:
    """The lightest counter-masses with sum(m* p) = -first (2,) [kg m]: at one place, or at two, which is always enough.

    Raises SizingError where no choice of places can do it.
    """
    if not first.any():
        return ()
    at = [_position(place, origin, first, values) for place in places]
    best: tuple[float, tuple[int, ...], Floats] | None = None
    for count in (1, 2):
        for chosen in combinations(range(len(places)), count):
            matrix = np.array([at[k] for k in chosen]).T
            mass = np.linalg.lstsq(matrix, -first, rcond=1e-12)[0]
            exact = np.abs(matrix @ mass + first).max() <= ROUNDING * 100 * np.abs(first).max()
            if exact and (mass >= 0).all() and (best is None or mass.sum() < best[0] * (1 - 1e-12)):
                best = float(mass.sum()), chosen, mass
    if best is None:
        side = np.degrees(np.arctan2(0.0 - first[1], 0.0 - first[0]))
        known = ", ".join(f"({x:.4g} m, {y:.4g} m)" for x, y in at) or "none"
        raise SizingError(
            f"body {body} needs counter-masses of first moment {np.linalg.norm(first):.4g} kg m about its reduction "
            f"joint, on the side {side:.4g} deg of its frame; its places, from that joint, are {known}: give a place "
            "on that side, two places that enclose it, or counter_mass = { radius = '...' }"
        )
    return tuple(
        CounterMass(places[k], float(m), at[k], places[k].inertia(float(m), values))
        for k, m in zip(best[1], best[2], strict=True)
        if m > 0
    )


def _position(place: Place, origin: Point, first: Floats, values: Mapping[str, float]) -> Floats:
    if place.point is not None:
        return place.point.plus(origin, -1.0).at(values)
    assert place.radius is not None
    return -place.radius.at(values) * first / np.linalg.norm(first)


def check_point_mass(linkage: Linkage, force: ForceBalance, extra: ForceBalance) -> None:
    """Raise SizingError where a translating body is no point mass at its joint for the moment too.

    It is one where its centre of mass lies in that joint, or on the line along which that joint slides.
    """
    first, mass = force.residual + extra.residual, force.mass + extra.mass
    off = float(np.linalg.norm(first))
    scale = mass * max((float(np.linalg.norm(c.position)) for c in force.counters), default=0.0) + off
    slides = [j for j in linkage.joints_of(force.body, revolute=False) if j.other(force.body) == GROUND]
    if slides:
        along = slides[0].end(force.body).along
        off = abs(float(np.cos(along) * first[1] - np.sin(along) * first[0]))
    if off > 1e-12 * scale:
        raise SizingError(
            f"body {force.body} only translates, and its centre of mass moves {off / mass:.4g} m off its joint "
            f"{force.joint}: its moment would remain; give it a counter_mass"
        )
