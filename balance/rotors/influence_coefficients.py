"""Influence coefficients: what a weight in a plane does to a reading, and the weights that make readings small.

A reading v (a vibration at running speed, as a complex number) is v = v0 + sum_j alpha_j w_j with the weights w_j on
the rotor. Any number of planes, sensors and speeds: each sensor at each speed is a row. Angles of weights and phases
count in one sense, phase as lead (see CONVENTIONS.md). Units are those of the arguments: [r] of readings, [w] of
weights, in SI.

Weights of least squares without an active limit are solved directly; all others by a second-order cone programme, whose
dual proves how far they can be from the optimum.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from ..arrays import Complexes, Floats, conic_optimum, root_mean_square
from ..errors import SizingError
from ..results import INLINE, Key

METHODS = ("least-squares", "robust", "min-max")
"""Least sum of squares; least sum of moduli, which a single wrong reading moves little; least largest modulus."""
LEAST_EFFECT = 0.25
"""Smallest change of a reading by a trial weight, of the reading before: less is within the scatter of readings."""
_GAP = 1e-8
"""Distance of cost and bound, of the largest initial reading and a row, at which an optimum is proven."""
_TOLERANCE = 1e-11
"""Of the solver, in the same unit."""
_SMALL_READING = 0.1
"""Share of the largest reading below which a reading is not compared with itself."""


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
    def condition(self) -> Annotated[float, Key()]:
        """Condition number of the coefficients, columns as they are: large where planes have nearly the same effect."""
        return float(np.linalg.cond(self.matrix))


@dataclass(frozen=True)
class Solution:
    """Correction weights, their residual, and how far from the optimum they may be."""

    coefficients: Annotated[Coefficients, INLINE]
    weights: Complexes
    """All weights in each plane, with no other weight on, (planes,) [w]."""
    method: Annotated[str, Key()]
    factors: Floats
    """Factor of each row's reading in the cost, (rows,) [-]."""
    bound: Annotated[float, Key("cost_lower_bound_SI")]
    """Proven lower bound of the cost [r]."""
    is_free: bool = False
    """Whether the weights are those of least squares and no limit is active: then they can be differentiated."""

    @property
    def residual(self) -> Complexes:
        """Predicted readings with the weights on, (rows,) [r]."""
        return self.coefficients.initial + self.coefficients.matrix @ self.weights

    @property
    def cost(self) -> Annotated[float, Key("cost_SI")]:
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
    misfit = root_mean_square(readings - design @ found)
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
    if method not in METHODS:
        raise SizingError(f"method is {method!r}: expected one of {', '.join(METHODS)}")
    weights = np.linalg.lstsq(matrix, -initial, rcond=None)[0]
    bound = _cost(initial + matrix @ weights, method)
    if method != "least-squares" or not (np.abs(weights) <= bounds).all():
        weights, bound = _cone_programme(matrix, initial, bounds, method)
    is_free = method == "least-squares" and bool((np.abs(weights) < bounds * (1.0 - 1e-9)).all())
    return Solution(coefficients, weights, method, weighting, bound, is_free)


def _cost(readings: Complexes, method: str) -> float:
    moduli = np.abs(readings)
    if method == "least-squares":
        return float(np.linalg.norm(moduli))
    return float(moduli.sum() if method == "robust" else moduli.max())


def _cone_programme(matrix: Complexes, initial: Complexes, limits: Floats, method: str) -> tuple[Complexes, float]:
    """Weights (planes,) [w] of least cost within their limits, and the bound of the dual programme below it [r].

    Unknowns are the parts of the weights and the bounds t: |r_i| <= t_i, or the norm of all r <= t; the sum of t is
    least. Raises SizingError where cost and bound do not meet.
    """
    size = float(np.abs(initial).max(initial=0.0))
    planes, rows = matrix.shape[1], len(initial)
    if size == 0.0:
        return np.zeros(planes, dtype=complex), 0.0
    scale = size / np.linalg.norm(matrix, axis=0)
    unit, target = matrix * scale / size, initial / size
    bounds = rows if method == "robust" else 1
    residual = -np.block([[unit.real, -unit.imag], [unit.imag, unit.real]])
    groups = [np.arange(rows)] if method == "least-squares" else [np.array([i]) for i in range(rows)]
    blocks: list[tuple[Floats, Floats]] = []
    for k, group in enumerate(groups):
        parts = np.r_[group, rows + group]
        cone = np.zeros((1 + len(parts), 2 * planes + bounds))
        cone[0, 2 * planes + min(k, bounds - 1)] = -1.0
        cone[1:, : 2 * planes] = residual[parts]
        blocks.append((cone, np.r_[0.0, target.real[group], target.imag[group]]))
    for plane in np.flatnonzero(np.isfinite(limits)):
        cone = np.zeros((3, 2 * planes + bounds))
        cone[[1, 2], [plane, planes + plane]] = -1.0
        blocks.append((cone, np.r_[limits[plane] / scale[plane], 0.0, 0.0]))
    cost = np.r_[np.zeros(2 * planes), np.ones(bounds)]
    sides, right = np.vstack([cone for cone, _ in blocks]), np.concatenate([side for _, side in blocks])
    solved = conic_optimum(cost, sides, right, [("SecondOrder", len(side)) for _, side in blocks], _TOLERANCE)
    x = np.asarray(solved.x)
    weights = (x[:planes] + 1j * x[planes : 2 * planes]) * scale
    weights = weights * np.minimum(1.0, limits / np.maximum(np.abs(weights), 1e-300))
    reached, bound = _cost(initial + matrix @ weights, method), size * float(solved.obj_val_dual)
    if not reached - bound <= _GAP * size * bounds:
        raise SizingError(f"correction weights: optimum not proven, reached {reached:.6g}, bound {bound:.6g}")
    return weights, min(bound, reached)
