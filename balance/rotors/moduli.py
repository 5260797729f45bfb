"""Least largest, or least sum of, moduli of complex residuals, proven.

|r| >= Re(r exp(-i psi)) for every psi, with equality at psi = arg r. A linear programme with some directions psi is a
lower bound; the direction of each residual found is added until the bound meets what is reached (cutting planes).
"""

from typing import Any

import numpy as np
from scipy.optimize import linprog

from ..arrays import Complexes, Floats
from ..errors import SizingError

GAP = 1e-8
"""Distance of reached and bound, of the largest initial vector, at which an optimum counts as proven."""
_ROUNDS = 100


def least(matrix: Complexes, initial: Complexes, limits: Floats, total: bool) -> tuple[Complexes, float]:
    """Weights (planes,) with the least largest (or ``total``) modulus of ``initial + matrix @ weights``, and the bound.

    ``limits`` (planes,) are the largest moduli of the weights, infinite where there is none. Raises SizingError where
    the optimum cannot be proven.
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
        """Cut until what is reached and the bound agree."""
        cost = np.r_[np.zeros(2 * self.planes), np.ones(self.bounds)]
        free: Any = [(None, None)] * (2 * self.planes) + [(0.0, None)] * self.bounds
        tight: Any = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
        reached, bound = np.inf, 0.0
        for _ in range(_ROUNDS):
            solution = linprog(
                cost, np.array(self.sides), np.array(self.limit), bounds=free, method="highs", options=tight
            )
            if not solution.success:
                raise SizingError(f"correction weights did not converge: {solution.message}")
            x, bound = np.asarray(solution.x), float(solution.fun or 0.0)
            weights = x[: self.planes] + 1j * x[self.planes : 2 * self.planes]
            feasible = within(weights, self.limits)
            reached = self._cost(feasible)
            if reached - bound <= GAP * self.bounds:
                return feasible, bound
            self._cut(np.angle(self.initial + self.matrix @ weights), np.angle(weights))
        raise SizingError(f"correction weights: optimum not proven, reached {reached:.6g}, bound {bound:.6g}")

    def _cost(self, weights: Complexes) -> float:
        moduli = np.abs(self.initial + self.matrix @ weights)
        return float(moduli.sum() if self.bounds == self.rows else moduli.max())

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


def within(weights: Complexes, limits: Floats) -> Complexes:
    """The weights, each shortened to its limit where it is longer."""
    return weights * np.minimum(1.0, limits / np.maximum(np.abs(weights), 1e-300))
