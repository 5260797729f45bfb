"""Counter-masses, and what they leave."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Floats
from ..conditions import Conditions
from ..mechanism import Mechanism, Site
from ..stock import Plate

BALANCES = 0.01
"""Residual, relative to the payload's own first moment, up to which a payload counts as balanced."""


@dataclass(frozen=True)
class CounterMass:
    """A counter-mass at a site."""

    site: str
    mass: float
    """[kg]"""
    position: Floats
    """Position of the site in its body's frame, (3,) [m]."""
    plates: tuple[str, ...] = ()
    """Stock plates that it is made of."""
    inertia: float | None = None
    """About the axis through its own centre, normal to its plates, from the plates as drawn [kg m2].

    None where no plate is drawn: then the site's radius of gyration holds.
    """

    @property
    def first_moment(self) -> Floats:
        """First moment of mass about the body's joint, (3,) [kg m]."""
        return self.mass * self.position


@dataclass(frozen=True)
class Sizing:
    """Counter-masses for a mechanism, and what they leave."""

    conditions: Conditions
    before: Mechanism
    """The mechanism without counter-masses."""
    counter_masses: tuple[CounterMass, ...]
    payload_bodies: tuple[str, ...] = field(default=())

    @property
    def after(self) -> Mechanism:
        """The mechanism with the counter-masses mounted, each with its own inertia."""
        return self._as_made.with_counter_mass({c.site: c.mass for c in self.counter_masses})

    @property
    def _as_made(self) -> Mechanism:
        """Without counter-masses, its sites with the radii of gyration of the plates that go there."""
        drawn = {c.site: c.inertia / c.mass for c in self.counter_masses if c.inertia is not None and c.mass > 0.0}
        sites = {
            name: replace(self.before.site(name), radius_of_gyration=square**0.5) for name, square in drawn.items()
        }
        return replace(self.before, sites={**self.before.sites, **sites}) if sites else self.before

    def residual(self) -> float:
        """First-moment residual: largest absolute value of the conditions [kg m]."""
        return self.conditions.residual(self.after)

    def residual_percent(self) -> float | None:
        """Residual in per cent of that without counter-masses; None where there is nothing to balance."""
        whole = self.conditions.residual(self.before)
        return 100.0 * self.residual() / whole if whole > 0.0 else None

    def is_balanced(self, tol: float) -> bool:
        """Whether the first-moment residual is at most ``tol`` [kg m]."""
        return self.residual() <= tol

    @property
    def added_mass(self) -> float:
        """Mass of all counter-masses [kg]."""
        return sum(c.mass for c in self.counter_masses)

    @property
    def added_inertia(self) -> float:
        """Inertia of all counter-masses about the joint axes of the bodies that carry them [kg m2]."""
        return sum(c.mass * _inertia_about_joint(self._as_made, c.site) for c in self.counter_masses)

    def balanced_payloads(self) -> dict[str, float | None]:
        """For each payload body, the payload that these counter-masses balance best [kg]; None where there is none."""
        return {body: balanced_payload(self.conditions, self.after, body) for body in self.payload_bodies}


def balanced_payload(conditions: Conditions, mechanism: Mechanism, body: str) -> float | None:
    """Mass of ``body`` that the rest balances, by least squares [kg]; None if none meets the conditions (BALANCES)."""
    share = mechanism.own_mass[body][1] / mechanism.mass(body)
    row = np.zeros_like(mechanism.parameters)
    row[mechanism.body_index(body)] = share
    per_kilogram = conditions.matrix @ row.ravel()
    if not np.abs(per_kilogram).max(initial=0.0) > 0.0:
        return None
    without = conditions.values(mechanism) - per_kilogram * mechanism.mass(body)
    mass = -float(per_kilogram @ without / (per_kilogram @ per_kilogram))
    left = float(np.abs(without + per_kilogram * mass).max())
    return mass if mass > 0.0 and left <= BALANCES * float(np.abs(per_kilogram).max()) * mass else None


def given(conditions: Conditions, mechanism: Mechanism, masses: Mapping[str, float]) -> Sizing:
    """What counter-masses that are given leave; ``mechanism`` is the one without them [kg]."""
    return sizing(conditions, mechanism, masses, {})


def sizing(
    conditions: Conditions, mechanism: Mechanism, masses: Mapping[str, float], plates: Mapping[str, Sequence[Plate]]
) -> Sizing:
    """What counter-masses [kg] and the plates that they are made of, by site, leave on ``mechanism`` without them."""
    found = []
    for name, mass in masses.items():
        site, pile = mechanism.site(name), plates.get(name, ())
        made_of = tuple(plate.name for plate in pile)
        found.append(CounterMass(name, float(mass), site.position, made_of, _inertia_of(pile, site)))
    return Sizing(conditions, mechanism, tuple(found), mechanism.payload_bodies)


def _inertia_of(pile: Sequence[Plate], site: Site) -> float | None:
    """Plates on one axis, their centres at the site; one that is not drawn has the site's radius of gyration."""
    if all(plate.inertia is None for plate in pile):
        return None
    square = site.radius_of_gyration**2
    return sum(plate.mass * square if plate.inertia is None else plate.inertia for plate in pile)


def _inertia_about_joint(mechanism: Mechanism, name: str) -> float:
    site = mechanism.site(name)
    xx, xy, yy, xz, yz, zz = site.unit_mass()[4:]
    axis = mechanism.tree.joints[mechanism.tree.bodies[site.body]].axis
    return float(axis @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axis)
