"""What a moving base asks of the motors, to first order in its motion.

A particle of velocity d(rho) per rate of drive k, on a base that accelerates by a + alpha x rho and turns at omega, has
the virtual work tau_k = sum m d(rho) . (a + alpha x rho + 2 omega x rho'): with A_k the momentum (p, L) per rate,

    tau_k = A_k (a, alpha) + omega . 2 sum m rho' x d(rho).
"""

from collections.abc import Mapping

import numpy as np

from balance import kinematics
from balance.arrays import Floats
from balance.closure import Trajectory
from balance.components import Vector, dense
from balance.dynamics.inverse_dynamics import driven_rates, momentum
from balance.mechanism import Mechanism

from ..rig.effects import Rotor
from .rotors import momentum as spin


def torque_of_base(
    mechanism: Mechanism,
    trajectory: Trajectory,
    rotors: Mapping[str, Rotor],
    field: Floats,
    turning: Floats,
    driven: tuple[str, ...],
) -> dict[str, Floats]:
    """Torque beyond that on a base at rest, of each driven joint, (n,) [N m, N].

    ``field`` (n, 6) are the base's accelerations (a, alpha), ``turning`` (n, 3) its angular velocity, base axes.
    """
    rates, found = driven_rates(mechanism, trajectory.per_drive, driven), {}
    for k, joint in enumerate(driven):
        per_rate = momentum(mechanism, trajectory.q, rates[:, :, k])
        per_rate[:, 3:] += spin(mechanism, rotors, rates[:, :, k])
        swept = 2.0 * crossed(mechanism, trajectory.q, trajectory.v, rates[:, :, k])
        found[joint] = np.einsum("ni,ni->n", per_rate, field) + np.einsum("ni,ni->n", swept, turning)
    return found


def crossed(mechanism: Mechanism, q: Floats, v: Floats, other: Floats) -> Floats:
    """Sum of m rho' x d(rho) over all particles, for rates ``v`` and ``other`` (n, nv), (n, 3).

    A body with first moment h and J = sum m r r' about its joint's origin: m v1 x v2 + v1 x (w2 x h) + (w1 x h) x v2
    + J (w1 x w2).
    """
    at = kinematics.pose(mechanism.tree, np.ascontiguousarray(q.T))
    one, two = (kinematics.motion(mechanism.tree, at, np.ascontiguousarray(rates.T)) for rates in (v, other))
    total = np.zeros((at.count, 3))

    def full(vector: Vector) -> Floats:
        return dense(vector, at.count).T

    for row, joint in zip(mechanism.parameters, mechanism.tree.bodies, strict=True):
        first, (v1, v2) = full(at.arm(joint, row[1:4])), (full(motion.velocity[joint]) for motion in (one, two))
        w1, w2 = (full(motion.omega[joint]) for motion in (one, two))
        total += (
            float(row[0]) * np.cross(v1, v2) + np.cross(v1, np.cross(w2, first)) + np.cross(np.cross(w1, first), v2)
        )
        both = np.cross(w1, w2)
        if np.any(both):
            turn = np.stack([full(at.arm(joint, unit)) for unit in np.eye(3)], axis=2)
            total += np.einsum("nij,jk,nlk,nl->ni", turn, second_moment(row), turn, both)
    return total


def second_moment(row: Floats) -> Floats:
    """Sum of m r r' of a body's parameters (10,), (3, 3) [kg m2]: half the trace of the inertia, less the inertia."""
    xx, xy, yy, xz, yz, zz = row[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.trace(inertia) / 2.0 * np.eye(3) - inertia
