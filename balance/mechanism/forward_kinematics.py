"""Positions, velocities and accelerations of all bodies for many states at once, in the base frame."""

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from .joint_tree import Joint, Tree
from .sparse_components import (
    IDENTITY,
    ZERO,
    Entry,
    Matrix,
    Rows,
    Vector,
    add,
    apply,
    cross,
    matrix,
    minus,
    plus,
    product,
    scale,
    sub,
    vector,
)


@dataclass(frozen=True)
class Pose:
    """Where every elementary joint's frame is, at ``count`` samples."""

    count: int
    rotation: list[Matrix]
    """Rotation from each joint's frame to the base."""
    position: list[Vector]
    """Origin of each joint's frame [m]."""
    axis: list[Vector]
    """Unit axis of each joint."""

    def arm(self, joint: int, offset: Floats) -> Vector:
        """A vector fixed in a joint's frame (the base for joint -1), given there as (3,)."""
        return apply(self.rotation[joint], vector(offset)) if joint >= 0 else vector(offset)

    def point(self, joint: int, offset: Floats) -> Vector:
        """A point fixed in a joint's frame (the base for joint -1), given there as (3,) [m]."""
        return plus(self.position[joint], self.arm(joint, offset)) if joint >= 0 else vector(offset)


@dataclass(frozen=True)
class Motion:
    """How every elementary joint's frame moves: angular velocity [rad/s], its origin's [m/s], and the rates of both."""

    omega: list[Vector]
    velocity: list[Vector]
    alpha: list[Vector]
    acceleration: list[Vector]


def pose(tree: Tree, q: Floats) -> Pose:
    """Poses at joint positions ``q`` (nv, n) [rad, m]."""
    at = Pose(q.shape[1], [], [], [])
    for i, joint in enumerate(tree.joints):
        parent = at.rotation[joint.parent] if joint.parent >= 0 else IDENTITY
        frame = parent if np.array_equal(joint.rotation, np.eye(3)) else product(parent, matrix(joint.rotation))
        origin = at.point(joint.parent, joint.position)
        axis = apply(frame, vector(joint.axis))
        at.axis.append(axis)
        at.rotation.append(_spun(frame, joint.axis, q[i]) if joint.revolute else frame)
        at.position.append(origin if joint.revolute else plus(origin, scale(q[i], axis)))
    return at


def _spun(frame: Matrix, axis: Floats, angle: Floats) -> Matrix:
    """Rotation times a turn about ``axis``. Rodrigues: R + R K sin + R K K (1 - cos); short for a z axis."""
    c, s = np.cos(angle), np.sin(angle)
    if axis[2] == 1.0:
        return plus(scale(c, frame[0]), scale(s, frame[1])), minus(scale(c, frame[1]), scale(s, frame[0])), frame[2]
    k = matrix(np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]]))
    first = product(frame, k)
    second = product(first, k)
    x, y, z = (plus(plus(frame[j], scale(s, first[j])), scale(1.0 - c, second[j])) for j in range(3))
    return x, y, z


def motion(tree: Tree, at: Pose, v: Floats, a: Floats | None = None) -> Motion:
    """Velocities and accelerations at joint rates ``v`` and ``a`` (nv, n) [rad/s, m/s; rad/s2, m/s2]; None is zero."""
    moving = Motion([], [], [], [])
    for i, joint in enumerate(tree.joints):
        for values, value in zip(
            (moving.omega, moving.velocity, moving.alpha, moving.acceleration),
            _step(joint, at, i, moving, v[i], 0.0 if a is None else a[i]),
            strict=True,
        ):
            values.append(value)
    return moving


def _step(
    joint: Joint, at: Pose, i: int, moving: Motion, rate: Entry, rate_of_rate: Entry
) -> tuple[Vector, Vector, Vector, Vector]:
    """One joint outwards. Rigid body: v = v0 + w x d, a = a0 + al x d + w x (w x d), plus what the joint adds."""
    p, axis = joint.parent, at.axis[i]
    omega, alpha, velocity, acceleration = ZERO, ZERO, ZERO, ZERO
    if p >= 0:
        omega, alpha = moving.omega[p], moving.alpha[p]
        arm = minus(at.position[i], at.position[p])
        swept = cross(omega, arm)
        velocity = plus(moving.velocity[p], swept)
        acceleration = plus(moving.acceleration[p], plus(cross(alpha, arm), cross(omega, swept)))
    along, faster = scale(rate, axis), scale(rate_of_rate, axis)
    if joint.revolute:
        return plus(omega, along), velocity, plus(plus(alpha, faster), cross(omega, along)), acceleration
    coriolis = scale(2.0, cross(omega, along))
    return omega, plus(velocity, along), alpha, plus(plus(acceleration, faster), coriolis)


def point_acceleration(at: Pose, moving: Motion, joint: int, offset: Floats) -> Vector:
    """Acceleration of a point fixed in a joint's frame [m/s2]; zero on the base."""
    if joint < 0:
        return ZERO
    arm, omega = at.arm(joint, offset), moving.omega[joint]
    return plus(moving.acceleration[joint], plus(cross(moving.alpha[joint], arm), cross(omega, cross(omega, arm))))


def add_point_jacobian(tree: Tree, at: Pose, joint: int, point: Vector, out: Rows, sign: float = 1.0) -> None:
    """Add to ``out`` (3, nv) the velocity, times ``sign``, of a point carried by ``joint`` per joint rate."""
    for i in tree.path(joint):
        column = cross(at.axis[i], minus(point, at.position[i])) if tree.joints[i].revolute else at.axis[i]
        _add(out, i, column, sign)


def add_angular_jacobian(tree: Tree, at: Pose, joint: int, out: Rows, sign: float = 1.0) -> None:
    """Add to ``out`` (3, nv) the angular velocity, times ``sign``, of a joint's frame per joint rate."""
    for i in tree.path(joint):
        if tree.joints[i].revolute:
            _add(out, i, at.axis[i], sign)


def _add(out: Rows, i: int, column: Vector, sign: float) -> None:
    for row, entry in zip(out, column, strict=True):
        row[i] = add(row[i], entry) if sign == 1.0 else sub(row[i], entry)
