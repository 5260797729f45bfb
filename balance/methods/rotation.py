"""How the bodies of a planar mechanism turn in the base frame, along a trajectory and per motor."""

from dataclasses import dataclass

import numpy as np

from .. import kinematics
from ..arrays import Floats
from ..closure import Trajectory
from ..components import dense
from ..dynamics.inverse_dynamics import driven_rates
from ..mechanism import Mechanism


@dataclass(frozen=True)
class Rotation:
    """Rotation of every body about the base's z axis."""

    omega: Floats
    """Angular velocity, (n, bodies) [rad/s]."""
    alpha: Floats
    """Angular acceleration, (n, bodies) [rad/s2]."""
    per_motor: Floats
    """Angular velocity per motor speed, (n, bodies, motors)."""


def angular_velocity(mechanism: Mechanism, q: Floats, v: Floats) -> Floats:
    """Angular velocity of the bodies about z at (n, nv) states, (n, bodies) [rad/s]."""
    return _turning(mechanism, q, v, np.zeros_like(v))[0]


def rotation(mechanism: Mechanism, trajectory: Trajectory) -> Rotation:
    """Rotation of the bodies along a trajectory."""
    omega, alpha = _turning(mechanism, trajectory.q, trajectory.v, trajectory.a)
    motors = mechanism.driven or mechanism.coordinates
    rates = driven_rates(mechanism, trajectory.per_drive, motors)
    each = [angular_velocity(mechanism, trajectory.q, rates[:, :, k]) for k in range(rates.shape[2])]
    return Rotation(omega, alpha, np.stack(each, axis=2))


def _turning(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]:
    q, v, a = (np.ascontiguousarray(x.T) for x in (q, v, a))
    at = kinematics.pose(mechanism.tree, q)
    moving = kinematics.motion(mechanism.tree, at, v, a)
    joints = mechanism.tree.bodies
    omega = np.array([dense(moving.omega[j], at.count)[2] for j in joints]).T
    alpha = np.array([dense(moving.alpha[j], at.count)[2] for j in joints]).T
    return omega, alpha
