"""Static balancing: potential energy constant over the workspace, by counter-masses or by springs of zero free length.

Conditions on the inertial parameters are found from the model, as those of momentum. Springs are the softest set among
candidate places, by linear programming; they are evaluated at other configurations than those they were found from.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from scipy.optimize import linprog, nnls

from ..arrays import Floats
from ..closure import Closure
from ..closure.assembly import RANK_LIMIT
from ..dynamics.regressor import potential, potential_regressor
from ..errors import ModelError, SizingError
from ..mechanism.forward_kinematics import plane_axes
from ..mechanism.mechanism import Mechanism
from .conditions import Conditions, pivot_order, reduced_row_echelon, row_space
from .objective import Objective, triangle, with_constant, workspace_states
from .sizing import Sizing
from .springs import End, Spring, joint_torques, spring_energy, spring_lengths, unit_energies

_STATES, _SEED = 120, 11
_LEVEL = 1e-12
"""Swing of potential energy, relative to the weight times the mechanism's length, that is rounding."""
_BETWEEN_LINKS = 2.0
"""Cost of a stiffness between two links, that of one to the base being 1: springs to the base are simpler."""


@dataclass(frozen=True)
class Springs:
    """Springs for a mechanism, and how constant they make its potential energy."""

    mechanism: Mechanism
    springs: tuple[Spring, ...]
    q: Floats
    """Configurations of the workspace at which they are evaluated, (n, nv) [rad, m]."""

    def weight_energy(self) -> Floats:
        """Potential energy of weight, (n,) [J]."""
        return potential(self.mechanism, self.q)

    def energy(self) -> Floats:
        """Energy of the springs, (n,) [J]."""
        return spring_energy(self.mechanism, self.springs, self.q)

    def swing(self) -> float:
        """Largest less smallest potential energy without springs [J]."""
        return float(np.ptp(self.weight_energy()))

    def residual(self) -> float:
        """Largest less smallest potential energy with springs [J]."""
        return float(np.ptp(self.weight_energy() + self.energy()))

    def is_balanced(self, tol: float = 1e-12) -> bool:
        """Whether the potential energy is constant to ``tol`` of its swing without springs."""
        return self.residual() <= tol * self.swing()


def design_springs(
    mechanism: Mechanism, places: Sequence[Spring] = (), reach: float = 0.0, height: float = 0.0
) -> Springs:
    """The softest springs of zero free length that balance a mechanism statically.

    ``places`` are candidate springs whose stiffness is sought; without any they are laid out: ends on each body at
    ``reach`` [m] from its joint along and across it, on the base at ``height`` [m] above and below each ground pivot.
    Raises SizingError where no stiffnesses of these places do it, ModelError where there is no gravity.
    """
    if not mechanism.gravity.any():
        raise ModelError(f"{mechanism.name}: its file has no gravity: there is nothing for springs to balance")
    closure = Closure(mechanism)
    length = closure.length
    candidates = list(places) or spring_layout(mechanism, reach or 0.5 * length, height or length)
    q = closure.states(_STATES, _SEED)
    columns = unit_energies(mechanism, candidates, q)
    columns, target = columns - columns.mean(axis=0), -potential(mechanism, q)
    target = target - target.mean()
    if np.abs(target).max() < _LEVEL * mechanism.total_mass * np.linalg.norm(mechanism.gravity) * length:
        return evaluate_springs(mechanism, ())
    cost = np.array([1.0 if min(s.first.body, s.second.body) < 0 else _BETWEEN_LINKS for s in candidates])
    stiffness = _softest(mechanism, columns, target, cost)
    springs = tuple(replace(s, stiffness=float(k)) for s, k in zip(candidates, stiffness, strict=True) if k > 0.0)
    return evaluate_springs(mechanism, springs)


def evaluate_springs(mechanism: Mechanism, springs: Sequence[Spring]) -> Springs:
    """Given springs, at the ``workspace_states`` up to a whole turn of the fastest joint: extremes count."""
    closure = Closure(mechanism).without_idle()
    return Springs(mechanism, tuple(springs), workspace_states(mechanism, closure, 2.0 * np.pi))


def spring_layout(mechanism: Mechanism, reach: float, height: float) -> list[Spring]:
    """Candidate springs between every two bodies, and between every body and the base."""
    up = -mechanism.gravity / np.linalg.norm(mechanism.gravity)
    pivots = [j.position for j in mechanism.tree.joints if j.parent < 0 and j.revolute] or [np.zeros(3)]
    ground = [End(-1, pivot + sign * height * up) for pivot in pivots for sign in (1.0, -1.0)]
    ends = [
        [End(body, sign * reach * axis) for axis in plane_axes(normal)[:2] for sign in (1.0, -1.0)]
        for body, normal in enumerate(mechanism.tree.normal(joint, np.eye(3)) for joint in mechanism.tree.bodies)
    ]
    pairs = [(base, end) for body in ends for base in ground for end in body]
    pairs += [(a, b) for one, other in combinations(ends, 2) for a in one for b in other]
    return [Spring(a, b) for a, b in pairs]


def _softest(mechanism: Mechanism, columns: Floats, target: Floats, cost: Floats) -> Floats:
    """Stiffnesses k >= 0 of least cost with ``columns @ k = target``, to rounding error."""
    u, size, _ = np.linalg.svd(columns, full_matrices=False)
    basis = u[:, size > 1e-10 * size[0]].T
    scale = float(np.abs(target).max()) or 1.0
    missed = target - basis.T @ (basis @ target)
    if np.abs(missed).max() > 1e-9 * scale:
        raise SizingError(f"{mechanism.name}: springs at these places cannot balance it, whatever their stiffness")
    found = linprog(cost, A_eq=basis @ columns, b_eq=basis @ target, bounds=(0.0, None), method="highs-ds")
    if not found.success:
        raise SizingError(
            f"{mechanism.name}: no springs that only pull balance it from these places: {found.message.split('.')[0]}; "
            "try another --reach or --height, or give their places with --springs"
        )
    rough = np.asarray(found.x)
    used = rough > 1e-7 * rough.max(initial=0.0)
    exact = np.zeros_like(rough)
    used[used] = nnls(columns[:, used], target)[0] > 0.0  # rounding may have left one more than are needed
    exact[used] = np.linalg.lstsq(columns[:, used], target, rcond=None)[0]
    if (exact < 0.0).any():
        raise SizingError(f"{mechanism.name}: springs did not converge: a stiffness came out below zero")
    return exact


def static_conditions(mechanism: Mechanism) -> Conditions:
    """Conditions on the inertial parameters for which weight does no work in any motion; residuals in kg m.

    V = W(q) @ pi is constant where pi is orthogonal to the rows of W less their mean over closed configurations.
    Force balance implies them; a body that only moves level needs no static balance.
    """
    if not mechanism.gravity.any():
        raise ModelError(f"{mechanism.name}: its file has no gravity: every mass is balanced statically")
    closure = Closure(mechanism)
    q = closure.states(max(48, 4 * len(mechanism.bodies) * 4))
    rows = potential_regressor(mechanism, q) / float(np.linalg.norm(mechanism.gravity))
    basis, gap = row_space(rows - rows.mean(axis=0), mechanism.name)
    return Conditions(mechanism, closure.dof, reduced_row_echelon(basis, pivot_order(mechanism)), gap)


def potential_objective(mechanism: Mechanism) -> Objective:
    """Variance of the potential energy of weight over the workspace [J2]: zero where weight does no work."""
    closure = Closure(mechanism).without_idle()
    rows = potential_regressor(mechanism, workspace_states(mechanism, closure))
    return Objective(triangle(iter([with_constant((rows - rows.mean(axis=0))[:, None])])), "J")


def static_document(found: Conditions, counter: Sizing | None, springs: Springs) -> dict[str, Any]:
    """Conditions; the mechanism as it is, with counter-masses (None: no place for any), and with springs."""
    mechanism, q = springs.mechanism, springs.q
    weight = springs.weight_energy()
    balanced = None if counter is None else potential(counter.after, q)
    masses = None
    if counter is not None and balanced is not None:
        masses = _balance(balanced, weight, _holding(counter.after, q, None)) | {
            "masses_kg": {c.site: c.mass for c in counter.counter_masses},
            "added_mass_kg": counter.added_mass,
            "added_inertia_kgm2": counter.added_inertia,
        }
    return {
        "mechanism": mechanism.name,
        "gravity_m_per_s2": [float(x) for x in mechanism.gravity],
        "configurations": len(q),
        "conditions": [
            {"text": found.text(k), "value_kgm": float(value)} for k, value in enumerate(found.values(mechanism))
        ],
        "as_it_is": _balance(weight, weight, _holding(mechanism, q, None)),
        "counter_masses": masses,
        "springs": _balance(weight + springs.energy(), weight, _holding(mechanism, q, springs))
        | {"springs": _springs(springs)},
        "workspace": {
            "weight_J": weight.tolist(),
            "springs_J": springs.energy().tolist(),
            "with_counter_masses_J": None if balanced is None else balanced.tolist(),
        },
    }


def _balance(total: Floats, weight: Floats, holding: dict[str, dict[str, float]]) -> dict[str, Any]:
    swing, whole = float(np.ptp(total)), float(np.ptp(weight))
    share = swing / whole if whole > 0.0 else None
    return {"potential_swing_J": swing, "share_of_unbalanced": share, **holding}


def _springs(found: Springs) -> list[dict[str, Any]]:
    mechanism, length = found.mechanism, spring_lengths(found.mechanism, found.springs, found.q)
    return [
        {
            "name": spring.name or f"spring {k}",
            "first": spring.first.text(mechanism),
            "second": spring.second.text(mechanism),
            "first_m": spring.first.place(mechanism).tolist(),
            "second_m": spring.second.place(mechanism).tolist(),
            "stiffness_N_per_m": spring.stiffness,
            "shortest_m": float(length[:, k - 1].min()),
            "longest_m": float(length[:, k - 1].max()),
            "force_peak_N": spring.stiffness * float(length[:, k - 1].max()),
        }
        for k, spring in enumerate(found.springs, 1)
    ]


_HOLDING = ("holding_torque_peak_Nm", "holding_force_peak_N")


def _holding(mechanism: Mechanism, q: Floats, springs: Springs | None) -> dict[str, dict[str, float]]:
    """Largest torque or force of each motor that holds the mechanism still; none where they do not determine it.

    Over the configurations where they move it at least a fifth as well as at home: near a singular position of the
    motors it has no bound.
    """
    closure, motors = Closure(mechanism).without_idle(), mechanism.driven or mechanism.coordinates
    rows, tangents = [mechanism.coordinate_index(joint) for joint in motors], closure.tangents(q)
    if len(motors) != closure.dof:
        return mechanism.drives_by_unit({}, *_HOLDING)
    at_home = np.linalg.svd(closure.tangents(closure.home[None])[:, rows], compute_uv=False).min()
    good = np.linalg.svd(tangents[:, rows], compute_uv=False).min(axis=1) >= max(0.2 * at_home, RANK_LIMIT)
    q, rates = q[good], tangents[good] @ np.linalg.inv(tangents[good][:, rows])
    still = np.zeros(q.shape[1])
    joint_torque = np.array([closure.engine.torque_regressor(state, still, still) @ mechanism.pi for state in q])
    if springs is not None:
        joint_torque += joint_torques(mechanism, springs.springs, q)
    torque = np.einsum("nij,ni->nj", rates, joint_torque)
    largest = {joint: float(np.abs(torque[:, k]).max()) for k, joint in enumerate(motors) if len(q)}
    return mechanism.drives_by_unit(largest, *_HOLDING)
