"""The conditions as equations for counter-masses: a mass at a site adds so many times a constant column.

``A pi + B m = 0``, m >= 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from ..arrays import Floats
from ..conditions import Conditions
from ..errors import SizingError
from ..mechanism import Mechanism

_DEPENDENT = 1e-12
"""Singular value of the sites' columns, relative to the largest, below which sites do the same."""
_TIES = 1e-5
"""Weight of squares beside masses: sites whose levers differ by more are not alike."""


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


def system(conditions: Conditions, mechanism: Mechanism, names: Sequence[str]) -> tuple[Floats, Floats]:
    """B (rank, sites) [m] and the target -A pi (rank,) [kg m] of B m = -A pi."""
    return site_columns(conditions, mechanism, names), -conditions.values(mechanism)


def site_columns(conditions: Conditions, mechanism: Mechanism, names: Sequence[str]) -> Floats:
    """What a kilogram at each site adds to the value of each condition, (rank, sites) [m]."""
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
        raise SizingError(f"counter-masses did not converge: the conic solver says {solution.status}")
    parts = np.asarray(solution.x)
    masses = size * (parts[:count] - parts[count:])
    near = 1e-6 * max(float(np.abs(masses).max(initial=0.0)), size)
    masses = np.where(masses > most - near, most, np.where(masses < least + near, least, masses))
    return np.where(np.abs(masses) < near, 0.0, masses)
