"""Influence coefficients: what a weight in a plane does to a reading, and the weights that make readings small.

A reading v (a vibration at running speed, as a complex number) is v = v0 + sum_j alpha_j w_j with the weights w_j on
the rotor. Any number of planes, sensors and speeds: each sensor at each speed is a row. Angles of weights and phases
count in one sense, phase as lead (see CONVENTIONS.md). Units are those of the arguments: [r] of readings, [w] of
weights, in SI.

Weights of least squares are solved directly, within limits by SLSQP and proven by the dual problem. The least largest
modulus, or the least sum of moduli, is a minimax of complex residuals: |r| >= Re(r exp(-i psi)) for every psi, with
equality at psi = arg r. A linear programme with some directions psi is a lower bound; the direction of each residual
found is added until the bound meets the cost (cutting planes).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linprog, minimize

from ..arrays import Complexes, Floats
from ..errors import SizingError

METHODS = ("least-squares", "robust", "min-max")
"""Least sum of squares; least sum of moduli, which a single wrong reading moves little; least largest modulus."""
LEAST_EFFECT = 0.25
"""Smallest change of a reading by a trial weight, of the reading before: less is within the scatter of readings."""
_GAP = 1e-8
"""Distance of cost and bound, of the largest initial reading, at which an optimum of cutting planes is proven."""
_PROVEN = 1e-6
"""Likewise of least squares within limits, of the norm of the initial readings."""
_ROUNDS = 100
_SMALL_READING = 0.1
"""Share of the largest reading below which a reading is not compared with itself."""


def complex_minimax(matrix: Complexes, initial: Complexes, limits: Floats, total: bool) -> tuple[Complexes, float]:
    """Weights (planes,) [w] with the least largest (or ``total``) modulus of initial + matrix @ weights, and a bound.

    ``matrix`` is (rows, planes) [r/w], ``initial`` (rows,) [r]; ``limits`` (planes,) [w] are the largest moduli of the
    weights, infinite where there is none. The bound is proven to be below the cost [r]. Raises SizingError where the
    optimum cannot be proven.
    """
    size = float(np.abs(initial).max(initial=0.0))
    if size == 0.0:
        return np.zeros(matrix.shape[1], dtype=complex), 0.0
    scale = size / np.linalg.norm(matrix, axis=0)
    programme = _Programme(matrix * scale / size, initial / size, limits / scale, total)
    weights, bound = programme.solve()
    return weights * scale, bound * size


class _Programme:
    """The linear programme in the parts of the weights and the bounds t on the moduli."""

    def __init__(self, matrix: Complexes, initial: Complexes, limits: Floats, total: bool) -> None:
        self.matrix, self.initial, self.limits = matrix, initial, limits
        self.rows, self.planes = matrix.shape
        self.slot = np.arange(self.rows) if total else np.zeros(self.rows, dtype=int)
        self.bounds = int(self.slot.max()) + 1
        self.sides: list[Floats] = []
        self.limit: list[float] = []
        for angle in np.arange(8) * np.pi / 4:
            self._cut(np.full(self.rows, angle), np.full(self.planes, angle))

    def solve(self) -> tuple[Complexes, float]:
        """Cut until cost and bound agree."""
        cost = np.r_[np.zeros(2 * self.planes), np.ones(self.bounds)]
        free: Any = [(None, None)] * (2 * self.planes) + [(0.0, None)] * self.bounds
        tight: Any = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
        reached = bound = np.inf
        for _ in range(_ROUNDS):
            solution = linprog(
                cost, np.array(self.sides), np.array(self.limit), bounds=free, method="highs", options=tight
            )
            if not solution.success:
                raise SizingError(f"correction weights did not converge: {solution.message}")
            x, bound = np.asarray(solution.x), float(solution.fun or 0.0)
            weights = x[: self.planes] + 1j * x[self.planes : 2 * self.planes]
            feasible = within_limits(weights, self.limits)
            moduli = np.abs(self.initial + self.matrix @ feasible)
            reached = float(moduli.sum() if self.bounds == self.rows else moduli.max())
            if reached - bound <= _GAP * self.bounds:
                return feasible, bound
            self._cut(np.angle(self.initial + self.matrix @ weights), np.angle(weights))
        raise SizingError(f"correction weights: optimum not proven, reached {reached:.6g}, bound {bound:.6g}")

    def _cut(self, residual_angles: Floats, weight_angles: Floats) -> None:
        """Add Re(r exp(-i psi)) <= t for every row, and Re(w exp(-i psi)) <= limit for every limited plane."""
        turned = np.exp(-1j * residual_angles)
        turned_matrix, target = turned[:, None] * self.matrix, -(turned * self.initial).real
        for row in range(self.rows):
            t = -np.eye(self.bounds)[self.slot[row]]
            self.sides.append(np.r_[turned_matrix[row].real, -turned_matrix[row].imag, t])
            self.limit.append(float(target[row]))
        for plane in np.flatnonzero(np.isfinite(self.limits)):
            one = np.eye(self.planes)[plane]
            angle = weight_angles[plane]
            self.sides.append(np.r_[np.cos(angle) * one, np.sin(angle) * one, np.zeros(self.bounds)])
            self.limit.append(float(self.limits[plane]))


def within_limits(weights: Complexes, limits: Floats) -> Complexes:
    """The weights (planes,) [w], each shortened to its limit (planes,) [w] where it is larger."""
    return weights * np.minimum(1.0, limits / np.maximum(np.abs(weights), 1e-300))


@dataclass(frozen=True)
class Coefficients:
    """Influence coefficients and the readings without weights."""

    initial: Complexes
    """Readings with no weight on, (rows,) [r]."""
    matrix: Complexes
    """Influence coefficients alpha, (rows, planes) [r/w]."""
    misfit: float
    """Root mean square of the residual of the runs [r]; zero where they are just as many as needed."""

    @property
    def condition(self) -> float:
        """Condition number of the coefficients, columns as they are: large where planes have nearly the same effect."""
        return float(np.linalg.cond(self.matrix))


@dataclass(frozen=True)
class Solution:
    """Correction weights, their residual, and how far from the optimum they may be."""

    coefficients: Coefficients
    weights: Complexes
    """All weights in each plane, with no other weight on, (planes,) [w]."""
    method: str
    factors: Floats
    """Factor of each row's reading in the cost, (rows,) [-]."""
    bound: float
    """Proven lower bound of the cost [r]."""
    is_free: bool = False
    """Whether the weights are those of least squares and no limit is active: then they can be differentiated."""

    @property
    def residual(self) -> Complexes:
        """Predicted readings with the weights on, (rows,) [r]."""
        return self.coefficients.initial + self.coefficients.matrix @ self.weights

    @property
    def cost(self) -> float:
        """Root of the sum of squares, sum, or largest of the residual readings times their factors [r]."""
        return _cost(self.residual * self.factors, self.method)

    def is_optimal(self, tol: float) -> bool:
        """Whether the cost is within ``tol`` of its bound, relative to the cost with no weight on."""
        return self.cost - self.bound <= tol * _cost(self.coefficients.initial * self.factors, self.method)


def influence_coefficients(weights: Complexes, readings: Complexes) -> Coefficients:
    """Coefficients from runs: weights on the rotor (runs, planes) [w] and readings (runs, rows) [r].

    Least squares of v = v0 + alpha w over the runs; a weight that stayed on is in the rows of all runs that it was on.
    Raises SizingError where the runs do not separate the effects of all planes.
    """
    runs, planes = weights.shape
    scale = np.abs(weights).max(axis=0, initial=0.0)
    scale[scale == 0.0] = 1.0
    design = design_matrix(weights / scale)
    rank = int(np.linalg.matrix_rank(design))
    if rank < planes + 1:
        raise SizingError(
            f"{runs} run{'s' * (runs != 1)} determine the effect of {max(rank - 1, 0)} of {planes} planes: expected a "
            "run without weights and one trial weight in each plane"
        )
    found = np.linalg.lstsq(design, readings, rcond=None)[0]
    misfit = float(np.sqrt(np.mean(np.abs(readings - design @ found) ** 2)))
    return Coefficients(found[0], found[1:].T / scale, misfit if runs > planes + 1 else 0.0)


def design_matrix(weights: Complexes) -> Complexes:
    """Factors of v0 and the coefficients by run, (runs, planes + 1) [-, w], from weights (runs, planes) [w]."""
    return np.hstack([np.ones((len(weights), 1)), weights])


def weight_effect(before: Complexes, after: Complexes) -> float:
    """Largest change of the readings (rows,) [r] by a trial weight, relative to the reading before [-].

    A reading below a tenth of the largest is compared with that tenth: small readings scatter without a trial weight.
    Infinite where all readings before were zero.
    """
    size = np.abs(before)
    floor = _SMALL_READING * float(size.max(initial=0.0))
    change = np.abs(after - before)
    return float(np.max(change / np.maximum(size, floor))) if floor > 0.0 else float("inf")


def solve_weights(
    coefficients: Coefficients,
    method: str = "least-squares",
    factors: Floats | None = None,
    limits: Sequence[float] | None = None,
) -> Solution:
    """The weights with the least cost: each reading times its factor (rows,) [-], each weight within its limit.

    ``limits`` are in the unit of the weights [w]. Raises SizingError where readings do not determine all weights, or
    the optimum cannot be proven.
    """
    rows, planes = coefficients.matrix.shape
    weighting = np.ones(rows) if factors is None else factors
    bounds = np.full(planes, np.inf) if limits is None else np.asarray(limits, dtype=float)
    matrix, initial = coefficients.matrix * weighting[:, None], coefficients.initial * weighting
    norms = np.linalg.norm(matrix, axis=0)
    if (norms == 0.0).any():
        raise SizingError(
            f"a weight in plane number {int(np.argmin(norms)) + 1} changes no reading: leave that plane out"
        )
    if np.linalg.matrix_rank(matrix / norms, tol=1e-9) < planes:
        raise SizingError(
            f"{rows} reading{'s' * (rows != 1)} do not determine the weights of {planes} planes: use more sensors or "
            "speeds, or fewer planes"
        )
    if method == "least-squares":
        weights, bound = _least_squares(matrix, initial, bounds)
    elif method in METHODS:
        weights, bound = complex_minimax(matrix, initial, bounds, total=method == "robust")
    else:
        raise SizingError(f"method is {method!r}: expected one of {', '.join(METHODS)}")
    is_free = method == "least-squares" and bool((np.abs(weights) < bounds * (1.0 - 1e-9)).all())
    return Solution(coefficients, weights, method, weighting, bound, is_free)


def _cost(readings: Complexes, method: str) -> float:
    moduli = np.abs(readings)
    if method == "least-squares":
        return float(np.linalg.norm(moduli))
    return float(moduli.sum() if method == "robust" else moduli.max())


def _least_squares(matrix: Complexes, initial: Complexes, limits: Floats) -> tuple[Complexes, float]:
    """Weights of least squares; where a limit is active, by SLSQP, with the bound of the dual problem."""
    weights = np.linalg.lstsq(matrix, -initial, rcond=None)[0]
    if (np.abs(weights) <= limits).all():
        return weights, float(np.linalg.norm(initial + matrix @ weights))
    weights = _disc_bounded_least_squares(matrix, initial, limits, weights)
    reached, bound = float(np.linalg.norm(initial + matrix @ weights)), _dual_bound(matrix, initial, limits, weights)
    if reached - bound > _PROVEN * float(np.linalg.norm(initial)):
        raise SizingError(f"correction weights: optimum not proven, reached {reached:.6g}, bound {bound:.6g}")
    return weights, bound


def _disc_bounded_least_squares(matrix: Complexes, initial: Complexes, limits: Floats, start: Complexes) -> Complexes:
    """Least squares with |w_j| <= limit_j, in units in which the limits or else the free solution are one."""
    planes = matrix.shape[1]
    unit = np.where(np.isfinite(limits), limits, np.maximum(np.abs(start), 1e-300))
    size = np.linalg.norm(initial)
    scaled, target = matrix * unit / size, initial / size
    bound = np.flatnonzero(np.isfinite(limits))

    def objective(x: Floats) -> tuple[float, Floats]:
        residual = target + scaled @ (x[:planes] + 1j * x[planes:])
        slope = scaled.conj().T @ residual
        return 0.5 * float(np.vdot(residual, residual).real), np.r_[slope.real, slope.imag]

    def margin(x: Floats) -> Floats:
        return 1.0 - x[bound] ** 2 - x[planes + bound] ** 2

    def margin_slope(x: Floats) -> Floats:
        one = -2.0 * np.eye(planes)[bound]
        return np.hstack([one * x[:planes], one * x[planes:]])

    constraint: Any = {"type": "ineq", "fun": margin, "jac": margin_slope}
    precise: Any = {"ftol": 1e-16, "maxiter": 1000}
    first = within_limits(start, limits) / unit
    start_x = np.concatenate([first.real, first.imag])
    solved = minimize(objective, start_x, jac=True, method="SLSQP", constraints=constraint, options=precise)
    x = np.asarray(solved.x)
    return within_limits((x[:planes] + 1j * x[planes:]) * unit, limits)


def _dual_bound(matrix: Complexes, initial: Complexes, limits: Floats, weights: Complexes) -> float:
    """Lower bound: min over w of |v0 + A w|^2 + sum mu_j (|w_j|^2 - limit_j^2), with the multipliers mu >= 0 at w."""
    slope = matrix.conj().T @ (initial + matrix @ weights)
    at_limit = np.abs(weights) >= limits * (1.0 - 1e-9)
    safe = np.where(at_limit, np.abs(weights) ** 2, 1.0)
    mu = np.where(at_limit, np.maximum(0.0, -(weights.conj() * slope).real / safe), 0.0)
    normal = matrix.conj().T @ matrix + np.diag(mu)
    free = -np.linalg.solve(normal, matrix.conj().T @ initial)
    squares = float(np.linalg.norm(initial + matrix @ free) ** 2)
    penalty = mu[at_limit] * (np.abs(free[at_limit]) ** 2 - limits[at_limit] ** 2)
    return float(np.sqrt(max(0.0, squares + float(penalty.sum()))))
