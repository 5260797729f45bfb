"""Moving base and moving mechanism together, to first order in the base's motion x = (u, phi).

**Wrench on the base.** A particle at rho(t) in the base frame is at u + R(phi) rho. With p and L the mechanism's linear
and angular momentum on a base at rest, and w = (F, M) = -(p', L') its shaking wrench, the wrench about its origin is

    w + phi x w - M(t) x'' - G(t) x',   G x' = (2 phi' x p, I' phi' + phi' x L)

with M(t) the mechanism's inertia at q(t) and I' the rate of its rotational part. With the mechanism locked, M is that
at the start and the rest is neglected. The joints follow the command relative to the base, whatever the base does.

**Torque of the motors.** A particle of velocity d(rho) per rate of drive k, on a base with the accelerations a, alpha
and the angular velocity omega, has the virtual work sum m d(rho) . (a + alpha x rho + 2 omega x rho'), so with A_k the
momentum (p, L) per rate

    tau_k = A_k (a, alpha) + omega . 2 sum m rho' x d(rho).

**Gravity.** The mounts carry the weight at rest, and sensors are zeroed there. As the base turns, the weight and the
forces of the mounts act at other places: an inverted pendulum, some 0.2 % of the default frame's stiffness.
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
from .added_bodies import rotor_momentum

if TYPE_CHECKING:
    from balance.dynamics.moving_base import Mount

ROUNDS = 40
TOLERANCE = 1e-7
"""Change of the base's acceleration in a round over its largest value, at which the iteration has converged."""


@dataclass(frozen=True)
class Coupling:
    """What couples a moving mechanism to a moving base, at each instant."""

    inertia: Floats
    """M, base axes about the base's origin, (n, 6, 6) [kg, kg m, kg m2]."""
    velocity_matrix: Floats
    """G, (n, 6, 6) [N s/m, N s, N m s]."""
    displacement_matrix: Floats
    """N with -N x = (phi x F, phi x M + (phi x s) x g), (n, 6, 6) [N, N m]; s: first moment less that at the start."""

    @classmethod
    def of(
        cls,
        mechanism: Mechanism,
        trajectory: Trajectory,
        wrench: Floats,
        rotors: Mapping[str, Rotor],
        gravity: Floats,
    ) -> "Coupling":
        """Along a trajectory with shaking wrench (n, 6) [N, N m], rotors included, in ``gravity`` (3,) [m/s2]."""
        inertia = inertia_along(mechanism, trajectory.q)
        moving = momentum(mechanism, trajectory.q, trajectory.v)
        gyration, turning = np.zeros((2, len(wrench), 6, 6))
        gyration[:, :3, 3:] = -2.0 * skews(moving[:, :3])
        rate = np.gradient(inertia[:, 3:, 3:], float(trajectory.time[1] - trajectory.time[0]), axis=0)
        gyration[:, 3:, 3:] = rate - skews(moving[:, 3:] + rotor_momentum(mechanism, rotors, trajectory.v))
        turning[:, :3, 3:], turning[:, 3:, 3:] = skews(wrench[:, :3]), skews(wrench[:, 3:])
        wandered = first_moment(inertia) - first_moment(inertia[:1])
        turning[:, 3:, 3:] -= skew(gravity) @ skews(wandered)
        return cls(inertia, gyration, turning)

    def respond(self, base: ElasticBase, locked: Floats, wrench: Floats, step: float) -> BaseMotion:
        """Motion from rest under ``wrench`` (n, 6) [N, N m] in steps of ``step`` [s].

        ``base`` contains the inertia ``locked`` (6, 6) [kg, kg m, kg m2] of the mechanism at the start; what differs
        from it is found by iteration. Raises RigError if that does not converge, the base being too light.
        """
        moved = base.respond(wrench, step)
        for _ in range(ROUNDS):
            more = (
                self.reaction(moved)
                - times(locked, moved.acceleration)
                + _times(self.displacement_matrix, moved.displacement)
            )
            after = base.respond(wrench - more, step)
            change = np.abs(after.acceleration - moved.acceleration).max()
            moved = after
            if change <= TOLERANCE * np.abs(moved.acceleration).max():
                return moved
        raise RigError(
            f"bench.coupling: the base's motion still changes by {change:.3g} m/s2 after {ROUNDS} "
            "iterations: the base is too light for what moves on it; state its mass, or coupling = 'locked'"
        )

    def reaction(self, motion: BaseMotion) -> Floats:
        """M x'' + G x', base axes, (n, 6) [N, N m]."""
        return _times(self.inertia, motion.acceleration) + _times(self.velocity_matrix, motion.velocity)


def _times(matrices: Floats, vectors: Floats) -> Floats:
    return np.matmul(matrices, vectors[:, :, None])[:, :, 0]


def base_motion_torque(
    mechanism: Mechanism,
    trajectory: Trajectory,
    rotors: Mapping[str, Rotor],
    field: Floats,
    omega: Floats,
    driven: tuple[str, ...],
) -> dict[str, Floats]:
    """Torque of each driven joint beyond that on a base at rest, (n,) [N m, N].

    ``field`` (n, 6) [m/s2, rad/s2] are the base's accelerations (a, alpha), ``omega`` (n, 3) [rad/s] its angular
    velocity, base axes.
    """
    rates, found = driven_rates(mechanism, trajectory.per_drive, driven), {}
    for k, joint in enumerate(driven):
        per_rate = momentum(mechanism, trajectory.q, rates[:, :, k])
        per_rate[:, 3:] += rotor_momentum(mechanism, rotors, rates[:, :, k])
        swept = 2.0 * velocity_cross_product(mechanism, trajectory.q, trajectory.v, rates[:, :, k])
        found[joint] = np.einsum("ni,ni->n", per_rate, field) + np.einsum("ni,ni->n", swept, omega)
    return found


def velocity_cross_product(mechanism: Mechanism, q: Floats, v: Floats, other: Floats) -> Floats:
    """Sum of m rho' x d(rho) over all particles, rates ``v``, ``other`` (n, nv) [rad/s] at q (n, nq), (n, 3) [N m].

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
    """Sum of m r r' from a body's parameters (10,) [kg, kg m, kg m2]: tr(I) / 2 - I, (3, 3) [kg m2]."""
    xx, xy, yy, xz, yz, zz = row[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.trace(inertia) / 2.0 * np.eye(3) - inertia


def gravity_in_tilted_axes(gravity: Floats, rotation_vector: Floats) -> Floats:
    """Gravity (3,) [m/s2] in the axes of a base at rest, turned by a rotation vector (3,) [rad]: R' g, (3,) [m/s2]."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(rotation_vector).as_matrix().T @ gravity)


def weight_wrench_change(weight_moment: Floats) -> Floats:
    """Wrench of the weight less that at the start, (n, 6) [N, N m], from its moment (n, 3) [N m]."""
    return np.hstack([np.zeros_like(weight_moment), weight_moment - weight_moment[0]])


def apparent_gravity(gravity: Floats, displacement: Floats) -> Floats:
    """What accelerometers show of gravity (3,) [m/s2] on a base displaced by (u, phi), (n, 6) [m, rad].

    R' (-g) + g = phi x g, (n, 3) [m/s2].
    """
    return np.cross(displacement[:, 3:], gravity)


def tilted_weight_wrench(gravity: Floats, first: Floats, mass: float, displacement: Floats) -> Floats:
    """Change of the weight's wrench in base axes as the base turns, -phi x W at the centre of mass, (n, 6) [N, N m].

    ``gravity`` (3,) [m/s2], ``first`` the first moment of mass (n, 3) [kg m], ``displacement`` (n, 6) [m, rad].
    """
    change = -apparent_gravity(gravity, displacement)
    return np.hstack([mass * change, np.cross(first, change)])


def gravitational_stiffness(mounts: "Sequence[Mount]", elastic: Floats, mass: Floats, gravity: Floats) -> Floats:
    """Geometric stiffness of weight and mount preload, to be added to the ``elastic`` one, (6, 6) each [N/m, N, N m].

    ``mass`` is the inertia of what stands on the mounts, (6, 6) [kg, kg m, kg m2], ``gravity`` (3,) [m/s2].

    A force f at p of the base, constant in space, has the moment (p + phi x p) x f about the base's origin, so it adds
    -S(f) S(p); here the weight at the centre of mass, and what each mount carries of it at rest.
    """
    first, total = first_moment(mass), float(mass[0, 0])
    sag = np.linalg.solve(elastic, np.concatenate([total * gravity, np.cross(first, gravity)]))
    added = np.zeros((6, 6))
    added[3:, 3:] = -skew(gravity) @ skew(first)
    for mount in mounts:
        at = np.array(mount.position)
        preload = -np.array(mount.stiffness) * (displacement_at(at) @ sag)
        added[3:, 3:] -= skew(preload) @ skew(at)
    return added
