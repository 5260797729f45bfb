"""Counter-masses from balance conditions: exact, within limits, and from stock plates.

A counter-mass m at a site adds m times a constant column to the conditions: ``A pi + B m = 0``, m >= 0.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linprog, lsq_linear, milp

from .arrays import Floats
from .conditions import Conditions
from .errors import SizingError
from .mechanism import Mechanism
from .stock import Plate

_UNBALANCE_SCALE = 1e3
"""Unbalance to which a mixed-integer programme is scaled, so that the solver's 1e-6 is 1e-9 of it."""


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
        """The mechanism with the counter-masses mounted."""
        return self.before.with_counter_mass({c.site: c.mass for c in self.counter_masses})

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
        return sum(c.mass * _inertia_about_joint(self.before, c.site) for c in self.counter_masses)

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
    if np.linalg.matrix_rank(columns) < len(names):
        masses = _lightest(columns, target, upper)
    else:
        solution = lsq_linear(columns, target, bounds=(0.0, upper), method="bvls", tol=1e-15)
        if not solution.success:
            raise SizingError(f"counter-masses did not converge: {solution.message}")
        masses = _polished(columns, target, solution.x, upper)
    return _sizing(conditions, mechanism, dict(zip(names, masses, strict=True)), {})


def from_stock(
    conditions: Conditions, mechanism: Mechanism, plates: Sequence[Plate], sites: Sequence[str] = ()
) -> Sizing:
    """The plates at each site that leave the least first-moment residual; among equals the lightest.

    A mixed-integer programme solved to proven optimality; a plate's quantity is for all sites together.
    """
    names = _sites(mechanism, sites)
    columns, target = _system(conditions, mechanism, names)
    scale = _UNBALANCE_SCALE / max(float(np.abs(target).max()), 1e-12)
    masses = np.array([plate.mass for plate in plates])
    effect = scale * np.kron(columns, masses)
    best = _programme(effect, scale * target, plates, len(names), None)
    least = float(np.abs(effect @ best.ravel() - scale * target).max())
    best = _programme(effect, scale * target, plates, len(names), least * (1.0 + 1e-9) + 1e-6)
    chosen = {
        name: tuple(p.name for p, count in zip(plates, row, strict=True) for _ in range(count))
        for name, row in zip(names, best, strict=True)
    }
    return _sizing(conditions, mechanism, dict(zip(names, best @ masses, strict=True)), chosen)


def given(conditions: Conditions, mechanism: Mechanism, masses: Mapping[str, float]) -> Sizing:
    """What counter-masses that are given leave; ``mechanism`` is the one without them [kg]."""
    return _sizing(conditions, mechanism, masses, {})


def balanced_payload(conditions: Conditions, mechanism: Mechanism, body: str) -> float | None:
    """Mass of ``body`` for which the conditions are met best, in least squares [kg]; None if there is no such mass."""
    share = mechanism.own_mass[body][1] / mechanism.mass(body)
    row = np.zeros_like(mechanism.parameters)
    row[mechanism.body_index(body)] = share
    per_kilogram = conditions.matrix @ row.ravel()
    if not np.abs(per_kilogram).max(initial=0.0) > 0.0:
        return None
    without = conditions.values(mechanism) - per_kilogram * mechanism.mass(body)
    mass = -float(per_kilogram @ without / (per_kilogram @ per_kilogram))
    return mass if mass > 0.0 else None


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
    first = linprog(np.r_[np.zeros(count), 1.0], sides, np.r_[target, -target], bounds=bounds)
    if not first.success:
        raise SizingError(f"counter-masses did not converge: {first.message}")
    bounds[-1] = (0.0, float(np.asarray(first.x)[-1]) * (1 + 1e-9) + 1e-12)
    second = linprog(np.r_[np.ones(count), 0.0], sides, np.r_[target, -target], bounds=bounds)
    if not second.success:
        raise SizingError(f"counter-masses did not converge: {second.message}")
    lightest = np.asarray(second.x)
    return _polished(columns, target, lightest[:-1].clip(0.0), upper)


def _programme(
    effect: Floats, target: Floats, plates: Sequence[Plate], sites: int, within: float | None
) -> "np.ndarray[tuple[int, int], np.dtype[np.int64]]":
    """Plates at each site, (sites, plates): least t with |effect x - target| <= t, or least mass with t ``within``."""
    quantity = np.array([plate.quantity for plate in plates], dtype=float)
    mass = np.array([plate.mass for plate in plates])
    count = sites * len(plates)
    cost = np.r_[np.zeros(count), 1.0] if within is None else np.r_[np.tile(mass, sites), 0.0]
    ones = np.ones((len(effect), 1))
    rows = [
        LinearConstraint(np.hstack([effect, -ones]), -np.inf, target),
        LinearConstraint(np.hstack([effect, ones]), target, np.inf),
        LinearConstraint(np.hstack([np.tile(np.eye(len(plates)), sites), np.zeros((len(plates), 1))]), 0.0, quantity),
    ]
    upper = np.r_[np.tile(quantity, sites), np.inf if within is None else within]
    integrality = np.r_[np.ones(count), 0.0]
    solution = milp(
        cost, constraints=rows, integrality=integrality, bounds=Bounds(0.0, upper), options={"mip_rel_gap": 0.0}
    )
    if not solution.success:
        raise SizingError(f"no proven best set of plates: {solution.message}")
    return np.rint(np.asarray(solution.x)[:-1]).astype(np.int64).reshape(sites, len(plates))


def _inertia_about_joint(mechanism: Mechanism, name: str) -> float:
    site = mechanism.site(name)
    xx, xy, yy, xz, yz, zz = site.unit_mass()[4:]
    axis = mechanism.tree.joints[mechanism.tree.bodies[site.body]].axis
    return float(axis @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axis)


def _sizing(
    conditions: Conditions, mechanism: Mechanism, masses: Mapping[str, float], plates: Mapping[str, tuple[str, ...]]
) -> Sizing:
    found = tuple(
        CounterMass(name, float(mass), mechanism.site(name).position, plates.get(name, ()))
        for name, mass in masses.items()
    )
    return Sizing(conditions, mechanism, found, mechanism.payload_bodies)
