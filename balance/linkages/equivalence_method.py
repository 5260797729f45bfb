"""The equivalence method of Z. Ye and M. R. Smith: counter-masses and gears that balance a planar linkage.

Its result gives every number by symbol, the interval that the rounding of the inputs allows it, and what every body is
made of in a stage of balancing; ``as_built`` puts in what was built, which is never quite that. ``assemble`` puts the
linkage together: places and angles of its bodies at which all joints close, near those of the description.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import ClosureError, DataError, ModelError
from ..results import Shown
from ..units import parse
from .force_balance import CounterMass, ForceBalance, ReducedLinkage, force_balance, reduction_tree
from .linkage import GROUND, Joint, Linkage
from .moment_balance import GearResult, MomentBalance, moment_balance

NOTHING: Mapping[str, Collection[str]] = MappingProxyType({})
"""No terms omitted."""


@dataclass(frozen=True)
class Assembly:
    """Positions of the bodies: origin [m] and angle [rad] of every body's frame in the base."""

    origin: Mapping[str, Floats]
    angle: Mapping[str, float]

    def point(self, body: str, at: Floats) -> Floats:
        """A point of a body, in its frame (2,) [m], in the base, (2,) [m]."""
        return self.origin[body] + rotated(self.angle[body], at)


def assemble(linkage: Linkage, values: Mapping[str, float]) -> Assembly:
    """Close all joints near the angles under [start], the driven body at its own.

    Raises ModelError where a place on the ground or an angle is not given, ClosureError where it cannot be closed.
    """
    from scipy.optimize import least_squares

    pins: dict[str, list[Floats]] = {name: [] for name in linkage.joints}
    for name, joint in linkage.joints.items():
        for end in joint.ends:
            if end.point is None:
                raise ModelError(
                    f"{linkage.name} cannot be simulated: where joint {name} is on the ground is not given"
                )
            pins[name].append(end.point.at(values))
    if linkage.drive is None:
        raise ModelError(f"{linkage.name} has no driven joint: add drive = 'JOINT'")
    joint = linkage.joint(linkage.drive)
    if not joint.revolute or not joint.joins(GROUND):
        raise ModelError(f"{linkage.name}: the driven joint {joint.name} must be a revolute joint on the ground")
    if unknown := [b for b in linkage.bodies if b not in linkage.start and b not in linkage.translating]:
        raise ModelError(f"{linkage.name}: [start] has no angle of body {unknown[0]}: add it, approximately")
    angles, driven = dict.fromkeys(linkage.bodies, 0.0) | dict(linkage.start), joint.other(GROUND)

    def state(x: Floats) -> Assembly:  # of x, y and angle of each body in turn
        parts = dict(zip(linkage.bodies, x.reshape(-1, 3), strict=True))
        origin = {GROUND: np.zeros(2)} | {name: part[:2] for name, part in parts.items()}
        return Assembly(origin, {GROUND: 0.0} | {name: float(part[2]) for name, part in parts.items()})

    def gaps(x: Floats) -> Floats:
        at = state(x)
        rows = [row for joint in linkage.joints.values() for row in _gaps(joint, at, *pins[joint.name])]
        return np.array([*rows, at.angle[driven] - angles[driven]])

    turned = np.array([[angles[name]] for name in linkage.bodies])

    def placed(p: Floats) -> Floats:  # at the angles under [start]
        return gaps(np.hstack([p.reshape(-1, 2), turned]).ravel())

    places = least_squares(placed, np.zeros(2 * len(turned))).x
    guess = np.hstack([places.reshape(-1, 2), turned]).ravel()
    found = least_squares(gaps, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    size = max([1e-3, *(float(np.abs(p).max()) for pair in pins.values() for p in pair)])
    if not np.abs(found.fun).max() < 1e-7 * size:
        raise ClosureError(
            f"{linkage.name} cannot be closed near the angles under [start]: {np.abs(found.fun).max():.3g} m stays open"
        )
    return state(found.x)


def _gaps(joint: Joint, at: Assembly, first: Floats, second: Floats) -> list[float]:
    """Gaps of a joint: two lengths of a pin; across the line and in direction of a slide."""
    a, b = joint.ends
    gap = at.point(a.body, first) - at.point(b.body, second)
    if joint.revolute:
        return [float(gap[0]), float(gap[1])]
    direction = at.angle[a.body] + a.along
    turn = direction - at.angle[b.body] - b.along
    return [float(np.cos(direction) * gap[1] - np.sin(direction) * gap[0]), float(np.sin(turn))]


def rotated(angle: float, at: Floats) -> Floats:
    """A vector (2,) turned by an angle [rad], (2,) [its unit]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * at[0] - s * at[1], s * at[0] + c * at[1]])


@dataclass(frozen=True)
class LinkageBalance(Shown, ReducedLinkage, rows="rows", figure="balance.figures.linkage:draw_linkage"):
    """A linkage balanced by the method: force balance, and with gears moment balance."""

    force: Mapping[str, ForceBalance]
    moment: MomentBalance | None

    @property
    def gears(self) -> Mapping[str, GearResult]:
        """Gear pairs by name; none where the force alone is balanced."""
        return self.moment.gears if self.moment else {}

    @cached_property
    def start(self) -> Assembly:
        """Its start position. Raises ModelError or ClosureError as ``assemble``."""
        return assemble(self.linkage, self.values)

    def counters(self, stage: str = "complete") -> list[tuple[str, CounterMass]]:
        """Counter-masses with their bodies: those of ``force``, and with ``complete`` those against gears too."""
        counters = [(name, counter) for name, balance in self.force.items() for counter in balance.counters]
        if stage == "complete" and self.moment is not None:
            counters += [(name, c) for name, done in self.moment.bodies.items() for c in done.extra.counters]
        return counters

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The counter-masses: symbol, body and mass."""
        return [{"symbol": one.symbol, "body": body, "mass_kg": one.mass} for body, one in self.counters()]

    def residual(self) -> float:
        """Largest residual first moment of any turning body about its reduction joint [kg m]."""
        moments = [abs(x) for b in self.force.values() if self.linkage.bodies[b.body].places for x in b.residual]
        return float(max(moments, default=0.0))

    def results(self) -> dict[str, float]:
        """Every number that the method gives, by symbol: m2*, I2*, m_z2, I_m_z2, I_z1, point masses, inertias, SI."""
        found: dict[str, float] = {}
        for _, counter in self.counters():
            found[counter.symbol] = counter.mass
            found[f"I{counter.place.name}*"] = counter.inertia
        for name in self.linkage.two_point:
            found |= {f"m[{name} at {joint}]": share for joint, share in self.force[name].shares.items()}
        if self.moment is None:
            return found
        for name in self.linkage.two_point:
            shares = self.moment.bodies[name].extra.shares
            found |= {f"m_z[{name} at {joint}]": share for joint, share in shares.items() if share}
        found |= {f"I[{name}]": body.inertia for name, body in self.moment.bodies.items() if body.terms}
        found |= {f"I{link} reshaped": inertia for link, inertia in self.moment.reshaped.items()}
        for name, gear in self.moment.gears.items():
            found[f"I_{name}"] = gear.inertia
            if gear.wheel_mass:
                found |= {f"m_{name}": gear.wheel_mass, f"I_m_{name}": gear.wheel_inertia}
        return found


def balance_linkage(
    linkage: Linkage,
    values: Mapping[str, float] | None = None,
    gears: bool | None = None,
    omit: Mapping[str, Collection[str]] = NOTHING,
    tree: Mapping[str, str] | None = None,
) -> LinkageBalance:
    """Balance a linkage, with its symbols at ``values``; ``gears`` defaults to whether there are any.

    Raises ModelError or SizingError, naming the body, where the method cannot do it.
    """
    at = linkage.values if values is None else values
    reduced = reduction_tree(linkage, at) if tree is None else ReducedLinkage(linkage, at, tree)
    force = force_balance(reduced)
    complete = bool(linkage.gears or linkage.two_point) if gears is None else gears
    moment = moment_balance(reduced, force, omit) if complete else None
    return LinkageBalance(linkage, at, reduced.tree, force, moment)


@dataclass(frozen=True)
class CompositeBody:
    """A rigid piece in the plane."""

    mass: float
    """[kg]."""
    inertia: float
    """About its own centre of mass [kg m2]."""
    at: Floats
    """Its centre of mass in the body's frame, (2,) [m]."""


def composite_bodies(result: LinkageBalance, stage: str) -> dict[str, list[CompositeBody]]:
    """Pieces of every body in the stage ``before``, ``force`` (counter-masses) or ``complete`` (and gears)."""
    linkage, values = result.linkage, result.values
    reshaped = result.moment.reshaped if result.moment and stage != "before" else {}
    pieces = {
        body.name: [
            CompositeBody(values[p.mass], reshaped.get(p.link, values.get(p.inertia, 0.0)), p.centre.at(values))
            for p in body.parts
        ]
        for body in linkage.bodies.values()
    }
    if stage != "before":
        for body, counter in result.counters(stage):
            origin = result.joint_point(result.tree[body], body).at(values)
            pieces[body].append(CompositeBody(counter.mass, counter.inertia, origin + counter.position))
    for gear in result.gears.values() if stage == "complete" else ():
        if gear.wheel_mass:
            at = result.joint_point(gear.joint, gear.gear.body).at(values)
            pieces[gear.gear.body].append(CompositeBody(gear.wheel_mass, gear.wheel_inertia, at))
    return pieces


def merged_body(pieces: Sequence[CompositeBody]) -> CompositeBody:
    """One rigid body: I = sum(I_cg + m r^2) about the common centre of mass."""
    mass = sum(p.mass for p in pieces)
    centre = sum((p.mass * p.at for p in pieces), np.zeros(2)) / mass
    inertia = sum(p.inertia + p.mass * float((p.at - centre) @ (p.at - centre)) for p in pieces)
    return CompositeBody(mass, inertia, centre)


def rounding_intervals(
    result: LinkageBalance, omit: Mapping[str, Collection[str]] = NOTHING
) -> dict[str, tuple[float, float]]:
    """Interval of every result by the rounding of its inputs, worst cases added, SI.

    Each input is moved by half a unit of its last digit, both ways, on the same tree; ``omit`` as in balance_linkage.
    """
    nominal = result.results()
    low, high = dict(nominal), dict(nominal)
    for name, symbol in result.linkage.symbols.items():
        if symbol.half_unit:
            moved = []
            for half in (-symbol.half_unit, symbol.half_unit):
                values = {**result.values, name: result.values[name] + half}
                geared = result.moment is not None
                moved.append(balance_linkage(result.linkage, values, geared, omit, result.tree).results())
            for key, value in nominal.items():
                changes = [other.get(key, 0.0) - value for other in moved]
                low[key] += min(0.0, *changes)
                high[key] += max(0.0, *changes)
    return {key: (low[key], high[key]) for key in nominal}


Built = str | tuple[int, int]
"""A mass or inertia with its unit, or the teeth of a gear pair, [Z, Z*]."""


def as_built(result: LinkageBalance, built: Mapping[str, Built]) -> LinkageBalance:
    """The linkage with what is stated under its symbol in place of what was computed; nothing else is sized anew.

    Symbols are those of the results and of the file: m3* and I3* of a counter-mass, I_z1 and m_z1* of a counter-gear,
    m_z1 and I_m_z1 of the gear on the body, m3 and I3 of a link; a gear's name for its teeth. A counter-mass whose
    inertia is not stated has that of its shape. Raises DataError for another name, or a value that no body has.
    """
    teeth = {name: pair for name, pair in built.items() if not isinstance(pair, str)}
    gears = result.gears
    parts = [part for body in result.linkage.bodies.values() for part in body.parts]
    known = {*gears, *(part.mass for part in parts), *(part.inertia for part in parts if part.turns)}
    for _, counter in result.counters():
        known |= {counter.symbol, f"I{counter.place.name}*"}
    for name in gears:
        known |= {f"I_{name}", f"m_{name}*", f"m_{name}", f"I_m_{name}"}
    for name, value in built.items():
        if name not in known:
            raise DataError(f"built: {name!r} is none of this linkage: there are {', '.join(sorted(known))}")
        if (name in gears) is isinstance(value, str):
            raise DataError(
                f"built.{name}: expected {'teeth, [Z, Z*]' if name in gears else 'a quantity with its unit'}"
            )
    values = {name: _number(name, text) for name, text in built.items() if isinstance(text, str)}

    def body(balance: ForceBalance) -> ForceBalance:
        return replace(balance, counters=tuple(_counter(c, values, result.values) for c in balance.counters))

    force = {name: body(balance) for name, balance in result.force.items()}
    if result.moment is None:
        return replace(result, values={**result.values, **values}, force=force)
    moment = replace(
        result.moment,
        bodies={name: replace(one, extra=body(one.extra)) for name, one in result.moment.bodies.items()},
        gears={name: _gear(gear, values, teeth) for name, gear in gears.items()},
        reshaped={link: values.get(f"I{link}", inertia) for link, inertia in result.moment.reshaped.items()},
    )
    return replace(result, values={**result.values, **values}, force=force, moment=moment)


def _number(name: str, text: str) -> float:
    value = parse(text, "inertia" if name.startswith("I") else "mass")
    if value < 0.0 or (value == 0.0 and not name.startswith("I")):
        raise DataError(
            f"built.{name}: {text!r}: expected {'zero or more' if name.startswith('I') else 'more than zero'}"
        )
    return value


def _counter(counter: CounterMass, built: Mapping[str, float], values: Mapping[str, float]) -> CounterMass:
    mass, stated = built.get(counter.symbol, counter.mass), built.get(f"I{counter.place.name}*")
    own = counter.inertia if mass == counter.mass else counter.place.inertia(mass, values)
    return replace(counter, mass=mass, inertia=own if stated is None else stated)


def _gear(gear: GearResult, built: Mapping[str, float], teeth: Mapping[str, tuple[int, int]]) -> GearResult:
    name = gear.gear.name
    return replace(
        gear,
        gear=replace(gear.gear, teeth=teeth.get(name, gear.gear.teeth)),
        inertia=built.get(f"I_{name}", gear.inertia),
        counter_mass=built.get(f"m_{name}*", gear.counter_mass),
        wheel_mass=built.get(f"m_{name}", gear.wheel_mass),
        wheel_inertia=built.get(f"I_m_{name}", gear.wheel_inertia),
    )
