"""Momentum, shaking wrench and drive torque of a mechanism along a trajectory, by summing over bodies.

The same quantities as ``regressor.W @ pi``, without building W: for one design at many instants.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from . import kinematics
from .arrays import Floats
from .closure import BLOCK, Trajectory
from .errors import ModelError
from .kinematics import cross, rotate
from .kinematics import motion as moving_at
from .mechanism import Mechanism


@dataclass(frozen=True)
class Response:
    """What a mechanism does to its base and asks of its motors along a trajectory."""

    time: Floats
    """Time, (n,) [s]."""
    force: Floats
    """Shaking force, base axes: what the mechanism exerts on its base, weight excluded, (n, 3) [N]."""
    moment: Floats
    """Shaking moment about the origin of the base frame, weight excluded, (n, 3) [N m]."""
    torque: Mapping[str, Floats]
    """Torque of each driven joint on its body, gravity and joint friction included, (n,) [N m, N]."""
    weight_moment: Floats
    """Moment of the moving weight about the origin of the base frame, (n, 3) [N m]."""

    def rms(self) -> dict[str, float]:
        """Root mean square of each component [N, N m]."""
        return {name: float(np.sqrt(np.mean(values**2))) for name, values in self.columns().items()}

    def peak(self) -> dict[str, float]:
        """Largest absolute value of each component [N, N m]."""
        return {name: float(np.abs(values).max()) for name, values in self.columns().items()}

    def columns(self) -> dict[str, Floats]:
        """Components by name and unit: ``Fx_N`` ... ``Mz_Nm``, ``torque_A0_Nm``, each (n,)."""
        names = [f"F{axis}_N" for axis in "xyz"] + [f"M{axis}_Nm" for axis in "xyz"]
        wrench = dict(zip(names, np.hstack([self.force, self.moment]).T, strict=True))
        return wrench | {f"torque_{joint}_Nm": values for joint, values in self.torque.items()}


def simulate(mechanism: Mechanism, trajectory: Trajectory) -> Response:
    """Shaking wrench and drive torque along a trajectory.

    F = -d(linear momentum)/dt, M = -d(angular momentum)/dt about the base frame's origin.
    """
    count = len(trajectory.time)
    force, moment, weight = np.empty((3, count, 3))
    joint_torque = np.empty_like(trajectory.q)
    for start in range(0, count, BLOCK):
        part = slice(start, start + BLOCK)
        q, v, a = (np.ascontiguousarray(x[part].T) for x in (trajectory.q, trajectory.v, trajectory.a))
        loads = _loads(mechanism, q, v, a)
        force[part], moment[part], weight[part] = -loads.force.T, -loads.moment.T, loads.weight_moment.T
        joint_torque[part] = loads.joint_torque.T
    torque = _drive_torque(mechanism, trajectory, joint_torque)
    return Response(trajectory.time, force, moment, torque, weight)


def momentum(mechanism: Mechanism, q: Floats, v: Floats) -> Floats:
    """Linear momentum [kg m/s], then angular about the base frame's origin [kg m2/s], for (n, nv) states, (n, 6)."""
    at = kinematics.pose(mechanism.tree, np.ascontiguousarray(q.T))
    moving = moving_at(mechanism.tree, at, np.ascontiguousarray(v.T), np.zeros_like(v.T))
    linear, angular = np.zeros((2, 3, len(q)))
    for row, joint in zip(mechanism.parameters, mechanism.tree.bodies, strict=True):
        first = rotate(at.rotation[joint], row[1:4])
        p = row[0] * moving.velocity[joint] + cross(moving.omega[joint], first)
        linear += p
        angular += cross(at.position[joint], p) + cross(first, moving.velocity[joint])
        angular += _inertia_times(at.rotation[joint], row, moving.omega[joint])
    return np.concatenate([linear, angular]).T


@dataclass(frozen=True)
class _Loads:
    force: Floats
    moment: Floats
    weight_moment: Floats
    joint_torque: Floats


def _loads(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> _Loads:
    """Rate of momentum (3, n), weight's moment, and the torque of every joint of the open tree (nv, n)."""
    tree, gravity = mechanism.tree, mechanism.gravity[:, None]
    at = kinematics.pose(tree, q)
    moving = moving_at(tree, at, v, a)
    inertial: list[Floats] = [np.zeros((2, 3, q.shape[1])) for _ in range(tree.size)]
    weight: list[Floats] = [np.zeros((2, 3, q.shape[1])) for _ in range(tree.size)]
    for row, joint in zip(mechanism.parameters, tree.bodies, strict=True):
        first = rotate(at.rotation[joint], row[1:4])
        inertial[joint] = _rate_of_momentum(row, first, at, moving, joint)
        centre = row[0] * at.position[joint] + first
        weight[joint] = np.stack([np.broadcast_to(row[0] * gravity, centre.shape), cross(centre, gravity)])
    torque = mechanism.armature[:, None] * a + mechanism.viscous[:, None] * v
    torque += mechanism.coulomb[:, None] * np.sign(v)
    total, total_weight = np.zeros((2, 2, 3, q.shape[1]))
    for i in reversed(range(tree.size)):
        torque[i] += _along(at, i, inertial[i] - weight[i], tree.joints[i].revolute)
        parent = tree.joints[i].parent
        if parent >= 0:
            inertial[parent], weight[parent] = inertial[parent] + inertial[i], weight[parent] + weight[i]
        else:
            total, total_weight = total + inertial[i], total_weight + weight[i]
    return _Loads(total[0], total[1], total_weight[1], torque)


def _rate_of_momentum(row: Floats, first: Floats, at: kinematics.Pose, moving: kinematics.Motion, joint: int) -> Floats:
    """Force and moment about the base origin that move one body, (2, 3, n). Newton-Euler about the joint's origin o:

    F = m a_o + al x h + w x (w x h),   M = o x F + h x a_o + I al + w x (I w),   h the first moment of mass.
    """
    omega, alpha, acceleration = moving.omega[joint], moving.alpha[joint], moving.acceleration[joint]
    force = row[0] * acceleration + cross(alpha, first) + cross(omega, cross(omega, first))
    moment = cross(at.position[joint], force) + cross(first, acceleration)
    moment += _inertia_times(at.rotation[joint], row, alpha)
    moment += cross(omega, _inertia_times(at.rotation[joint], row, omega))
    return np.stack([force, moment])


def _inertia_times(rotation: Floats, row: Floats, vector: Floats) -> Floats:
    """Inertia about the joint's origin times a base-frame vector, (3, n)."""
    xx, xy, yy, xz, yz, zz = row[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    local = inertia @ np.einsum("jin,jn->in", rotation, vector)
    return np.einsum("ijn,jn->in", rotation, local)


def _along(at: kinematics.Pose, joint: int, load: Floats, revolute: bool) -> Floats:
    """Share of a load (force, moment about the base origin) along a joint's axis, (n,)."""
    force, moment = load
    if revolute:
        moment = moment - cross(at.position[joint], force)
        return np.einsum("in,in->n", at.axis[joint], moment)
    return np.einsum("in,in->n", at.axis[joint], force)


def _drive_torque(mechanism: Mechanism, trajectory: Trajectory, joint_torque: Floats) -> dict[str, Floats]:
    """Torques of the driven joints: those of the open tree, projected on what the loops allow."""
    driven = mechanism.driven or (mechanism.coordinates if not mechanism.loops else ())
    if not driven:
        return {}
    projection = driven_rates(mechanism, trajectory.per_drive, driven)
    torque = np.einsum("nij,ni->nj", projection, joint_torque)
    return {joint: torque[:, i] for i, joint in enumerate(driven)}


def driven_rates(mechanism: Mechanism, per_drive: Floats, driven: tuple[str, ...]) -> Floats:
    """Rates of all coordinates per rate of the driven joints, (n, nv, dof), from those per driven coordinate.

    Raises ModelError where the number of driven joints is not that of the degrees of freedom.
    """
    if len(driven) != per_drive.shape[2]:
        raise ModelError(
            f"{mechanism.name} has {per_drive.shape[2]} degrees of freedom and {len(driven)} driven joints "
            f"({', '.join(driven)}): their torques are not determined"
        )
    rows = [mechanism.coordinate_index(joint) for joint in driven]
    return np.einsum("nij,njk->nik", per_drive, np.linalg.inv(per_drive[:, rows]))
