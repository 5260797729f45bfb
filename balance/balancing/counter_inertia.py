"""Counter-inertias: wheels on the base that turn against bodies and take up the angular momentum.

A serial chain or four-bar balanced in force has L = sum_b J_b omega_b with constant J_b, the four-bar if its coupler's
centre is on its line; elsewhere J_b are not constant, and wheels leave a stated residual. A wheel of inertia J_b / k
geared to turn at -k omega_b takes up its share; the motors then drive k J_b more.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..closure import Trajectory
from ..dynamics.inverse_dynamics import driven_rates, momentum
from ..mechanism.forward_kinematics import motions
from ..mechanism.mechanism import Mechanism
from .objective import workspace_motions


@dataclass(frozen=True)
class BodyRotation:
    """Rotation of every body about the base's z axis."""

    omega: Floats
    """Angular velocity, (n, bodies) [rad/s]."""
    alpha: Floats
    """Angular acceleration, (n, bodies) [rad/s2]."""
    per_motor: Floats
    """Angular velocity per motor speed, (n, bodies, motors) [-, 1/m]."""


def angular_velocity(mechanism: Mechanism, q: Floats, v: Floats) -> Floats:
    """Angular velocity of the bodies about z at (n, nv) states, (n, bodies) [rad/s]."""
    return _rates_about_z(mechanism, q, v, np.zeros_like(v))[0]


def body_rotation(mechanism: Mechanism, trajectory: Trajectory) -> BodyRotation:
    """Rotation of the bodies along a trajectory."""
    omega, alpha = _rates_about_z(mechanism, trajectory.q, trajectory.v, trajectory.a)
    motors = mechanism.driven or mechanism.coordinates
    rates = driven_rates(mechanism, trajectory.per_drive, motors)
    each = [angular_velocity(mechanism, trajectory.q, rates[:, :, k]) for k in range(rates.shape[2])]
    return BodyRotation(omega, alpha, np.stack(each, axis=2))


def _rates_about_z(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]:
    moving, joints = motions(mechanism.tree, q, v, a), list(mechanism.tree.bodies)
    return moving.omega[:, joints, 2], moving.alpha[:, joints, 2]


COMPLETE = 1e-9
"""Residual share of the angular momentum up to which wheels count as complete."""


@dataclass(frozen=True)
class Wheel:
    """A wheel on the base, geared to a body."""

    body: int
    """Index of the body against whose rotation in the base frame it turns."""
    momentum: float
    """J_b: what it takes up per angular velocity of the body [kg m2]; negative where it turns with the body."""


@dataclass(frozen=True)
class Wheels:
    """Wheels for a mechanism, and the residual share of its angular momentum."""

    wheels: tuple[Wheel, ...]
    residual_share: float
    """Largest residual angular momentum over the largest without wheels, over the workspace [-]."""

    def is_complete(self, tol: float = COMPLETE) -> bool:
        """Whether the residual share is at most ``tol`` [-]."""
        return self.residual_share <= tol


def fit_wheels(mechanism: Mechanism) -> Wheels:
    """Wheels of least residual angular momentum about z, against bodies pivoted on the base if those are enough.

    Least squares over the ``workspace_motions``.
    """
    q, v = workspace_motions(mechanism)
    states = angular_velocity(mechanism, q, v), momentum(mechanism, q, v)[:, 5]
    ground = [b for b, j in enumerate(mechanism.tree.bodies) if _on_the_base(mechanism, j)]
    turning = [b for b in range(len(mechanism.bodies)) if _turns(mechanism, b)]
    best = _fitted(*states, [b for b in ground if b in turning])
    if best.is_complete() or set(turning) <= set(ground):
        return best
    everywhere = _fitted(*states, [*ground, *(b for b in turning if b not in ground)])
    return everywhere if everywhere.residual_share < best.residual_share else best


def _fitted(rows: Floats, target: Floats, bodies: Sequence[int]) -> Wheels:
    columns = _independent(rows, bodies)
    solved = np.linalg.lstsq(rows[:, columns], target, rcond=None)[0] if columns else np.empty(0)
    size = float(np.abs(target).max()) or 1.0
    residual = float(np.abs(target - rows[:, columns] @ solved).max()) / size
    wheels = [Wheel(b, float(j)) for b, j in zip(columns, solved, strict=True) if abs(j) > 1e-12 * np.abs(solved).max()]
    return Wheels(tuple(wheels), residual)


def _independent(rows: Floats, bodies: Sequence[int]) -> list[int]:
    """Bodies, in order, whose rotation is no combination of that of those before them."""
    chosen: list[int] = []
    for body in bodies:
        trial = rows[:, [*chosen, body]]
        size = np.linalg.svd(trial, compute_uv=False)
        if size[-1] > 1e-9 * max(size[0], 1e-300):
            chosen.append(body)
    return chosen


def _on_the_base(mechanism: Mechanism, joint: int) -> bool:
    return mechanism.tree.joints[joint].parent < 0 and mechanism.tree.joints[joint].revolute


def _turns(mechanism: Mechanism, body: int) -> bool:
    return any(mechanism.tree.joints[j].revolute for j in mechanism.tree.path(mechanism.tree.bodies[body]))
