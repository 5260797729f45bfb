"""Counter-masses of any mass, within limits: least squares on the conditions."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from scipy.optimize import linprog, lsq_linear

from ..arrays import Floats
from ..conditions import Conditions
from ..errors import SizingError
from ..mechanism import Mechanism
from ..quiet import stdout_discarded
from .result import Sizing, sizing
from .system import chosen_sites, system


def exact(
    conditions: Conditions, mechanism: Mechanism, sites: Sequence[str] = (), limits: Mapping[str, float] | None = None
) -> Sizing:
    """Counter-masses of any mass at ``sites`` (default: those named counter...) that leave the least residual.

    Least squares over the conditions, each mass between zero and its limit [kg]; where that leaves a choice, the
    lightest. Raises SizingError if there is no site or the solver does not converge.
    """
    names = chosen_sites(mechanism, sites)
    if unused := [name for name in limits or {} if name not in names]:
        raise SizingError(f"the limit at {unused[0]!r} limits nothing: counter-masses go to {', '.join(names)}")
    columns, target = system(conditions, mechanism, names)
    upper = np.array([(limits or {}).get(name, np.inf) for name in names])
    for name, limit in zip(names, upper, strict=True):
        if not limit >= 0.0:
            raise SizingError(f"the limit at {name!r} is {limit:g} kg: expected zero or more")
    masses, free = np.zeros(len(names)), upper > 0.0
    if free.any():
        masses[free] = _least_squares(columns[:, free], target, upper[free])
    return sizing(conditions, mechanism, dict(zip(names, masses, strict=True)), {})


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


def _least_squares(columns: Floats, target: Floats, upper: Floats) -> Floats:
    """Masses between zero and ``upper`` that leave the least; the lightest of them where there is a choice."""
    if np.linalg.matrix_rank(columns) < columns.shape[1]:
        return _lightest(columns, target, upper)
    solution = lsq_linear(columns, target, bounds=(0.0, upper), method="bvls", tol=1e-15)
    if not solution.success:
        raise SizingError(f"counter-masses did not converge: {solution.message}")
    return _polished(columns, target, solution.x, upper)


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
