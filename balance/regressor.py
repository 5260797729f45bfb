"""Momentum, shaking wrench and joint torque as ``W @ pi``: linear in the inertial parameters of all bodies.

Columns are the mechanism's ``parameter_names``. States need not be closed: what is projected on loops comes after.
"""

import numpy as np

from . import kinematics
from .arrays import Floats
from .kinematics import cross
from .kinematics import motion as moving_at
from .mechanism import Mechanism

_INERTIA = np.zeros((6, 3, 3))
for _k, (_i, _j) in enumerate([(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)]):
    _INERTIA[_k, _i, _j] = _INERTIA[_k, _j, _i] = 1.0


def momentum_regressor(mechanism: Mechanism, q: Floats, v: Floats) -> Floats:
    """W with ``W @ pi`` = linear [kg m/s] and angular momentum about the base frame's origin [kg m2/s], (n, 6, 10 nb).

    ``q`` and ``v`` are (n, nv).
    """
    at, moving = _states(mechanism, q, v, np.zeros_like(v))
    columns = np.zeros((len(mechanism.bodies), 10, 6, len(q)))
    for block, joint in zip(columns, mechanism.tree.bodies, strict=True):
        rotation, omega, velocity = at.rotation[joint], moving.omega[joint], moving.velocity[joint]
        block[0, :3] = velocity
        for k in range(3):
            arm = rotation[:, k]
            block[1 + k, :3] = cross(omega, arm)
            block[1 + k, 3:] = cross(arm, velocity)
        block[:4, 3:] += np.stack([cross(at.position[joint], linear) for linear in block[:4, :3]])
        block[4:, 3:] = _inertia_columns(rotation, omega)
    return _as_matrix(columns)


def wrench_regressor(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> Floats:
    """W with ``W @ pi`` = shaking force [N] and moment about the base frame's origin [N m], (n, 6, 10 nb).

    What the mechanism exerts on its base, weight excluded, base axes; ``q``, ``v``, ``a`` are (n, nv).
    """
    at, moving = _states(mechanism, q, v, a)
    columns = [_rate_of_momentum(at, moving, joint) for joint in mechanism.tree.bodies]
    return -_as_matrix(np.array(columns))


def torque_regressor(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> Floats:
    """W with ``W @ pi`` = torques of the joints of the open tree, gravity included, (n, nv, 10 nb) [N m, N].

    Torques of the driven joints of a closed loop are ``driven_rates.T @ W @ pi``. Armature and friction are apart.
    """
    tree = mechanism.tree
    at, moving = _states(mechanism, q, v, a)
    columns = np.zeros((len(mechanism.bodies), 10, tree.size, len(q)))
    for block, joint in zip(columns, tree.bodies, strict=True):
        load = _rate_of_momentum(at, moving, joint) - _weight(mechanism, at, joint)
        for i in tree.path(joint):
            force, moment = load[:, :3], load[:, 3:]
            if tree.joints[i].revolute:
                moment = moment - np.stack([cross(at.position[i], f) for f in force])
                block[:, i] = np.einsum("in,kin->kn", at.axis[i], moment)
            else:
                block[:, i] = np.einsum("in,kin->kn", at.axis[i], force)
    return _as_matrix(columns)


def driven_torque_regressor(mechanism: Mechanism, q: Floats, v: Floats, a: Floats, rates: Floats) -> Floats:
    """W with ``W @ pi`` = torques of the driven joints, (n, dof, 10 nb) [N m, N].

    ``rates`` (n, nv, dof) are the rates of all coordinates per rate of the driven joints.
    """
    return np.einsum("nij,nik->njk", rates, torque_regressor(mechanism, q, v, a))


def _states(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> tuple[kinematics.Pose, kinematics.Motion]:
    at = kinematics.pose(mechanism.tree, np.ascontiguousarray(q.T))
    return at, moving_at(mechanism.tree, at, np.ascontiguousarray(v.T), np.ascontiguousarray(a.T))


def _rate_of_momentum(at: kinematics.Pose, moving: kinematics.Motion, joint: int) -> Floats:
    """Force and moment about the base origin per parameter of one body, (10, 6, n).

    Newton-Euler about the joint's origin o: F = m a_o + al x h + w x (w x h),
    M = o x F + h x a_o + I al + w x (I w), with the first moment h and the inertia I linear in the parameters.
    """
    rotation, omega, alpha = at.rotation[joint], moving.omega[joint], moving.alpha[joint]
    acceleration = moving.acceleration[joint]
    block = np.zeros((10, 6, omega.shape[1]))
    block[0, :3] = acceleration
    for k in range(3):
        arm = rotation[:, k]
        block[1 + k, :3] = cross(alpha, arm) + cross(omega, cross(omega, arm))
        block[1 + k, 3:] = cross(arm, acceleration)
    block[:4, 3:] += np.stack([cross(at.position[joint], force) for force in block[:4, :3]])
    turning = np.stack([cross(omega, column) for column in _inertia_columns(rotation, omega)])
    block[4:, 3:] = _inertia_columns(rotation, alpha) + turning
    return block


def _weight(mechanism: Mechanism, at: kinematics.Pose, joint: int) -> Floats:
    """Weight and its moment about the base origin per parameter of one body, (10, 6, n)."""
    gravity = mechanism.gravity[:, None] + np.zeros_like(at.position[joint])
    block = np.zeros((10, 6, gravity.shape[1]))
    block[0, :3], block[0, 3:] = gravity, cross(at.position[joint], gravity)
    for k in range(3):
        block[1 + k, 3:] = cross(at.rotation[joint][:, k], gravity)
    return block


def _inertia_columns(rotation: Floats, vector: Floats) -> Floats:
    """Inertia times a base-frame vector, per inertia parameter of the body, (6, 3, n)."""
    local = np.einsum("jin,jn->in", rotation, vector)
    return np.einsum("ijn,kjl,ln->kin", rotation, _INERTIA, local, optimize=True)


def _as_matrix(columns: Floats) -> Floats:
    """(nb, 10, rows, n) -> (n, rows, 10 nb)."""
    bodies, parameters, rows, count = columns.shape
    return np.ascontiguousarray(columns.reshape(bodies * parameters, rows, count).transpose(2, 1, 0))
