"""Counter-masses of any mass within limits, and the first-moment residual of any counter-masses.

A mass m at a site adds m times a constant column to the conditions: ``A pi + B m = 0``, m >= 0, in least squares.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from ..arrays import Floats
from ..errors import SizingError
from ..mechanism.mechanism import Mechanism, Site
from .conditions import Conditions
from .stock_plates import Plate

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
    """Counter-masses for a mechanism, and their residual."""

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
    residual = float(np.abs(without + per_kilogram * mass).max())
    return mass if mass > 0.0 and residual <= BALANCES * float(np.abs(per_kilogram).max()) * mass else None


def sizing_of_given(
    conditions: Conditions,
    mechanism: Mechanism,
    masses: Mapping[str, float],
    plates: Mapping[str, Sequence[Plate]] | None = None,
) -> Sizing:
    """Given counter-masses [kg] by site, with the plates of each, on ``mechanism``, which is without them."""
    found = []
    for name, mass in masses.items():
        site, stack = mechanism.site(name), (plates or {}).get(name, ())
        names = tuple(plate.name for plate in stack)
        found.append(CounterMass(name, float(mass), site.position, names, _inertia_of_stack(stack, site)))
    return Sizing(conditions, mechanism, tuple(found), mechanism.payload_bodies)


def _inertia_of_stack(stack: Sequence[Plate], site: Site) -> float | None:
    """Plates on one axis, their centres at the site; one that is not drawn has the site's radius of gyration."""
    if all(plate.inertia is None for plate in stack):
        return None
    square = site.radius_of_gyration**2
    return sum(plate.mass * square if plate.inertia is None else plate.inertia for plate in stack)


def _inertia_about_joint(mechanism: Mechanism, name: str) -> float:
    site = mechanism.site(name)
    xx, xy, yy, xz, yz, zz = site.unit_mass()[4:]
    axis = mechanism.tree.joints[mechanism.tree.bodies[site.body]].axis
    return float(axis @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axis)


def sizing_document(result: Sizing) -> dict[str, Any]:
    """Counter-masses and their residual, for JSON: units in the keys."""
    return {
        "mechanism": result.before.name,
        "counter_masses": [
            {
                "site": c.site,
                "mass_kg": c.mass,
                "position_m": [float(x) for x in c.position],
                "first_moment_kgm": [float(x) for x in c.first_moment],
                "plates": list(c.plates),
            }
            for c in result.counter_masses
        ],
        "residual_first_moment_kgm": result.residual(),
        "residual_percent": result.residual_percent(),
        "balanced_payload_kg": result.balanced_payloads(),
        "added_mass_kg": result.added_mass,
        "added_inertia_kgm2": result.added_inertia,
    }


_DEPENDENT = 1e-12
"""Singular value of the sites' columns, relative to the largest, below which sites are equivalent."""
_TIES = 1e-5
"""Weight of squares relative to masses: sites whose levers differ by more are not equivalent."""


def chosen_sites(mechanism: Mechanism, sites: Sequence[str]) -> list[str]:
    """The sites named, or those that the file names counter...; SizingError if there is none."""
    names = list(dict.fromkeys(sites)) or mechanism.counter_sites
    if not names:
        raise SizingError(
            f"{mechanism.name} has no site named counter...: name the sites for counter-masses, "
            f"there are {', '.join(mechanism.sites) or 'none in the file'}"
        )
    for name in names:
        mechanism.with_counter_mass({name: 0.0})
    return names


def sizing_system(conditions: Conditions, mechanism: Mechanism, names: Sequence[str]) -> tuple[Floats, Floats]:
    """B (rank, sites) [m] and the target -A pi (rank,) [kg m] of B m = -A pi."""
    return site_columns(conditions, mechanism, names), -conditions.values(mechanism)


def site_columns(conditions: Conditions, mechanism: Mechanism, names: Sequence[str]) -> Floats:
    """Change of each condition per kilogram at each site, (rank, sites) [m]."""
    added = [mechanism.with_counter_mass({name: 1.0}).pi - mechanism.pi for name in names]
    return np.array([conditions.matrix @ one for one in added]).T


@dataclass(frozen=True)
class MassDistribution:
    """Masses at sites."""

    masses: Floats
    """(sites,) [kg]"""
    per_target: Floats
    """How they change with the target, sites that are at a bound staying there, (sites, rank) [1/m]."""


def distribute_masses(
    columns: Floats, target: Floats, upper: Floats | None = None, *, removable: bool = False
) -> MassDistribution:
    """Masses m for B m = target, B (rank, sites) [m], in least squares; of equals the least mass, then least squares.

    Each between zero and its ``upper`` (sites,) [kg]; ``removable`` ones may be negative, as far as is added otherwise.
    The answer is unique. Raises SizingError where the solver does not converge.
    """
    count = columns.shape[1]
    if not columns.any():
        return MassDistribution(np.zeros(count), np.zeros(columns.T.shape))
    most = np.full(count, np.inf) if upper is None else upper
    least = -most if removable else np.zeros(count)
    masses = np.linalg.lstsq(columns, target, rcond=_DEPENDENT)[0]
    if not removable:
        masses = _bounded(columns, target, most)
    if np.linalg.matrix_rank(columns, rtol=_DEPENDENT) < count:
        masses = _lightest(columns, columns @ masses, least, most)
    free = (masses > least) & (masses < most) & ((masses != 0.0) | (np.linalg.matrix_rank(columns) == count))
    per_target = np.zeros(columns.T.shape)
    per_target[free] = np.linalg.pinv(columns[:, free], rcond=_DEPENDENT)
    polished = np.where(free, 0.0, masses)
    polished = polished + per_target @ (target - columns @ polished)
    inside = ((polished >= least) & (polished <= most)).all()
    return MassDistribution(polished if inside else masses, per_target)


def _bounded(columns: Floats, target: Floats, upper: Floats) -> Floats:
    """Least squares with masses between zero and ``upper``."""
    free, masses = upper > 0.0, np.zeros(len(upper))
    if not free.any():
        return masses
    solution = lsq_linear(columns[:, free], target, bounds=(0.0, upper[free]), method="bvls", tol=1e-15)
    if not solution.success:
        raise SizingError(f"counter-masses did not converge: {solution.message}")
    masses[free] = solution.x
    return masses


def _lightest(columns: Floats, made: Floats, least: Floats, most: Floats) -> Floats:
    """Of all masses with B m = ``made`` the lightest, of these the least in squares.

    min sum(p + n) + e (p - n)^2 / 2 of m = p - n, which for a small enough e is the answer of both, one after the
    other (Mangasarian, Meyer, SIAM J. Control Optim. 17, 1979).
    """
    import clarabel
    from scipy import sparse

    count = len(least)
    size = max(float(np.abs(made).max(initial=0.0)) / float(np.abs(columns).max()), 1e-12)
    ends = np.concatenate([np.minimum(most, 1e9 * size), np.minimum(-least, 1e9 * size)]) / size
    unit = np.eye(2 * count)
    both = np.hstack([columns, -columns]) / np.abs(columns).max()
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    bounded = ends < 1e9
    sides = np.vstack([both, unit[bounded], -unit])
    right = np.concatenate([made / np.abs(columns).max() / size, ends[bounded], np.zeros(2 * count)])
    cones = [clarabel.ZeroConeT(len(made)), clarabel.NonnegativeConeT(int(bounded.sum()) + 2 * count)]
    cost = sparse.csc_matrix(np.triu(_TIES * np.kron([[1.0, -1.0], [-1.0, 1.0]], np.eye(count))))
    solver = clarabel.DefaultSolver(cost, np.ones(2 * count), sparse.csc_matrix(sides), right, cones, settings)
    solution = solver.solve()
    if str(solution.status) not in {"Solved", "AlmostSolved"}:
        raise SizingError(f"counter-masses did not converge: the conic solver stopped at {solution.status}")
    parts = np.asarray(solution.x)
    masses = size * (parts[:count] - parts[count:])
    near = 1e-6 * max(float(np.abs(masses).max(initial=0.0)), size)
    masses = np.where(masses > most - near, most, np.where(masses < least + near, least, masses))
    return np.where(np.abs(masses) < near, 0.0, masses)


def exact_sizing(
    conditions: Conditions, mechanism: Mechanism, sites: Sequence[str] = (), limits: Mapping[str, float] | None = None
) -> Sizing:
    """Counter-masses of any mass at ``sites`` (default: those named counter...) of least residual.

    Least squares over the conditions, each mass between zero and its limit [kg]; of equals the lightest, then least
    squares of the masses. Raises SizingError if there is no site or the solver does not converge.
    """
    names = chosen_sites(mechanism, sites)
    if unused := [name for name in limits or {} if name not in names]:
        raise SizingError(f"the limit at {unused[0]!r} has no effect: counter-masses are sized at {', '.join(names)}")
    columns, target = sizing_system(conditions, mechanism, names)
    upper = np.array([(limits or {}).get(name, np.inf) for name in names])
    for name, limit in zip(names, upper, strict=True):
        if not limit >= 0.0:
            raise SizingError(f"the limit at {name!r} is {limit:g} kg: expected zero or more")
    masses = distribute_masses(columns, target, upper).masses
    return sizing_of_given(conditions, mechanism, dict(zip(names, masses, strict=True)))


def nested_exact_sizing(
    conditions: Conditions, mechanisms: Sequence[Mechanism], sites: Sequence[str] = ()
) -> tuple[Sizing, ...]:
    """Exact counter-masses for each of ``mechanisms`` (one mechanism, payloads rising), as sets that only grow.

    Raises SizingError where a counter-mass would have to shrink: then no such sets are exact.
    """
    found = tuple(exact_sizing(conditions, mechanism, sites) for mechanism in mechanisms)
    for lighter, heavier in pairwise(found):
        for less, more in zip(lighter.counter_masses, heavier.counter_masses, strict=True):
            if more.mass < less.mass * (1.0 - 1e-12):
                raise SizingError(
                    f"the counter-mass at {less.site!r} would have to shrink from {less.mass:.4f} to {more.mass:.4f} "
                    "kg as the payload grows: no sets that only grow are exact; size each payload by itself"
                )
    return found
