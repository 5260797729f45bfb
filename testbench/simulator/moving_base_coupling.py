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

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.closure import Trajectory
from balance.dynamics.inverse_dynamics import momentum
from balance.dynamics.moving_base import (
    BaseMotion,
    apparent_gravity,
    first_moment,
    inertia_along,
    second_moment,
    skew,
)
from balance.mechanism.forward_kinematics import motion, pose
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.tape import Program, Symbols, Tape, cross

from ..rig.bench import Rotor
from .added_bodies import rotor_momentum


@dataclass(frozen=True)
class Coupling:
    """What couples a moving mechanism to a moving base, at each instant."""

    inertia: Floats
    """M, base axes about the base's origin, (n, 6, 6) [kg, kg m, kg m2]."""
    velocity_matrix: Floats
    """G, (n, 6, 6) [N s/m, N s, N m s]."""

    @classmethod
    def of(cls, mechanism: Mechanism, trajectory: Trajectory, rotors: Mapping[str, Rotor]) -> "Coupling":
        """Along a trajectory."""
        inertia = inertia_along(mechanism, trajectory.q)
        moving = momentum(mechanism, trajectory.q, trajectory.v)
        gyration = np.zeros_like(inertia)
        gyration[:, :3, 3:] = -2.0 * skew(moving[:, :3])
        rate = np.gradient(inertia[:, 3:, 3:], float(trajectory.time[1] - trajectory.time[0]), axis=0)
        gyration[:, 3:, 3:] = rate - skew(moving[:, 3:] + rotor_momentum(mechanism, rotors, trajectory.v))
        return cls(inertia, gyration)

    def every(self, stride: int) -> "Coupling":
        """At every ``stride``-th instant."""
        return Coupling(self.inertia[::stride], self.velocity_matrix[::stride])

    def turned(self, motion: BaseMotion, wrench: Floats, gravity: Floats) -> Floats:
        """What a ``wrench`` (n, 6) [N, N m], and weight that wandered, gain as the base turns, (n, 6) [N, N m].

        Base axes: (phi x F, phi x M + (phi x s) x g), s the first moment less that at the start.
        """
        phi, first = motion.displacement[:, 3:], first_moment(self.inertia)
        weight = np.cross(np.cross(phi, first - first[0]), gravity)
        return np.hstack([np.cross(phi, wrench[:, :3]), np.cross(phi, wrench[:, 3:]) + weight])

    def reaction(self, motion: BaseMotion) -> Floats:
        """M x'' + G x', base axes, (n, 6) [N, N m]."""
        return _times(self.inertia, motion.acceleration) + _times(self.velocity_matrix, motion.velocity)


def _times(matrices: Floats, vectors: Floats) -> Floats:
    return np.einsum("nij,nj->ni", matrices, vectors)


def base_motion_loads(
    mechanism: Mechanism, trajectory: Trajectory, rotors: Mapping[str, Rotor], rates: Floats
) -> tuple[Floats, Floats]:
    """Loads of the base's motion on coordinates with ``rates`` (n, nv, k) of all joints per rate of each [rad/s, m/s].

    Per acceleration of the base, (n, k, 6) [kg m, kg m2], the momentum per rate; per angular velocity, (n, k, 3).
    """
    columns = [np.ascontiguousarray(rates[:, :, k]) for k in range(rates.shape[2])]
    per_rate = np.stack([momentum(mechanism, trajectory.q, rate) for rate in columns], axis=1)
    for k, rate in enumerate(columns):
        per_rate[:, k, 3:] += rotor_momentum(mechanism, rotors, rate)
    swept = [2.0 * velocity_cross_product(mechanism, trajectory.q, trajectory.v, rate) for rate in columns]
    return per_rate, np.stack(swept, axis=1)


def base_motion_torque(loads: tuple[Floats, Floats], field: Floats, omega: Floats) -> Floats:
    """Torques (n, k) [N m, N] beyond those on a base at rest, from its ``base_motion_loads``.

    ``field`` (n, 6) [m/s2, rad/s2] are the base's accelerations (a, alpha), ``omega`` (n, 3) [rad/s] its angular
    velocity, base axes.
    """
    per_rate, swept = loads
    return np.einsum("nki,ni->nk", per_rate, field) + np.einsum("nki,ni->nk", swept, omega)


def velocity_cross_product(mechanism: Mechanism, q: Floats, v: Floats, other: Floats) -> Floats:
    """Sum of m rho' x d(rho) over all particles, rates ``v``, ``other`` (n, nv) [rad/s] at q (n, nq), (n, 3) [N m].

    A body with first moment h and J = sum m r r' about its joint's origin: m v1 x v2 + v1 x (w2 x h) + (w1 x h) x v2
    + J (w1 x w2).
    """
    tree = mechanism.tree

    def write() -> Program:
        tape = Tape()
        at = pose(tree, tape.rows(tree.size))
        one, two = (motion(tree, at, tape.rows(tree.size)) for _ in range(2))

        def of_body(row: Symbols, joint: int) -> Symbols:
            first, rotation = at.arm(joint, row[1:4]), at.rotation[joint]
            v1, v2, w1, w2 = one.velocity[joint], two.velocity[joint], one.omega[joint], two.omega[joint]
            swept = row[0] * cross(v1, v2) + (cross(v1, cross(w2, first)) + cross(cross(w1, first), v2))
            return swept + rotation @ (second_moment(row) @ (rotation.T @ cross(w1, w2)))

        bodies = zip(tape.parameters(mechanism.parameters), tree.bodies, strict=True)
        return tape.program(np.sum([of_body(*body) for body in bodies], axis=0))

    program = tree.once(("swept", (mechanism.parameters != 0.0).tobytes()), write)
    return program.values(q.T, v.T, other.T, parameters=mechanism.pi).T


def weight_wrench_change(weight_moment: Floats) -> Floats:
    """Wrench of the weight less that at the start, (n, 6) [N, N m], from its moment (n, 3) [N m]."""
    return np.hstack([np.zeros_like(weight_moment), weight_moment - weight_moment[0]])


def tilted_weight_wrench(gravity: Floats, first: Floats, mass: float, displacement: Floats) -> Floats:
    """Change of the weight's wrench in base axes as the base turns, -phi x W at the centre of mass, (n, 6) [N, N m].

    ``gravity`` (3,) [m/s2], ``first`` the first moment of mass (n, 3) [kg m], ``displacement`` (n, 6) [m, rad].
    """
    change = -apparent_gravity(gravity, displacement)
    return np.hstack([mass * change, np.cross(first, change)])
