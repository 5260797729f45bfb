"""Forward kinematics of a tree of joints for many samples at once, in the base frame.

A tree consists of elementary joints, revolute or prismatic about one axis, in Pinocchio's frames. A joint of several
axes (two slides on a body) is several elementary joints with massless bodies between them.
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from ..arrays import Floats
from .sparse_components import (
    IDENTITY,
    ZERO,
    Entries,
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
    sincos,
    sub,
    vector,
)
from .tape import Node

T = TypeVar("T")


@dataclass(frozen=True)
class Joint:
    """One revolute or prismatic axis between a parent joint's frame and its own."""

    parent: int
    """Index of the parent elementary joint, -1 for the base."""
    rotation: Floats
    """Rotation of the joint frame in the parent's frame at zero, (3, 3)."""
    position: Floats
    """Origin of the joint frame in the parent's frame at zero, (3,) [m]."""
    axis: Floats
    """Unit axis in the joint's frame, (3,)."""
    revolute: bool


@dataclass(frozen=True, eq=False)
class Tree:
    """Elementary joints in depth-first order, one velocity each, and which of them carries which body."""

    joints: tuple[Joint, ...]
    bodies: tuple[int, ...]
    """For each body, the elementary joint whose frame is the body's frame."""
    _made: dict[Hashable, Any] = field(default_factory=dict, repr=False)
    compared: set[Hashable] = field(default_factory=set, repr=False)
    """What was found to agree with Pinocchio."""

    @property
    def size(self) -> int:
        """Number of elementary joints, which is the number of velocities."""
        return len(self.joints)

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """What ``make`` gave for this tree and ``key``, made once: whatever masses it carries."""
        if key not in self._made:
            self._made[key] = make()
        found: T = self._made[key]
        return found

    def path(self, joint: int) -> list[int]:
        """Elementary joints from the base to ``joint``, which is the last."""
        found: list[int] = []
        while joint >= 0:
            found.append(joint)
            joint = self.joints[joint].parent
        return found[::-1]


@dataclass(frozen=True)
class Pose:
    """Pose of every elementary joint's frame in the base frame, at n samples."""

    q: Entries
    """The joint positions, (nv, n) [rad, m]."""
    rotation: list[Matrix]
    """Rotation from each joint's frame to the base."""
    position: list[Vector]
    """Origin of each joint's frame in the base frame [m]."""
    axis: list[Vector]
    """Unit axis of each joint in the base frame."""

    @property
    def count(self) -> int:
        """Number of samples n."""
        return len(self.q[0])

    def arm(self, joint: int, offset: Entries) -> Vector:
        """Base components of a vector ``offset`` (3,) [m] fixed in a joint's frame (the base for joint -1)."""
        x, y, z = (entry if isinstance(entry, Node) else float(entry) for entry in offset)
        return apply(self.rotation[joint], (x, y, z)) if joint >= 0 else (x, y, z)

    def point(self, joint: int, offset: Floats) -> Vector:
        """Base coordinates of a point at ``offset`` (3,) [m] in a joint's frame (the base for joint -1)."""
        return plus(self.position[joint], self.arm(joint, offset)) if joint >= 0 else vector(offset)


@dataclass(frozen=True)
class Motion:
    """Angular velocity [rad/s] and origin's velocity [m/s] of every joint's frame, base axes, and the rates of both."""

    rate: Entries
    """The joint rates, (nv, n) [rad/s, m/s]."""
    omega: list[Vector]
    velocity: list[Vector]
    alpha: list[Vector]
    acceleration: list[Vector]


def pose(tree: Tree, q: Entries) -> Pose:
    """Poses at joint positions ``q`` (nv, n) [rad, m]."""
    at = Pose(q, [], [], [])
    for i, joint in enumerate(tree.joints):
        parent = at.rotation[joint.parent] if joint.parent >= 0 else IDENTITY
        frame = parent if np.array_equal(joint.rotation, np.eye(3)) else product(parent, matrix(joint.rotation))
        origin = at.point(joint.parent, joint.position)
        axis = apply(frame, vector(joint.axis))
        at.axis.append(axis)
        at.rotation.append(_rotated(frame, joint.axis, q[i]) if joint.revolute else frame)
        at.position.append(origin if joint.revolute else plus(origin, scale(q[i], axis)))
    return at


def _rotated(frame: Matrix, axis: Floats, angle: Entry) -> Matrix:
    """``frame`` turned by ``angle`` (n,) [rad] about its ``axis``. Rodrigues: R + R K sin + R K K (1 - cos)."""
    s, c = sincos(angle)
    if axis.tolist() == [0.0, 0.0, 1.0]:
        return plus(scale(c, frame[0]), scale(s, frame[1])), minus(scale(c, frame[1]), scale(s, frame[0])), frame[2]
    k = matrix(np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]]))
    first = product(frame, k)
    second = product(first, k)
    x, y, z = (plus(plus(frame[j], scale(s, first[j])), scale(sub(1.0, c), second[j])) for j in range(3))
    return x, y, z


def motion(tree: Tree, at: Pose, v: Entries, a: Entries | None = None) -> Motion:
    """Velocities and accelerations at joint rates ``v`` and ``a`` (nv, n) [rad/s, m/s; rad/s2, m/s2]; None is zero."""
    moving = Motion(v, [], [], [], [])
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
    """A joint's frame from its parent's: v = v0 + w x d, a = a0 + al x d + w x (w x d), plus the joint's rates."""
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
    """Acceleration [m/s2] of a point at ``offset`` (3,) [m] in a joint's frame; zero on the base."""
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
