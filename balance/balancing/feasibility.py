"""Conditions that positive masses cannot meet: a combination of them that no mass anywhere on the bodies can lower.

A condition y' A gives the mass at a point x of a body the weight f(x) = [x, 1] W [x, 1]', a quadratic whose matrix W
comes from its coefficients on the body's ten parameters. Where f is nowhere negative on any body (W positive
semidefinite), the left-hand side is a sum of what is never negative: zero only without mass where f is positive. Such a
y, if there is one, is found by a semidefinite programme, whose dual says that masses of some place meet all conditions.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ..arrays import Floats, conic_optimum, packed_triangle
from ..mechanism.mechanism import PARAMETERS, pseudo_inertia
from .conditions import Conditions, text_of

_SIZE = 4
_TOLERANCE = 1e-10
"""Of the solver."""
_ROUNDING = 1e-7
"""What the solver may miss a matrix without negative eigenvalues by, per unit of the trace of all W [-]."""
_ZERO = 1e-6
"""Coefficients below this share of the largest are the solver's rounding [-]."""
_UNITS = np.array([pseudo_inertia(unit) for unit in np.eye(len(PARAMETERS))])
"""Pseudo-inertia of each parameter at one, (10, 4, 4)."""


@dataclass(frozen=True)
class Feasibility:
    """Whether positive masses, added anywhere on the moving bodies, can meet conditions."""

    status: Literal["possible", "forbidden", "undecided"]
    coefficients: dict[str, float] = field(default_factory=dict)
    """Where forbidden: by parameter, those of a combination that no mass lowers, the largest at 1 [m2, m, -]."""
    value: float = 0.0
    """Its left-hand side now [kg m2, kg m, kg]: at least this is left whatever mass is added."""

    @property
    def text(self) -> str:
        """The combination as an equation, such as ``Izz[A0A] + 0.0225 m[AC] = 0``."""
        return f"{text_of(self.coefficients)} = 0"


def feasibility(conditions: Conditions) -> Feasibility:
    """Whether positive masses can meet the conditions, and if not, the combination of them that forbids it.

    Of several such combinations the one that weighs most on the last bodies of the file is given: it has few others.
    """
    mechanism = conditions.mechanism
    bodies, reaches = len(mechanism.bodies), [np.linalg.norm(joint.position) for joint in mechanism.tree.joints]
    length = float(max(reaches, default=0.0)) or 1.0  # brings the unknowns to one scale
    per_length = np.tile(length ** -np.array([0.0, 1, 1, 1, 2, 2, 2, 2, 2, 2]), bodies)
    basis = np.linalg.qr((conditions.matrix * per_length).T)[0].T
    # W (4, 4) of the weight [x, 1] W [x, 1]' that one coefficient gives the mass at x: that of its pseudo-inertia
    quadratic = np.round(2.0 * np.linalg.pinv(_UNITS.reshape(len(_UNITS), -1)).T.reshape(_UNITS.shape)) / 2.0 + 0.0
    by_body = np.einsum("rbk,kij->brij", basis.reshape(len(basis), bodies, -1), quadratic)
    traces = np.einsum("brii->br", by_body)
    cones = [("Zero", 1), *[("PSDTriangle", _SIZE)] * bodies]
    rows = np.concatenate([traces.sum(axis=0)[None], *(-packed_triangle(of_body).T for of_body in by_body)])
    identity = np.concatenate([[0.0], *[packed_triangle(np.eye(_SIZE))] * bodies])
    right = np.concatenate([[1.0], np.zeros(len(rows) - 1)])
    weights, zero = np.arange(1.0, bodies + 1) / bodies, np.zeros(len(basis))
    programmes = [
        (-(weights @ traces), rows),
        (-basis @ (mechanism.pi / per_length), rows),  # another corner where the first is flat
        (np.append(zero, -1.0), np.column_stack([rows, identity])),  # the least eigenvalue: where others have no inside
    ]
    for cost, sides in programmes:
        solution = conic_optimum(cost, sides, right, cones, _TOLERANCE)
        if str(solution.status) in {"PrimalInfeasible", "AlmostPrimalInfeasible"}:
            return Feasibility("possible")
        y = np.asarray(solution.x)[: len(basis)]
        lowering = np.einsum("r,brij->bij", np.nan_to_num(y), by_body)  # no mass lowers it: no negative eigenvalue
        is_scaled = abs(float(np.einsum("bii->", lowering)) - 1.0) < 1e-6
        if np.isfinite(y).all() and is_scaled and float(np.linalg.eigvalsh(lowering).min()) > -_ROUNDING:
            combined = (y @ basis) / per_length
            combined[np.abs(combined * per_length) < _ZERO * np.abs(combined * per_length).max()] = 0.0
            combined /= np.abs(combined).max()
            left = float(combined @ mechanism.pi)
            if left > _ROUNDING * float(np.abs(combined) @ np.abs(mechanism.pi)):
                names = mechanism.parameter_names
                return Feasibility("forbidden", {names[k]: float(combined[k]) for k in np.flatnonzero(combined)}, left)
    return Feasibility("possible" if _masses_meet(basis, mechanism.pi / per_length) else "undecided")


def _masses_meet(basis: Floats, pi: Floats) -> bool:
    """Whether added bodies, of least pseudo-inertia, are found with which all conditions (rank, k) are met [-]."""
    bodies = basis.shape[1] // len(PARAMETERS)
    rows = np.concatenate([basis, np.kron(np.eye(bodies), -packed_triangle(_UNITS).T)])
    right = np.concatenate([-basis @ pi, np.zeros(len(rows) - len(basis))])
    cones = [("Zero", len(basis)), *[("PSDTriangle", _SIZE)] * bodies]
    cost = np.tile(np.einsum("kii->k", _UNITS), bodies)
    added = np.asarray(conic_optimum(cost, rows, right, cones, _TOLERANCE).x)
    if not np.isfinite(added).all():
        return False
    least = min(float(np.linalg.eigvalsh(pseudo_inertia(row))[0]) for row in added.reshape(bodies, -1))
    missed = float(np.abs(basis @ (pi + added)).max())
    size = float(np.abs(pi).max() + np.abs(added).max())
    return missed < _ROUNDING * size and least > -_ROUNDING * size
