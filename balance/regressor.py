"""Momentum, shaking wrench and joint torque as ``W @ pi``: linear in the inertial parameters of all bodies.

Columns are the mechanism's ``parameter_names``. States need not be closed: what is projected on loops comes after.
"""

from collections.abc import Callable

import numpy as np

from . import body, kinematics
from .arrays import Floats
from .body import Load
from .components import fill
from .kinematics import Motion, Pose
from .mechanism import PARAMETERS, Mechanism

_UNIT_ROWS = np.eye(len(PARAMETERS))


def momentum_regressor(mechanism: Mechanism, q: Floats, v: Floats) -> Floats:
    """W with ``W @ pi`` = linear [kg m/s] and angular momentum about the base frame's origin [kg m2/s], (n, 6, 10 nb).

    ``q`` and ``v`` are (n, nv).
    """
    at, moving = _states(mechanism, q, v)
    return _six_rows(mechanism, at, lambda row, joint: body.momentum(row, at, moving, joint))


def wrench_regressor(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> Floats:
    """W with ``W @ pi`` = shaking force [N] and moment about the base frame's origin [N m], (n, 6, 10 nb).

    What the mechanism exerts on its base, weight excluded, base axes; ``q``, ``v``, ``a`` are (n, nv).
    """
    at, moving = _states(mechanism, q, v, a)
    return -_six_rows(mechanism, at, lambda row, joint: body.rate_of_momentum(row, at, moving, joint))


def torque_regressor(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> Floats:
    """W with ``W @ pi`` = torques of the joints of the open tree, gravity included, (n, nv, 10 nb) [N m, N].

    Torques of the driven joints of a closed loop are ``driven_rates.T @ W @ pi``. Armature and friction are apart.
    """
    tree = mechanism.tree
    at, moving = _states(mechanism, q, v, a)
    columns = np.zeros((len(mechanism.bodies) * len(PARAMETERS), tree.size, at.count))
    for column, (row, joint) in zip(columns, _unit_bodies(mechanism), strict=True):
        load = body.rate_of_momentum(row, at, moving, joint).minus(body.weight(row, at, mechanism.gravity, joint))
        for i in tree.path(joint):
            column[i] = load.along(at, i, tree.joints[i].revolute)
    return _samples_first(columns)


def driven_torque_regressor(mechanism: Mechanism, q: Floats, v: Floats, a: Floats, rates: Floats) -> Floats:
    """W with ``W @ pi`` = torques of the driven joints, (n, dof, 10 nb) [N m, N].

    ``rates`` (n, nv, dof) are the rates of all coordinates per rate of the driven joints.
    """
    return np.einsum("nij,nik->njk", rates, torque_regressor(mechanism, q, v, a))


def _states(mechanism: Mechanism, q: Floats, v: Floats, a: Floats | None = None) -> tuple[Pose, Motion]:
    at = kinematics.pose(mechanism.tree, np.ascontiguousarray(q.T))
    rates = None if a is None else np.ascontiguousarray(a.T)
    return at, kinematics.motion(mechanism.tree, at, np.ascontiguousarray(v.T), rates)


def _unit_bodies(mechanism: Mechanism) -> list[tuple[Floats, int]]:
    """For each column: the unit row of parameters, and the joint of the body that has it."""
    return [(row, joint) for joint in mechanism.tree.bodies for row in _UNIT_ROWS]


def _six_rows(mechanism: Mechanism, at: Pose, load_of: Callable[[Floats, int], Load]) -> Floats:
    columns = np.empty((len(mechanism.bodies) * len(PARAMETERS), 6, at.count))
    for column, (row, joint) in zip(columns, _unit_bodies(mechanism), strict=True):
        load = load_of(row, joint)
        fill(column[:3], load.force)
        fill(column[3:], load.moment)
    return _samples_first(columns)


def _samples_first(columns: Floats) -> Floats:
    """(10 nb, rows, n) -> (n, rows, 10 nb)."""
    return np.ascontiguousarray(columns.transpose(2, 1, 0))
