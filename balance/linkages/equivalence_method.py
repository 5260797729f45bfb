"""The equivalence method of Z. Ye and M. R. Smith: counter-masses and gears that balance a planar linkage.

Its result gives every number by symbol, the interval that the rounding of the inputs allows it, and what every body is
made of in a stage of balancing.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..results import Shown
from .assembly import Assembly, assemble
from .force_balance import CounterMass, ForceBalance, force_balance, joint_point, reduction_tree
from .linkage import Linkage
from .moment_balance import MomentBalance, moment_balance

if TYPE_CHECKING:
    import pandas

NOTHING: Mapping[str, Collection[str]] = MappingProxyType({})
"""No terms omitted."""


@dataclass(frozen=True)
class LinkageBalance(Shown, figure="balance.figures.linkage:draw_linkage"):
    """A linkage balanced by the method: force balance, and with gears moment balance."""

    linkage: Linkage
    values: Mapping[str, float]
    """Symbols at which it was computed, SI."""
    tree: Mapping[str, str]
    """Reduction joint of every body."""
    force: Mapping[str, ForceBalance]
    moment: MomentBalance | None

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

    def table(self) -> "pandas.DataFrame":
        """The counter-masses: symbol, body and mass."""
        import pandas

        rows = [(counter.symbol, body, counter.mass) for body, counter in self.counters()]
        return pandas.DataFrame(rows, columns=["symbol", "body", "mass_kg"])

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
    tree = reduction_tree(linkage, at) if tree is None else tree
    force = force_balance(linkage, tree, at)
    complete = bool(linkage.gears or linkage.two_point) if gears is None else gears
    moment = moment_balance(linkage, tree, at, force, omit) if complete else None
    return LinkageBalance(linkage, at, tree, force, moment)


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
            origin = joint_point(linkage, result.tree[body], body).at(values)
            pieces[body].append(CompositeBody(counter.mass, counter.inertia, origin + counter.position))
    if stage == "complete" and result.moment:
        for gear in result.moment.gears.values():
            if gear.wheel_mass:
                at = joint_point(linkage, gear.joint, gear.gear.body).at(values)
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
