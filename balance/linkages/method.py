"""The equivalence method of Z. Ye and M. R. Smith: counter-masses and gears that balance a planar linkage."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from .description import Linkage
from .force import force_balance
from .loads import CounterMass, ForceBalance
from .moment import MomentBalance, moment_balance
from .reduction import reduction_tree

NOTHING: Mapping[str, Collection[str]] = MappingProxyType({})
"""No terms left out."""


@dataclass(frozen=True)
class Balance:
    """A linkage balanced by the method: force balance, and where gears are asked for, moment balance."""

    linkage: Linkage
    values: Mapping[str, float]
    """Symbols at which it was computed, SI."""
    tree: Mapping[str, str]
    """Reduction joint of every body."""
    force: Mapping[str, ForceBalance]
    moment: MomentBalance | None

    def counters(self, stage: str = "complete") -> list[tuple[str, CounterMass]]:
        """Counter-masses with their bodies: those of ``force``, and with ``complete`` those against gears too."""
        found = [(name, counter) for name, balance in self.force.items() for counter in balance.counters]
        if stage == "complete" and self.moment is not None:
            found += [(name, c) for name, done in self.moment.bodies.items() for c in done.extra.counters]
        return found

    def residual(self) -> float:
        """Largest first moment that any body that turns keeps about its reduction joint [kg m]."""
        kept = [abs(x) for b in self.force.values() if self.linkage.bodies[b.body].places for x in b.residual]
        return float(max(kept, default=0.0))

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


def balance(
    linkage: Linkage,
    values: Mapping[str, float] | None = None,
    gears: bool | None = None,
    omit: Mapping[str, Collection[str]] = NOTHING,
    tree: Mapping[str, str] | None = None,
) -> Balance:
    """Balance a linkage, with its symbols at ``values``; ``gears`` defaults to whether there are any.

    Raises ModelError or SizingError, naming the body, where the method cannot do it.
    """
    at = linkage.values if values is None else values
    tree = reduction_tree(linkage, at) if tree is None else tree
    force = force_balance(linkage, tree, at)
    complete = bool(linkage.gears or linkage.two_point) if gears is None else gears
    moment = moment_balance(linkage, tree, at, force, omit) if complete else None
    return Balance(linkage, at, tree, force, moment)
