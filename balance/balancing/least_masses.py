"""Masses at sites of least square error: of any mass within limits, the least of all proven.

|columns m - target|^2 is convex in the masses m; every answer comes with how far it may be above the least of all. Of
equals the lightest, and of those the least in squares, so that the answer is unique.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, conic_optimum
from ..errors import SizingError

_DEPENDENT = 1e-10
"""Singular value of the sites' columns, each of length 1, below which sites are equivalent."""
_ROUNDING = 1e-14
_AT_BOUND = 1e-12
"""Distance from a bound, in effect and relative to the target, that is rounding of the solver: the mass is at it."""
_LEVEL = 1e-9
"""Slope, relative to the target, that holds no mass at its bound: equals are sought among sites without one."""
_TIES = 1e-5
"""Weight of squares relative to masses: sites whose levers differ by more are not equivalent."""
_STIFF = 3.0
"""Weight of a total's error relative to that of the target: a step divides that error by about its square."""
_STEPS = 100
"""Most steps of the method of multipliers; what they do not settle shows in the gap."""


@dataclass(frozen=True)
class MassDistribution:
    """Masses at sites."""

    masses: Floats
    """(sites,) [kg]"""
    per_target: Floats
    """How they change with the target, sites that are at a bound staying there, (sites, rows) [kg / unit of target]."""
    gap: float
    """By how much the square error may exceed the least of all [square of the target's unit]."""


def distribute_masses(
    columns: Floats,
    target: Floats,
    upper: Floats | None = None,
    *,
    removable: bool = False,
    cost: Floats | None = None,
) -> MassDistribution:
    """Masses m with columns (rows, sites) m = target (rows,), in least squares; of equals the lightest.

    Each between zero and its ``upper`` (sites,) [kg]; ``removable`` ones may be negative, as far as is added otherwise.
    ``cost`` (sites,) [-]: what a kilogram counts where the lightest is chosen, one by default.
    Raises SizingError where the solver does not converge.
    """
    count = columns.shape[1]
    size = np.linalg.norm(columns, axis=0)
    if not size.any():
        return MassDistribution(np.zeros(count), np.zeros(columns.T.shape), 0.0)
    most = np.full(count, np.inf) if upper is None else upper
    least = -most if removable else np.zeros(count)
    size = np.where(size > _DEPENDENT * size.max(), size, size.max())
    unit = columns / size
    masses = np.linalg.lstsq(unit, target, rcond=_DEPENDENT)[0] / size
    if not removable and not ((masses >= 0.0) & (masses <= most)).all():
        masses = _bounded(unit, target, most * size) / size
        masses = np.where(masses >= most * (1.0 - _ROUNDING), most, masses)
    unique = np.linalg.matrix_rank(unit, rtol=_DEPENDENT) == count
    if not unique:
        slope = np.abs(unit.T @ (unit @ (masses * size) - target))
        even = (slope <= _LEVEL * float(np.linalg.norm(target))) | (masses > least) & (masses < most)
        if even.any() and np.linalg.matrix_rank(unit[:, even], rtol=_DEPENDENT) < even.sum():
            worth = np.ones(count) if cost is None else cost
            masses[even] = _lightest(columns[:, even], masses[even], least[even], most[even], worth[even])
    free = (masses > least) & (masses < most) & ((masses != 0.0) | unique)
    per_target = np.zeros(columns.T.shape)
    if unique:
        per_target[free] = np.linalg.pinv(unit[:, free]) / size[free, None]
    else:
        per_target[free] = np.linalg.pinv(columns[:, free], rcond=_DEPENDENT)
    polished = np.where(free, 0.0, masses)
    polished = polished + per_target @ (target - columns @ polished)
    polished = polished + per_target @ (target - columns @ polished)
    masses = polished if ((polished >= least) & (polished <= most)).all() else masses
    gradient = 2.0 * unit.T @ (unit @ (masses * size) - target)
    return MassDistribution(masses, per_target, _gap(unit, gradient, masses <= least, masses >= most))


def distribute_within(
    columns: Floats, target: Floats, upper: Floats, weights: Floats, totals: Floats
) -> tuple[Floats, Floats, float]:
    """Masses (sites,) [kg] of least J = |columns m - target|^2 with ``weights`` (sums, sites) m <= ``totals`` besides.

    With them the price of each total [kg], (sums,), and by how much J may exceed the least of all [square of the
    target's unit]. The price p is its multiplier: J + p (weights m - totals) has its least there without the totals.
    With a slack s of each as further unknowns, weights m + s = totals: the method of multipliers, each step of
    which is a least-squares problem (Hestenes, J. Optim. Theory Appl. 4, 1969).
    """
    upper = np.where(((weights > 0.0) & (totals[:, None] <= 0.0)).any(axis=0), 0.0, upper)
    best = distribute_masses(columns, target, upper)
    prices: Floats = np.zeros(len(totals))
    if (weights @ best.masses <= totals).all():
        return best.masses, prices, best.gap
    count, before = columns.shape[1], np.full(len(totals), np.inf)
    size = _STIFF * np.linalg.norm(columns, axis=0).max() / np.linalg.norm(weights, axis=1)
    most, cost = np.append(upper, np.full(len(totals), np.inf)), np.append(np.ones(count), np.zeros(len(totals)))
    found: tuple[Floats, Floats, float] = np.zeros(count), prices, float(target @ target)
    for _ in range(_STEPS):
        rows = np.block([[columns, np.zeros((len(columns), len(totals)))], [size[:, None] * weights, np.diag(size)]])
        right = np.append(target, size * totals - 0.5 * prices / size)
        masses, slack = np.split(distribute_masses(rows, right, most, cost=cost).masses, [count])
        excess = weights @ masses + slack - totals
        prices = np.where(slack > 0.0, 0.0, np.maximum(prices + 2.0 * size**2 * excess, 0.0))
        one = _feasible(columns, target, upper, weights, totals, masses, prices)
        found = one if one[2] <= max(found[2], _ROUNDING * float(target @ target)) else found
        if (np.abs(excess) <= _ROUNDING * (np.abs(weights) @ masses + totals)).all():
            break
        size, before = np.where(np.abs(excess) > 0.25 * before, 10.0 * size, size), np.abs(excess)
    return found


def _feasible(
    columns: Floats, target: Floats, upper: Floats, weights: Floats, totals: Floats, masses: Floats, prices: Floats
) -> tuple[Floats, Floats, float]:
    """``masses`` (sites,) [kg] that keep the totals to the last bit, ``prices`` (sums,) as their free sites have them,
    and the gap of both: what ``distribute_within`` gives.
    """
    free = (masses > 0.0) & (masses < upper)
    for weight, total in zip(weights, totals, strict=True):
        part, fixed = weight @ (masses * free), weight @ (masses * ~free)
        if part + fixed > total:
            share = max(total - fixed, 0.0) / part * (1.0 - 2.0**-52) if part > 0.0 else 0.0
            masses = np.where(free & (weight > 0.0), masses * share, masses)
            if fixed > total:
                masses = np.where(~free & (weight > 0.0), masses * (total / fixed * (1.0 - 2.0**-52)), masses)
    length = np.linalg.norm(columns, axis=0)
    length = np.where(length > _DEPENDENT * length.max(), length, length.max())
    gradient, used = 2.0 * columns.T @ (columns @ masses - target), prices > 0.0
    sides = (weights[used] / length)[:, free].T
    if len(sides) and np.linalg.matrix_rank(sides) == used.sum():
        prices = prices.copy()
        prices[used] = np.linalg.lstsq(sides, -(gradient / length)[free])[0].clip(min=0.0)
    gap = _gap(columns / length, (gradient + prices @ weights) / length, masses <= 0.0, masses >= upper)
    return masses, prices, gap + float(prices @ (totals - weights @ masses).clip(min=0.0))


def _gap(unit: Floats, gradient: Floats, low: NDArray[np.bool_], high: NDArray[np.bool_]) -> float:
    """How far |unit x - target|^2 may be above its least within the bounds: J(x + d) = J(x) + g d + |unit d|^2.

    Parts of the gradient g that hold x at a bound, ``low`` or ``high``, add nothing below zero; the others, w, at most
    |pinv(unit') w|^2 / 4.
    """
    wrong = np.where(low & (gradient > 0.0) | high & (gradient < 0.0), 0.0, gradient)
    return float(np.sum((np.linalg.pinv(unit.T, rcond=_DEPENDENT) @ wrong) ** 2)) / 4.0


def bounded_least_squares(columns: Floats, target: Floats, lower: float | Floats, upper: float | Floats) -> Floats:
    """x (n,) of least |columns x - target|^2 between bounds; columns of like length, ``lower`` below ``upper``.

    Raises SizingError where the active set does not settle.
    """
    from scipy.optimize import lsq_linear  # late: conditions are found without it

    iterations = 100 + 10 * columns.shape[1]  # scipy's own, n, are too few where bounds are met and left again
    found = lsq_linear(columns, target, bounds=(lower, upper), method="bvls", tol=1e-15, max_iter=iterations)
    if not found.success:
        raise SizingError(f"counter-masses did not converge: {found.message}")
    return np.asarray(found.x, dtype=float)


def _bounded(columns: Floats, target: Floats, upper: Floats) -> Floats:
    """Least squares with masses between zero and ``upper``; columns of length 1."""
    free, masses = upper > 0.0, np.zeros(len(upper))
    if free.any():
        masses[free] = bounded_least_squares(columns[:, free], target, 0.0, upper[free])
    near = _AT_BOUND * float(np.linalg.norm(target))
    return np.where(masses <= near, 0.0, np.where(masses >= upper - near, upper, masses))


def _lightest(columns: Floats, like: Floats, least: Floats, most: Floats, cost: Floats) -> Floats:
    """Of all masses that do what those ``like`` (sites,) [kg] do the lightest, of these the least in squares.

    What they do is told by orthonormal rows: of dependent ones rounding leaves no solution.
    min sum(p + n) + e (p - n)^2 / 2 of m = p - n, which for a small enough e is the answer of both, one after the
    other (Mangasarian, Meyer, SIAM J. Control Optim. 17, 1979).
    """
    if not columns.any():
        return np.zeros(len(least))
    length, unit = np.linalg.norm(columns, axis=0), np.eye(len(least))
    length = np.where(length > _DEPENDENT * length.max(), length, length.max())
    _, values, right_vectors = np.linalg.svd(columns / length, full_matrices=False)
    rows = np.linalg.qr((right_vectors[values > _DEPENDENT * values[0]] * length / length.max()).T).Q.T
    made = rows @ like
    signs = np.hstack([unit, -unit[:, least < 0.0]])  # a part that is zero leaves no interior
    size = max(float(np.abs(made).max(initial=0.0)), 1e-12)
    ends = np.minimum(np.append(most, -least[least < 0.0]) / size, 1e9)
    bounded = ends < 1e9
    above = np.eye(len(ends))
    sides = np.vstack([rows @ signs, above[bounded], -above])
    right = np.concatenate([made / size, ends[bounded], np.zeros(len(ends))])
    cones = [("Zero", len(made)), ("Nonnegative", int(bounded.sum()) + len(ends))]
    solution = conic_optimum(np.abs(signs).T @ cost, sides, right, cones, 1e-11, _TIES * signs.T @ signs)
    if str(solution.status) not in {"Solved", "AlmostSolved"}:
        raise SizingError(f"counter-masses did not converge: the conic solver stopped at {solution.status}")
    masses = size * (signs @ np.asarray(solution.x))
    near = 1e-6 * max(float(np.abs(masses).max(initial=0.0)), size)
    masses = np.where(masses > most - near, most, np.where(masses < least + near, least, masses))
    return np.where(np.abs(masses) < near, 0.0, masses)
