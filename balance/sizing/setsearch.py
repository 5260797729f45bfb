"""Sets of stock plates for several loads in turn, each set holding the one before it: a mixed-integer programme.

Plates n[k, s, p] >= 0, whole, at load k, site s, of kind p;  n[k] <= n[k + 1];  sum over s of n[last] <= quantity.
Residual of load k:  r_k = max |effect n[k] - target_k|.  Least, one after the other, each kept while the next is
sought: the largest r_k, the sum of r_k, the mass of all sets.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp

from ..arrays import Floats, Indices
from ..errors import SizingError
from ..quiet import stdout_discarded

_SCALE = 1e3
"""Unbalance to which the programme is scaled, so that the solver's 1e-6 is 1e-9 of it."""
_SLACK = 1e-6
TIME_LIMIT_S = 60.0
"""Longest search for one proven answer [s]."""


def best_sets(columns: Floats, targets: Floats, masses: Floats, quantities: Floats) -> Indices:
    """Plates of each kind at each site for each load, (loads, sites, kinds), to a proven optimum.

    ``columns`` (conditions, sites) [m] is what a kilogram at a site does, ``targets`` (loads, conditions) [kg m] what
    is to be met, ``masses`` (kinds,) [kg]. Raises SizingError if the solver does not prove its answer.
    """
    scale = _SCALE / max(float(np.abs(targets).max(initial=0.0)), 1e-12)
    search = _Search(scale * np.kron(columns, masses), scale * targets, np.tile(masses, columns.shape[1]), quantities)
    best = search.least(search.largest_cost())
    largest = search.residuals(best)
    search.cap = np.full(len(targets), _above(largest.max()))
    if len(targets) > 1:
        best = search.least(search.sum_cost())
        search.total = _above(search.residuals(best).sum())
    best = search.least(search.mass_cost())
    return best.reshape(len(targets), columns.shape[1], len(masses))


def _above(least: float) -> float:
    return float(least) * (1.0 + 1e-9) + _SLACK


@dataclass
class _Search:
    """The programme; unknowns are the plates, r_k, and the largest of them."""

    effect: Floats
    target: Floats
    mass: Floats
    quantity: Floats
    cap: Floats | None = None
    total: float = np.inf

    @property
    def loads(self) -> int:
        return len(self.target)

    @property
    def per_load(self) -> int:
        return len(self.mass)

    def residuals(self, counts: Indices) -> Floats:
        """Largest residual of each load, (loads,), scaled."""
        return np.abs(counts @ self.effect.T - self.target).max(axis=1, initial=0.0)

    def largest_cost(self) -> Floats:
        return np.concatenate([np.zeros(self.loads * (self.per_load + 1)), [1.0]])

    def sum_cost(self) -> Floats:
        return np.concatenate([np.zeros(self.loads * self.per_load), np.ones(self.loads), [0.0]])

    def mass_cost(self) -> Floats:
        return np.concatenate([np.tile(self.mass, self.loads), np.zeros(self.loads + 1)])

    def least(self, cost: Floats) -> Indices:
        """Plates of least cost, (loads, sites times kinds)."""
        plates = self.loads * self.per_load
        cap = np.full(self.loads, np.inf) if self.cap is None else self.cap
        sites = self.per_load // len(self.quantity)
        upper = np.concatenate([np.tile(self.quantity, self.loads * sites), cap, [np.inf]])
        with stdout_discarded():
            solution = milp(
                cost,
                constraints=self._constraints(sites),
                integrality=np.concatenate([np.ones(plates), np.zeros(self.loads + 1)]),
                bounds=Bounds(0.0, upper),
                options={"mip_rel_gap": 0.0, "time_limit": TIME_LIMIT_S},
            )
        if solution.status == 1:
            raise SizingError(f"no set of plates was proven to be the best within {TIME_LIMIT_S:g} s: give fewer")
        if not solution.success:
            raise SizingError(f"no proven best set of plates: {solution.message}")
        return np.rint(np.asarray(solution.x)[:plates]).astype(np.intp).reshape(self.loads, self.per_load)

    def _constraints(self, sites: int) -> list[LinearConstraint]:
        loads, rows = self.loads, len(self.effect)
        each = np.eye(loads)
        moved, left = np.kron(each, self.effect), np.kron(each, np.ones((rows, 1)))
        none, flat = np.zeros((loads * rows, 1)), self.target.ravel()
        stocked = np.kron(each[-1:], np.tile(np.eye(len(self.quantity)), sites))
        nested = np.kron(each[:-1] - each[1:], np.eye(self.per_load))
        found = [
            LinearConstraint(np.hstack([moved, -left, none]), -np.inf, flat),
            LinearConstraint(np.hstack([moved, left, none]), flat, np.inf),
            LinearConstraint(_padded(stocked, loads + 1), 0.0, self.quantity),
            LinearConstraint(np.hstack([np.zeros((loads, moved.shape[1])), each, -np.ones((loads, 1))]), -np.inf, 0.0),
            LinearConstraint(self.sum_cost()[None], -np.inf, self.total),
        ]
        return [*found, LinearConstraint(_padded(nested, loads + 1), -np.inf, 0.0)] if loads > 1 else found


def _padded(matrix: Floats, more: int) -> Floats:
    return np.hstack([matrix, np.zeros((len(matrix), more))])
