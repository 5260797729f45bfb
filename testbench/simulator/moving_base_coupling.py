"""Moving base and moving mechanism together, to first order in the base's motion x = (u, phi).

A particle at rho(t) in the base frame is at u + R(phi) rho, so with p and L the mechanism's linear and angular momentum
on a base at rest, and w = (F, M) = -(p', L') its shaking wrench, what moves the base about its own origin is

    w + phi x w - M(t) x'' - G(t) x',   G x' = (2 phi' x p, I' phi' + phi' x L)

with M(t) the mechanism's inertia at q(t) and I' the rate of its turning part. Locked, M is that at the start and the
rest is left out. The joints follow the command relative to the base, whatever the base does.

What a moving base asks of the motors, to first order in its motion.

A particle of velocity d(rho) per rate of drive k, on a base that accelerates by a + alpha x rho and turns at omega, has
the virtual work tau_k = sum m d(rho) . (a + alpha x rho + 2 omega x rho'): with A_k the momentum (p, L) per rate,

    tau_k = A_k (a, alpha) + omega . 2 sum m rho' x d(rho).

Gravity on a base that moves: what the weight does as the platform wanders and the base tilts.

The mounts carry the weight at rest, and sensors are zeroed there. As the base turns, the weight acts at another place,
and so do the forces of the mounts that hold it: a pendulum upside down, some 0.2 % of the default frame's stiffness.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.closure import Trajectory
from balance.dynamics.inverse_dynamics import driven_rates, momentum
from balance.dynamics.moving_base import (
    BaseMotion,
    ElasticBase,
    displacement_at,
    first_moment,
    inertia_along,
    skew,
    skews,
    times,
)
from balance.mechanism import forward_kinematics
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.sparse_components import Vector, dense

from ..errors import RigError
from ..rig.bench import Rotor
from .added_bodies import momentum as spin

if TYPE_CHECKING:
    from ..rig.bench import Mount

ROUNDS = 40
AGREED = 1e-7
"""Change of the base's acceleration in a round, as a share of its largest, at which the motion counts as found."""


@dataclass(frozen=True)
class Coupling:
    """What couples a moving mechanism to a moving base, at each instant."""

    inertia: Floats
    """M, (n, 6, 6)."""
    gyration: Floats
    """G, (n, 6, 6)."""
    turning: Floats
    """N with -N x = (phi x F, phi x M + (phi x s) x g), (n, 6, 6); s: first moment of mass less that at the start."""

    @classmethod
    def of(
        cls,
        mechanism: Mechanism,
        trajectory: Trajectory,
        wrench: Floats,
        rotors: Mapping[str, Rotor],
        gravity: Floats,
    ) -> "Coupling":
        """Along a trajectory with shaking wrench (n, 6) [N, N m], that of the rotors included; gravity (3,) or zero."""
        inertia = inertia_along(mechanism, trajectory.q)
        moving = momentum(mechanism, trajectory.q, trajectory.v)
        gyration, turning = np.zeros((2, len(wrench), 6, 6))
        gyration[:, :3, 3:] = -2.0 * skews(moving[:, :3])
        rate = np.gradient(inertia[:, 3:, 3:], float(trajectory.time[1] - trajectory.time[0]), axis=0)
        gyration[:, 3:, 3:] = rate - skews(moving[:, 3:] + spin(mechanism, rotors, trajectory.v))
        turning[:, :3, 3:], turning[:, 3:, 3:] = skews(wrench[:, :3]), skews(wrench[:, 3:])
        wandered = first_moment(inertia) - first_moment(inertia[:1])
        turning[:, 3:, 3:] -= skew(gravity) @ skews(wandered)
        return cls(inertia, gyration, turning)

    def respond(self, base: ElasticBase, carried: Floats, push: Floats, step: float) -> BaseMotion:
        """Motion from rest under ``push`` (n, 6), the base holding ``carried``; the rest of M by iteration.

        Raises RigError if the mechanism is so heavy beside its base that the rounds do not agree.
        """
        moved = base.respond(push, step)
        for _ in range(ROUNDS):
            more = self.reaction(moved) - times(carried, moved.acceleration) + _times(self.turning, moved.displacement)
            after = base.respond(push - more, step)
            change = np.abs(after.acceleration - moved.acceleration).max()
            moved = after
            if change <= AGREED * np.abs(moved.acceleration).max():
                return moved
        raise RigError(
            f"bench.coupling: the base's motion still changes by {change:.3g} m/s2 after {ROUNDS} rounds: expected a "
            "base that is heavier than what moves on it; state its mass, or coupling = 'locked'"
        )

    def reaction(self, motion: BaseMotion) -> Floats:
        """M x'' + G x', base axes, (n, 6) [N, N m]."""
        return _times(self.inertia, motion.acceleration) + _times(self.gyration, motion.velocity)


def _times(matrices: Floats, vectors: Floats) -> Floats:
    return np.matmul(matrices, vectors[:, :, None])[:, :, 0]


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
    at = forward_kinematics.pose(mechanism.tree, np.ascontiguousarray(q.T))
    one, two = (forward_kinematics.motion(mechanism.tree, at, np.ascontiguousarray(rates.T)) for rates in (v, other))
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


def rotation(turn: Floats) -> Floats:
    """Rotation matrix of a rotation vector (3,) [rad], (3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(turn).as_matrix())


def tilted(gravity: Floats, turn: Floats) -> Floats:
    """Gravity (3,) in the axes of a base that rests turned by ``turn`` (3,) [rad]: R' g."""
    return rotation(turn).T @ gravity


def wandering(weight_moment: Floats) -> Floats:
    """Wrench of the weight less that at rest, (n, 6), from its moment (n, 3): constant weight, wandering place."""
    return np.hstack([np.zeros_like(weight_moment), weight_moment - weight_moment[0]])


def apparent_gravity(gravity: Floats, displacement: Floats) -> Floats:
    """What a base displaced by (u, phi), (n, 6), makes accelerometers show: R' (-g) + g = phi x g, (n, 3) [m/s2]."""
    return np.cross(displacement[:, 3:], gravity)


def turned_weight(gravity: Floats, first: Floats, mass: float, displacement: Floats) -> Floats:
    """Change of the weight's wrench in base axes as the base turns, (n, 6) [N, N m]: -phi x W, at the centre of mass.

    ``first`` is the first moment of mass (n, 3) [kg m].
    """
    change = -apparent_gravity(gravity, displacement)
    return np.hstack([mass * change, np.cross(first, change)])


def stiffness(mounts: "Sequence[Mount]", elastic: Floats, mass: Floats, gravity: Floats) -> Floats:
    """What weight and preload of the mounts add to the ``elastic`` stiffness of the mounts, (6, 6) each [N m/rad].

    A force f at p of the base, constant in space, has the moment (p + phi x p) x f about the base's origin, so it adds
    -S(f) S(p); here the weight at the centre of mass, and what each mount holds of it at rest.
    """
    first, total = first_moment(mass), float(mass[0, 0])
    sunk = np.linalg.solve(elastic, np.concatenate([total * gravity, np.cross(first, gravity)]))
    added = np.zeros((6, 6))
    added[3:, 3:] = -skew(gravity) @ skew(first)
    for mount in mounts:
        at = np.array(mount.position)
        held = -np.array(mount.stiffness) * (displacement_at(at) @ sunk)
        added[3:, 3:] -= skew(held) @ skew(at)
    return added
