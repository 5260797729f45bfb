"""Balance conditions of a mechanism, found from its model: what keeps its linear momentum zero in every motion.

Linear momentum is ``W(q, v) @ pi``. Over loop-consistent states the rows of W span a space; the mechanism is balanced
when pi is orthogonal to it. The conditions are that space's reduced row echelon form, pivots on first moments.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Floats
from ..closure import Closure
from ..errors import ModelError
from ..mechanism.mechanism import Mechanism

GAP = 1e6
"""Least ratio between the smallest kept and the largest dropped singular value that decides a rank."""
STATES = 64
"""Closed states from which a rank is found first."""
_ZERO = 1e-9
"""Coefficients below this are rounding of the elimination [m, or none]."""


def row_space(matrix: Floats, name: str) -> tuple[Floats, tuple[float, float]]:
    """Orthonormal basis (rank, k) [-] of the row space of ``matrix`` (m, k), in SI, and the singular values at the cut.

    Raises ModelError if no ratio of at least GAP separates the kept from the dropped singular values.
    """
    used = np.flatnonzero(matrix.any(axis=0))
    rows = np.zeros((min(len(matrix), len(used)), matrix.shape[1]))
    _, values, rows[:, used] = np.linalg.svd(matrix[:, used], full_matrices=False)
    values = values / np.sqrt(len(matrix))
    if not values.any():
        return rows[:0], (0.0, 0.0)
    floor = np.maximum(values, np.finfo(float).eps * values[0])
    ratios = floor[:-1] / floor[1:]
    rank = int(np.argmax(ratios)) + 1 if len(ratios) and ratios.max() >= GAP else len(values)
    if rank == len(values) and values[-1] < values[0] / GAP:
        raise ModelError(
            f"{name}: the rank of its momentum cannot be decided: no singular value is {GAP:g} times the next (they "
            f"fall from {values[0]:.3g} to {values[-1]:.3g}, at most {ratios.max():.3g} times at once)"
        )
    return rows[:rank], (float(values[rank - 1]), float(values[rank]) if rank < len(values) else 0.0)


def reduced_row_echelon(basis: Floats, order: Sequence[int]) -> Floats:
    """Reduced row echelon form of ``basis`` (rank, k) [-], in the same shape; pivots in the given order of columns."""
    used = [column for column in order if basis[:, column].any()]
    matrix, row = basis[:, used], 0
    for column in range(len(used)):
        if row == len(matrix):
            break
        best = row + int(np.argmax(np.abs(matrix[row:, column])))
        if abs(matrix[best, column]) < _ZERO:
            continue
        matrix[[row, best]] = matrix[[best, row]]
        matrix[row] /= matrix[row, column]
        others = np.arange(len(matrix)) != row
        matrix[others] -= np.outer(matrix[others, column], matrix[row])
        row += 1
    matrix[np.abs(matrix) < _ZERO] = 0.0
    found = np.zeros_like(basis)
    found[:, used] = matrix
    return found


def text_of(coefficients: Mapping[str, float]) -> str:
    """A combination as a sum, such as ``mcx[A0A] + 0.15 m[AC]``."""
    terms: list[str] = []
    for name, value in coefficients.items():
        size = "" if abs(abs(value) - 1.0) < 1e-12 else f"{abs(value):.6g} "
        sign = ("- " if value < 0 else "+ ") if terms else ("-" if value < 0 else "")
        terms.append(f"{sign}{size}{name}")
    return " ".join(terms) or "0"


MOMENTA = {"linear": [0, 1, 2], "planar": [0, 1, 2, 5], "all": [0, 1, 2, 3, 4, 5]}
"""Linear momentum; with the angular one about z; with all three angular ones."""


@dataclass(frozen=True)
class Conditions:
    """Linear conditions on the inertial parameters: balanced where ``matrix @ pi`` is zero."""

    mechanism: Mechanism
    dof: int
    matrix: Floats
    """A condition a row, in reduced row echelon form: pivots 1 on first moments, masses in m, (rank, 10 nb) [-, m]."""
    singular_values: tuple[float, float]
    """Smallest kept and largest dropped singular value of the stacked momentum regressor."""
    closure_residual: float = 0.0
    """Largest residual of the loops in the closed configuration that is the home of all others [m, rad]."""

    @property
    def rank(self) -> int:
        """Number of independent conditions."""
        return len(self.matrix)

    def values(self, mechanism: Mechanism | None = None) -> Floats:
        """Left-hand sides for a mechanism of the same kind with other masses, (rank,) [kg m]."""
        return self.matrix @ (mechanism or self.mechanism).pi

    def residual(self, mechanism: Mechanism | None = None) -> float:
        """First-moment residual: the largest absolute value of the conditions [kg m]."""
        return float(np.abs(self.values(mechanism)).max(initial=0.0))

    def is_balanced(self, tol: float, mechanism: Mechanism | None = None) -> bool:
        """Whether the first-moment residual is at most ``tol`` [kg m]."""
        return self.residual(mechanism) <= tol

    @cached_property
    def weights(self) -> Floats:
        """S (k, rank) [root of kg / kg m]: |S values|^2 is the objective of sizing, the momentum over the workspace."""
        from .objective import workspace_objective

        return workspace_objective(self.mechanism).factor[:, :-1] @ np.linalg.pinv(self.matrix)

    def coefficients(self, row: int) -> dict[str, float]:
        """Coefficients of one condition by parameter name, without zeros."""
        names = self.mechanism.parameter_names
        return {names[k]: float(self.matrix[row, k]) for k in np.flatnonzero(self.matrix[row])}

    def text(self, row: int) -> str:
        """One condition as an equation, such as ``mcx[A0A] + mcx[BD] + 0.15 m[AC] = 0``."""
        return f"{text_of(self.coefficients(row))} = 0"


def balance_conditions(mechanism: Mechanism, momentum: str = "linear") -> Conditions:
    """Find the conditions that keep a momentum zero, one of MOMENTA.

    Raises ClosureError if the mechanism cannot be closed or moved, ModelError if the rank cannot be decided.
    """
    if momentum not in MOMENTA:
        raise ModelError(f"momentum is {momentum!r}: expected one of {', '.join(MOMENTA)}")
    closure = Closure(mechanism)
    basis, gap = _momentum_space(closure, MOMENTA[momentum])
    residual = float(closure.residual(closure.home[None])[0])
    return Conditions(closure.mechanism, closure.dof, reduced_row_echelon(basis, pivot_order(mechanism)), gap, residual)


def _momentum_space(closure: Closure, rows: list[int]) -> tuple[Floats, tuple[float, float]]:
    """The row space of a momentum's ``rows`` over so many closed states that a third more of them add nothing."""
    count = STATES
    while True:
        q = closure.states(count)
        states = zip(q, closure.velocities(q), strict=True)
        by_state = np.array([closure.engine.momentum_regressor(*state)[rows] for state in states])
        found, others = (part.reshape(-1, by_state.shape[2]) for part in np.split(by_state, [3 * count // 4]))
        basis, gap = row_space(found, closure.mechanism.name)
        if np.abs(others - (others @ basis.T) @ basis).max() <= _ZERO * np.abs(others).max():
            return basis, gap
        count *= 2


def pivot_order(mechanism: Mechanism) -> list[int]:
    """First moments body by body, then masses, then inertias."""
    bodies = range(len(mechanism.bodies))
    blocks = [(1, 2, 3), (0,), (4, 5, 6, 7, 8, 9)]
    return [10 * body + k for block in blocks for body in bodies for k in block]
