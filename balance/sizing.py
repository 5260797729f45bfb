"""Counter-masses from balance conditions: exact, within limits, and from stock plates.

A counter-mass m at a site adds m times a constant column to the conditions: ``A pi + B m = 0``, m >= 0.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import linprog, lsq_linear

from .arrays import Floats, Indices
from .conditions import Conditions
from .errors import SizingError
from .mechanism import Mechanism, Site
from .quiet import stdout_discarded
from .setsearch import best_sets
from .stock import Plate

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


def exact(
    conditions: Conditions, mechanism: Mechanism, sites: Sequence[str] = (), limits: Mapping[str, float] | None = None
) -> Sizing:
    """Counter-masses of any mass at ``sites`` (default: those named counter...) that leave the least residual.

    Least squares over the conditions, each mass between zero and its limit [kg]; where that leaves a choice, the
    lightest. Raises SizingError if there is no site or the solver does not converge.
    """
    names = _sites(mechanism, sites)
    if unused := [name for name in limits or {} if name not in names]:
        raise SizingError(f"the limit at {unused[0]!r} limits nothing: counter-masses go to {', '.join(names)}")
    columns, target = _system(conditions, mechanism, names)
    upper = np.array([(limits or {}).get(name, np.inf) for name in names])
    for name, limit in zip(names, upper, strict=True):
        if not limit >= 0.0:
            raise SizingError(f"the limit at {name!r} is {limit:g} kg: expected zero or more")
    masses, free = np.zeros(len(names)), upper > 0.0
    if free.any():
        masses[free] = _least_squares(columns[:, free], target, upper[free])
    return _sizing(conditions, mechanism, dict(zip(names, masses, strict=True)), {})


def _least_squares(columns: Floats, target: Floats, upper: Floats) -> Floats:
    """Masses between zero and ``upper`` that leave the least; the lightest of them where there is a choice."""
    if np.linalg.matrix_rank(columns) < columns.shape[1]:
        return _lightest(columns, target, upper)
    solution = lsq_linear(columns, target, bounds=(0.0, upper), method="bvls", tol=1e-15)
    if not solution.success:
        raise SizingError(f"counter-masses did not converge: {solution.message}")
    return _polished(columns, target, solution.x, upper)


def from_stock(
    conditions: Conditions, mechanism: Mechanism, plates: Sequence[Plate], sites: Sequence[str] = ()
) -> Sizing:
    """The plates at each site that leave the least first-moment residual; among equals the lightest.

    A mixed-integer programme solved to proven optimality; a plate's quantity is for all sites together.
    """
    return nested_from_stock(conditions, [mechanism], plates, sites)[0]


def nested_from_stock(
    conditions: Conditions, mechanisms: Sequence[Mechanism], plates: Sequence[Plate], sites: Sequence[str] = ()
) -> tuple[Sizing, ...]:
    """A set of plates for each of ``mechanisms`` (one mechanism, payloads rising), each set holding the one before it.

    Least, one after the other: the largest first-moment residual of all, their sum, the mass of all sets; proven.
    """
    names = _sites(mechanisms[0], sites)
    systems = [_system(conditions, mechanism, names) for mechanism in mechanisms]
    masses = np.array([plate.mass for plate in plates])
    quantities = np.array([plate.quantity for plate in plates], dtype=float)
    counts = best_sets(systems[0][0], np.array([target for _, target in systems]), masses, quantities)
    return tuple(
        _sizing(conditions, mechanism, dict(zip(names, rows @ masses, strict=True)), _piles(names, rows, plates))
        for mechanism, rows in zip(mechanisms, counts, strict=True)
    )


def nested_exact(
    conditions: Conditions, mechanisms: Sequence[Mechanism], sites: Sequence[str] = ()
) -> tuple[Sizing, ...]:
    """Exact counter-masses for each of ``mechanisms`` (one mechanism, payloads rising), as sets that only grow.

    Raises SizingError where a counter-mass would have to shrink: then no such sets are exact.
    """
    found = tuple(exact(conditions, mechanism, sites) for mechanism in mechanisms)
    for lighter, heavier in pairwise(found):
        for less, more in zip(lighter.counter_masses, heavier.counter_masses, strict=True):
            if more.mass < less.mass * (1.0 - 1e-12):
                raise SizingError(
                    f"the counter-mass at {less.site!r} would have to shrink from {less.mass:.4f} to {more.mass:.4f} "
                    "kg as the payload grows: no sets that only grow are exact; size each payload by itself"
                )
    return found


def given(conditions: Conditions, mechanism: Mechanism, masses: Mapping[str, float]) -> Sizing:
    """What counter-masses that are given leave; ``mechanism`` is the one without them [kg]."""
    return _sizing(conditions, mechanism, masses, {})


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


def _sites(mechanism: Mechanism, sites: Sequence[str]) -> list[str]:
    names = list(dict.fromkeys(sites)) or mechanism.counter_sites
    if not names:
        raise SizingError(
            f"{mechanism.name} has no site named counter...: name the sites for counter-masses, "
            f"there are {', '.join(mechanism.sites) or 'none in the file'}"
        )
    for name in names:
        mechanism.with_counter_mass({name: 0.0})
    return names


def _system(conditions: Conditions, mechanism: Mechanism, names: Sequence[str]) -> tuple[Floats, Floats]:
    """B (rank, sites) and the target -A pi (rank,) of B m = -A pi."""
    columns = []
    for name in names:
        added = mechanism.with_counter_mass({name: 1.0}).pi - mechanism.pi
        columns.append(conditions.matrix @ added)
    return np.array(columns).T, -conditions.values(mechanism)


def _polished(columns: Floats, target: Floats, masses: Floats, upper: Floats) -> Floats:
    """The same least squares on the masses that are at no bound, to rounding error."""
    free = (masses > 0.0) & (masses < upper)
    rest = target - columns[:, ~free] @ masses[~free]
    solved = masses.copy()
    solved[free] = np.linalg.lstsq(columns[:, free], rest, rcond=None)[0]
    return solved if (solved >= 0.0).all() and (solved <= upper).all() else masses


def _lightest(columns: Floats, target: Floats, upper: Floats) -> Floats:
    """Of all masses that leave the least largest residual, the lightest."""
    rank, count = columns.shape
    ones = np.ones((rank, 1))
    sides = np.block([[columns, -ones], [-columns, -ones]])
    bounds = [(0.0, None if np.isinf(u) else float(u)) for u in upper] + [(0.0, None)]
    first = _least(np.r_[np.zeros(count), 1.0], sides, np.r_[target, -target], bounds)
    bounds[-1] = (0.0, float(first[-1]) * (1 + 1e-9) + 1e-12)
    lightest = _least(np.r_[np.ones(count), 0.0], sides, np.r_[target, -target], bounds)
    return _polished(columns, target, lightest[:-1].clip(0.0), upper)


def _least(cost: Floats, sides: Floats, limit: Floats, bounds: Sequence[tuple[float, float | None]]) -> Floats:
    with stdout_discarded():
        solution = linprog(cost, sides, limit, bounds=bounds)
    if not solution.success:
        raise SizingError(f"counter-masses did not converge: {solution.message}")
    return np.asarray(solution.x)


def _piles(names: Sequence[str], counts: Indices, plates: Sequence[Plate]) -> dict[str, list[Plate]]:
    """Plates at each site, in the order of the stock; ``counts`` (sites, kinds)."""
    return {
        name: [plate for plate, count in zip(plates, row, strict=True) for _ in range(count)]
        for name, row in zip(names, counts, strict=True)
    }


def _inertia_about_joint(mechanism: Mechanism, name: str) -> float:
    site = mechanism.site(name)
    xx, xy, yy, xz, yz, zz = site.unit_mass()[4:]
    axis = mechanism.tree.joints[mechanism.tree.bodies[site.body]].axis
    return float(axis @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axis)


def _sizing(
    conditions: Conditions, mechanism: Mechanism, masses: Mapping[str, float], plates: Mapping[str, Sequence[Plate]]
) -> Sizing:
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
