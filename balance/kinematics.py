"""Positions, velocities and accelerations of all bodies for many states at once, in the base frame.

Samples lie on the last axis, so that every step is one long vector operation. All vectors are base-frame components.
"""

from dataclasses import dataclass

import numpy as np

from .arrays import Floats
from .tree import Joint, Tree


def cross(a: Floats, b: Floats) -> Floats:
    """Cross product along the first axis, (3, n)."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    np.subtract(a[1] * b[2], a[2] * b[1], out=out[0])
    np.subtract(a[2] * b[0], a[0] * b[2], out=out[1])
    np.subtract(a[0] * b[1], a[1] * b[0], out=out[2])
    return out


def rotate(rotation: Floats, vector: Floats) -> Floats:
    """Constant body vector (3,) into the base frame, (3, n); zero components cost nothing."""
    out = np.zeros((3, rotation.shape[-1]))
    for k in np.flatnonzero(vector):
        out += rotation[:, k] * vector[k]
    return out


@dataclass(frozen=True)
class Pose:
    """Where every elementary joint's frame is."""

    rotation: list[Floats]
    """Rotation from the joint's frame to the base, a joint (3, 3, n)."""
    position: list[Floats]
    """Origin of the joint's frame, a joint (3, n) [m]."""
    axis: list[Floats]
    """Unit axis of the joint, a joint (3, n)."""

    def point(self, joint: int, offset: Floats) -> Floats:
        """A point fixed in a joint's frame (the base for joint -1), (3, n) or (3, 1) [m]."""
        if joint < 0:
            return offset[:, None]
        return self.position[joint] + rotate(self.rotation[joint], offset)


@dataclass(frozen=True)
class Motion:
    """How every elementary joint's frame moves: angular (3, n) [rad/s, rad/s2], origin (3, n) [m/s, m/s2]."""

    omega: list[Floats]
    velocity: list[Floats]
    alpha: list[Floats]
    acceleration: list[Floats]


def pose(tree: Tree, q: Floats) -> Pose:
    """Poses at joint positions ``q`` (nv, n) [rad, m]."""
    rotation: list[Floats] = []
    position: list[Floats] = []
    axis: list[Floats] = []
    for i, joint in enumerate(tree.joints):
        if joint.parent < 0:
            frame, origin = (
                np.broadcast_to(joint.rotation[:, :, None], (3, 3, q.shape[1])),
                joint.position[:, None],
            )
        else:
            frame = _turned(rotation[joint.parent], joint.rotation)
            origin = position[joint.parent] + rotate(rotation[joint.parent], joint.position)
        axis.append(rotate(frame, joint.axis))
        rotation.append(_spun(frame, joint.axis, q[i]) if joint.revolute else frame)
        position.append(origin + np.zeros_like(axis[i]) if joint.revolute else origin + axis[i] * q[i])
    return Pose(rotation, position, axis)


def _turned(rotation: Floats, constant: Floats) -> Floats:
    return rotation if np.array_equal(constant, np.eye(3)) else np.einsum("ijn,jk->ikn", rotation, constant)


def _spun(rotation: Floats, axis: Floats, angle: Floats) -> Floats:
    """Rotation times a turn about ``axis``. Rodrigues: R + R K sin + R K K (1 - cos); short for a z axis."""
    c, s = np.cos(angle), np.sin(angle)
    if axis[2] == 1.0:
        out = np.empty((3, 3, angle.size))
        out[:, 0] = rotation[:, 0] * c + rotation[:, 1] * s
        out[:, 1] = rotation[:, 1] * c - rotation[:, 0] * s
        out[:, 2] = rotation[:, 2]
        return out
    k = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    first = np.einsum("ijn,jk->ikn", rotation, k)
    return rotation + first * s + np.einsum("ijn,jk->ikn", first, k) * (1.0 - c)


def motion(tree: Tree, at: Pose, v: Floats, a: Floats) -> Motion:
    """Velocities and accelerations at joint rates ``v`` and ``a`` (nv, n) [rad/s, m/s; rad/s2, m/s2]."""
    rest = np.zeros((3, v.shape[1]))
    moving = Motion([], [], [], [])
    for i, joint in enumerate(tree.joints):
        p = joint.parent
        before = [rest] * 5 if p < 0 else [*(values[p] for values in _fields(moving)), at.position[i] - at.position[p]]
        for values, value in zip(_fields(moving), _step(joint, at.axis[i], v[i], a[i], *before), strict=True):
            values.append(value)
    return moving


def _fields(moving: Motion) -> tuple[list[Floats], ...]:
    return moving.omega, moving.velocity, moving.alpha, moving.acceleration


def _step(
    joint: Joint,
    axis: Floats,
    rate: Floats,
    rate_of_rate: Floats,
    omega: Floats,
    velocity: Floats,
    alpha: Floats,
    acceleration: Floats,
    arm: Floats,
) -> tuple[Floats, Floats, Floats, Floats]:
    """One joint outwards. Rigid body: v = v0 + w x d, a = a0 + al x d + w x (w x d), plus what the joint adds."""
    if joint.parent >= 0:
        swept = cross(omega, arm)
        velocity = velocity + swept
        acceleration = acceleration + cross(alpha, arm) + cross(omega, swept)
    along = axis * rate
    if joint.revolute:
        return omega + along, velocity, alpha + axis * rate_of_rate + cross(omega, along), acceleration
    return omega, velocity + along, alpha, acceleration + axis * rate_of_rate + 2.0 * cross(omega, along)


def point_motion(at: Pose, moving: Motion, joint: int, offset: Floats) -> tuple[Floats, Floats]:
    """Velocity and acceleration of a point fixed in a joint's frame, (3, n) [m/s, m/s2]; zero on the base."""
    if joint < 0:
        return np.zeros((3, 1)), np.zeros((3, 1))
    arm = rotate(at.rotation[joint], offset)
    swept = cross(moving.omega[joint], arm)
    acceleration = moving.acceleration[joint] + cross(moving.alpha[joint], arm) + cross(moving.omega[joint], swept)
    return moving.velocity[joint] + swept, acceleration


def point_jacobian(tree: Tree, at: Pose, joint: int, point: Floats) -> Floats:
    """Velocity of a point (3, n) carried by ``joint`` per joint rate, (3, nv, n)."""
    jacobian = np.zeros((3, tree.size, at.axis[0].shape[1]))
    for i in tree.path(joint):
        axis = at.axis[i]
        jacobian[:, i] = cross(axis, point - at.position[i]) if tree.joints[i].revolute else axis
    return jacobian


def angular_jacobian(tree: Tree, at: Pose, joint: int) -> Floats:
    """Angular velocity of a joint's frame per joint rate, (3, nv, n)."""
    jacobian = np.zeros((3, tree.size, at.axis[0].shape[1]))
    for i in tree.path(joint):
        if tree.joints[i].revolute:
            jacobian[:, i] = at.axis[i]
    return jacobian
