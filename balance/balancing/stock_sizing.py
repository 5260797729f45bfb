"""Counter-masses from stock plates, to a proven optimum: a mixed-integer programme.

For several loads in turn each set holds the one before it. Plates n[k, s, p] >= 0, whole, at load k, site s, of kind p;
n[k] <= n[k + 1];  sum over s of n[last] <= quantity. Residual of load k:  r_k = max |effect n[k] - target_k|.
Least, one after the other, each kept while the next is sought: the largest r_k, the sum of r_k, the mass of all sets.

The sets of plates that the source built are given for comparison, never as a result.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp

from ..arrays import Floats, Indices, stdout_discarded
from ..errors import SizingError
from ..mechanism.mechanism import Mechanism
from . import stock_plates
from .closed_forms import published_sizing
from .conditions import Conditions
from .sizing import Sizing, chosen_sites, sizing_of_given, sizing_system
from .stock_plates import Plate

_SCALE = 1e3
"""Unbalance to which the programme is scaled, so that the solver's 1e-6 is 1e-9 of it."""
_SLACK = 1e-6
TIME_LIMIT_S = 60.0
"""Longest search for one proven answer [s]."""


def best_sets(columns: Floats, targets: Floats, masses: Floats, quantities: Floats) -> Indices:
    """Plates of each kind at each site for each load, (loads, sites, kinds), to a proven optimum.

    ``columns`` (conditions, sites) [m] are the effect of a kilogram at a site, ``targets`` (loads, conditions) [kg m]
    what is to be met; ``masses`` (kinds,) [kg] and ``quantities`` (kinds,) those of the stock.
    Raises SizingError if the solver does not prove its answer.
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


@dataclass(frozen=True)
class BuiltSet:
    """The set that the source built for a payload, the same on each arm."""

    payload: float
    """[kg]"""
    plates: tuple[str, ...]
    mass: float
    """Of its plates [kg]."""
    residual: float
    """Its first-moment residual [kg m], computed."""


def published_increments() -> tuple[float, ...]:
    """Published increments for the second and third payload [kg]: differences of the computed masses."""
    return tuple(float(value) for value in published_sizing()["nested_increments_kg"].values())


def built_sets(
    conditions: Conditions, mechanisms: Sequence[Mechanism], payloads: Sequence[float]
) -> tuple[BuiltSet, ...]:
    """Sets that the source built for exactly these payloads [kg] of its manipulator; empty for any others."""
    published = published_sizing()
    if list(payloads) != [float(key) for key in published["built_counter_mass_kg_per_arm"]]:
        return ()
    plates = stock_plates.load_stock("kiper2019")
    found = []
    for mechanism, payload, names in zip(mechanisms, payloads, published["built_sets"].values(), strict=True):
        mass = stock_plates.plates_mass(names, plates)
        sizing = sizing_of_given(conditions, mechanism, dict.fromkeys(mechanism.counter_sites, mass))
        found.append(BuiltSet(payload, tuple(names), mass, sizing.residual()))
    return tuple(found)


def size_from_stock(
    conditions: Conditions, mechanism: Mechanism, plates: Sequence[Plate], sites: Sequence[str] = ()
) -> Sizing:
    """The plates at each site of least first-moment residual; among equals the lightest.

    A mixed-integer programme solved to proven optimality; a plate's quantity is for all sites together.
    """
    return nested_size_from_stock(conditions, [mechanism], plates, sites)[0]


def nested_size_from_stock(
    conditions: Conditions, mechanisms: Sequence[Mechanism], plates: Sequence[Plate], sites: Sequence[str] = ()
) -> tuple[Sizing, ...]:
    """A set of plates for each of ``mechanisms`` (one mechanism, payloads rising), each set holding the one before it.

    Least, one after the other: the largest first-moment residual of all, their sum, the mass of all sets; proven.
    """
    names = chosen_sites(mechanisms[0], sites)
    systems = [sizing_system(conditions, mechanism, names) for mechanism in mechanisms]
    masses = np.array([plate.mass for plate in plates])
    quantities = np.array([plate.quantity for plate in plates], dtype=float)
    counts = best_sets(systems[0][0], np.array([target for _, target in systems]), masses, quantities)
    return tuple(
        sizing_of_given(
            conditions, mechanism, dict(zip(names, rows @ masses, strict=True)), _piles(names, rows, plates)
        )
        for mechanism, rows in zip(mechanisms, counts, strict=True)
    )


def _piles(names: Sequence[str], counts: Indices, plates: Sequence[Plate]) -> dict[str, list[Plate]]:
    """Plates at each site, in the order of the stock; ``counts`` (sites, kinds)."""
    return {
        name: [plate for plate, count in zip(plates, row, strict=True) for _ in range(count)]
        for name, row in zip(names, counts, strict=True)
    }
