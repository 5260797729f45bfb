"""First moment of mass and potential energy of weight, linear in the inertial parameters of all bodies."""

import numpy as np

from . import kinematics
from .arrays import Floats
from .components import dense
from .mechanism import PARAMETERS, Mechanism


def first_moment_regressor(mechanism: Mechanism, q: Floats) -> Floats:
    """W with ``W @ pi`` = first moment of mass about the base frame's origin [kg m], (n, 3, 10 nb), for (n, nv) states.

    A body at o turned by R has m o + R h: columns o and those of R.
    """
    at = kinematics.pose(mechanism.tree, np.ascontiguousarray(q.T))
    columns = np.zeros((len(q), 3, len(mechanism.bodies), len(PARAMETERS)))
    for body, joint in enumerate(mechanism.tree.bodies):
        columns[:, :, body, 0] = dense(at.position[joint], at.count).T
        for axis in range(3):
            columns[:, :, body, 1 + axis] = dense(at.arm(joint, np.eye(3)[axis]), at.count).T
    return columns.reshape(len(q), 3, -1)


def first_moment(mechanism: Mechanism, q: Floats) -> Floats:
    """First moment of mass about the base frame's origin, (n, 3) [kg m], for (n, nv) states."""
    return first_moment_regressor(mechanism, q) @ mechanism.pi


def potential_regressor(mechanism: Mechanism, q: Floats) -> Floats:
    """W with ``W @ pi`` = potential energy of weight [J], (n, 10 nb), for (n, nv) states: V = -g . first moment."""
    return np.einsum("i,nik->nk", -mechanism.gravity, first_moment_regressor(mechanism, q))


def potential(mechanism: Mechanism, q: Floats) -> Floats:
    """Potential energy of weight, zero with all mass at the height of the base's origin, (n,) [J]."""
    return -first_moment(mechanism, q) @ mechanism.gravity
