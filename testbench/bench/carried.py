"""The mechanism as the base feels it and as sensors on its bodies move with it."""

import numpy as np

from balance import kinematics
from balance.arrays import Floats
from balance.closure import Trajectory
from balance.components import dense
from balance.kinematics import Pose
from balance.mechanism import Mechanism


def locked_inertia(mechanism: Mechanism, q: Floats) -> Floats:
    """Mass matrix of the mechanism, locked at ``q`` (nv,), about the base frame's origin, (6, 6) [kg, kg m, kg m2]."""
    return inertia_along(mechanism, q[None])[0]


def inertia_along(mechanism: Mechanism, q: Floats) -> Floats:
    """Mass matrices of the mechanism at configurations (n, nv) about the base frame's origin, (n, 6, 6).

    For a body with first moment h and inertia I about its joint's origin o, all in base axes:
    I_0 = I - S(o) S(h) - S(h) S(o) - m S(o) S(o).
    """
    at = kinematics.pose(mechanism.tree, np.ascontiguousarray(q.T))
    first, second = np.zeros((at.count, 3)), np.zeros((at.count, 3, 3))
    for row, joint in zip(mechanism.parameters, mechanism.tree.bodies, strict=True):
        turn = np.moveaxis(_rotation(at, joint), 2, 0)
        origin, own_first, mass = dense(at.position[joint], at.count).T, turn @ row[1:4], float(row[0])
        xx, xy, yy, xz, yz, zz = row[4:]
        own = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.transpose(0, 2, 1)
        first += mass * origin + own_first
        second += own + _moved(origin, own_first) + _moved(own_first, origin) + mass * _moved(origin, origin)
    return _mass_matrices(mechanism.total_mass, first, second)


def _moved(a: Floats, b: Floats) -> Floats:
    """-S(a) S(b) = (a . b) 1 - b a', (n, 3, 3)."""
    return np.einsum("ni,ni->n", a, b)[:, None, None] * np.eye(3) - np.einsum("ni,nj->nij", b, a)


def _mass_matrices(mass: float, first: Floats, inertia: Floats) -> Floats:
    found = np.zeros((len(first), 6, 6))
    found[:, :3, :3] = mass * np.eye(3)
    found[:, 3:, :3] = skews(first)
    found[:, :3, 3:] = -found[:, 3:, :3]
    found[:, 3:, 3:] = inertia
    return found


def skews(vectors: Floats) -> Floats:
    """The matrices S with S b = vector x b for vectors (n, 3), (n, 3, 3)."""
    return np.cross(vectors[:, None, :], np.eye(3)[None], axis=-1).transpose(0, 2, 1)


def acceleration_in_body(
    mechanism: Mechanism, trajectory: Trajectory, base: Floats, body: str, position: Floats
) -> Floats:
    """Acceleration of a point of a body, in the body's axes, (n, 3) [m/s2].

    ``base`` (n, 6) are the base's accelerations u'', phi'' [m/s2, rad/s2]: R' (a + u'' + phi'' x p).
    """
    q, v, a = (np.ascontiguousarray(x.T) for x in (trajectory.q, trajectory.v, trajectory.a))
    at = kinematics.pose(mechanism.tree, q)
    moving = kinematics.motion(mechanism.tree, at, v, a)
    joint = mechanism.tree.bodies[mechanism.body_index(body)]
    point = dense(at.point(joint, position), at.count).T
    relative = dense(kinematics.point_acceleration(at, moving, joint, position), at.count).T
    absolute = relative + base[:, :3] + np.cross(base[:, 3:], point)
    return np.einsum("ijn,ni->nj", _rotation(at, joint), absolute)


def _rotation(at: Pose, joint: int) -> Floats:
    """Rotation from a joint's frame to the base, (3, 3, n)."""
    return np.stack([dense(at.arm(joint, unit), at.count) for unit in np.eye(3)], axis=1)
