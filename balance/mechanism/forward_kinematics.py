"""Forward kinematics of a tree of joints, in the base frame: written down for a tape, or of many samples at once.

A tree consists of elementary joints, revolute or prismatic about one axis, in Pinocchio's frames. A joint of several
axes (two slides on a body) is several elementary joints with massless bodies between them.

Arrays have a row a joint, and last one of the base, which is joint -1. They are of one state, symbols of a tape, or of
n samples, which are their first axis then.
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from .tape import Program, Symbols, Tape, cross, numbers

T = TypeVar("T")
_NORMAL = 1e-9
"""Cosine up to which two axes count as normal to each other."""


@dataclass(frozen=True)
class Joint:
    """One revolute or prismatic axis between a parent joint's frame and its own."""

    parent: int
    """Index of the parent elementary joint, -1 for the base."""
    rotation: NDArray[Any]
    """Rotation of the joint frame in the parent's frame at zero, (3, 3)."""
    position: NDArray[Any]
    """Origin of the joint frame in the parent's frame at zero, (3,) [m]."""
    axis: NDArray[Any]
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

    def normal(self, joint: int, frame: Floats) -> Floats:
        """Normal of a disc on a body that ``joint`` carries, the axis that it turns about, in its frame, (3,) [-].

        That is the axis of the nearest hinge on its way to the base, of a ball the body's z axis; of what only slides
        the z axis of its own ``frame`` (3, 3) in the joint's. It points to the side of that z axis, if to any.
        """
        turn, own = np.eye(3), frame[:, 2]
        for k in reversed(self.path(joint)):
            if self.joints[k].revolute:
                axis: Floats = turn @ self.joints[k].axis
                return axis if axis @ own > -_NORMAL else -axis
            turn = turn @ self.joints[k].rotation.T
        return own


@dataclass(frozen=True)
class Pose:
    """Pose of every elementary joint's frame in the base frame."""

    q: NDArray[Any]
    """The joint positions, (..., nv) [rad, m]."""
    rotation: NDArray[Any]
    """Rotation from each joint's frame to the base, (..., nv + 1, 3, 3)."""
    position: NDArray[Any]
    """Origin of each joint's frame, (..., nv + 1, 3) [m]."""
    axis: NDArray[Any]
    """Unit axis of each joint, (..., nv + 1, 3)."""

    def arm(self, joint: int, offset: NDArray[Any]) -> NDArray[Any]:
        """Base components (..., 3) of a vector ``offset`` (3,) [m] fixed in a joint's frame."""
        return self.rotation[..., joint, :, :] @ offset

    def point(self, joint: int, offset: NDArray[Any]) -> NDArray[Any]:
        """Base coordinates (..., 3) of a point at ``offset`` (3,) [m] in a joint's frame."""
        return self.position[..., joint, :] + self.arm(joint, offset)


@dataclass(frozen=True)
class Motion:
    """Angular velocity [rad/s], origin's velocity [m/s] of every joint's frame, and their rates, (..., nv + 1, 3)."""

    rate: NDArray[Any]
    """The joint rates, (..., nv) [rad/s, m/s]."""
    omega: NDArray[Any]
    velocity: NDArray[Any]
    alpha: NDArray[Any]
    acceleration: NDArray[Any]


def pose(tree: Tree, q: Symbols) -> Pose:
    """Poses at joint positions ``q`` (nv,) [rad, m]."""
    rotation = numbers(np.tile(np.eye(3), (tree.size + 1, 1, 1)))
    position, axis = numbers(np.zeros((2, tree.size + 1, 3)))
    for i, joint in enumerate(tree.joints):
        frame = rotation[joint.parent] @ joint.rotation
        axis[i] = frame @ joint.axis
        position[i] = position[joint.parent] + rotation[joint.parent] @ joint.position
        if joint.revolute:
            rotation[i] = rotated(frame, joint.axis, q[i])
        else:
            rotation[i], position[i] = frame, position[i] + q[i] * axis[i]
    return Pose(q, rotation, position, axis)


def plane_axes(normal: Floats) -> Floats:
    """Two axes of a plane of unit ``normal`` (3,), and that or its opposite: right-handed rows, (3, 3).

    The two are on the side of two of the frame's own, x and y, x and z, or y and z: those that it is least along.
    """
    first, second = (axis for axis in range(3) if axis != int(np.abs(normal).argmax()))
    along = np.eye(3)[first] - normal[first] * normal
    along /= np.linalg.norm(along)
    across = np.cross(normal, along)
    return np.array([along, across, normal]) * [[1.0], *2 * [[np.sign(across[second])]]]


def rotated(frame: Symbols, axis: Floats, angle: Any) -> Symbols:  # noqa: ANN401
    """``frame`` (3, 3) turned by ``angle`` [rad] about its ``axis``. Rodrigues: R + R K sin + R K K (1 - cos)."""
    s, c = np.sin(angle), np.cos(angle)
    if axis.tolist() == [0.0, 0.0, 1.0]:
        x, y, z = frame.T
        return np.array([c * x + s * y, c * y - s * x, z], dtype=object).T
    k = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    first = frame @ k
    return frame + s * first + (1.0 - c) * (first @ k)


def motion(tree: Tree, at: Pose, v: Symbols, a: Symbols | None = None, root: Symbols | None = None) -> Motion:
    """Velocities and accelerations at joint rates ``v`` and ``a`` (nv,) [rad/s, m/s; rad/s2, m/s2]; None is zero.

    A joint's frame from its parent's: v = v0 + w x d, a = a0 + al x d + w x (w x d), plus the joint's rates. ``root``
    (9,) are w, a0 and al of the base, in its axes [rad/s, m/s2, rad/s2]; None: it rests. Its speed plays no part.
    """
    omega, velocity, alpha, acceleration = numbers(np.zeros((4, tree.size + 1, 3)))
    if root is not None:
        omega[-1], acceleration[-1], alpha[-1] = root[:3], root[3:6], root[6:]
    for i, joint in enumerate(tree.joints):
        p = joint.parent
        arm = at.position[i] - at.position[p]
        swept = cross(omega[p], arm)
        along, faster = v[i] * at.axis[i], (0.0 if a is None else a[i]) * at.axis[i]
        omega[i], alpha[i], velocity[i] = omega[p], alpha[p], velocity[p] + swept
        acceleration[i] = acceleration[p] + (cross(alpha[p], arm) + cross(omega[p], swept))
        if joint.revolute:
            omega[i], alpha[i] = omega[p] + along, alpha[p] + faster + cross(omega[p], along)
        else:
            velocity[i] = velocity[i] + along
            acceleration[i] = acceleration[i] + faster + 2.0 * cross(omega[p], along)
    return Motion(v, omega, velocity, alpha, acceleration)


def poses(tree: Tree, q: Floats) -> Pose:
    """Poses at n joint positions ``q`` (n, nv) [rad, m]."""

    def write() -> Program:
        tape = Tape()
        at = pose(tree, tape.rows(tree.size))
        return tape.program(np.concatenate([at.rotation.ravel(), at.position.ravel(), at.axis.ravel()]))

    flat, frames = tree.once("poses", write).values(q.T).T, tree.size + 1
    rotation, position, axis = np.split(flat, [9 * frames, 12 * frames], axis=1)
    places = [part.reshape(-1, frames, 3) for part in (position, axis)]
    return Pose(q, rotation.reshape(-1, frames, 3, 3), *places)


def motions(tree: Tree, q: Floats, v: Floats, a: Floats) -> Motion:
    """Velocities and accelerations at n joint positions and their rates (n, nv) [rad, m; rad/s, m/s; rad/s2, m/s2]."""

    def write() -> Program:
        tape = Tape()
        at = pose(tree, tape.rows(tree.size))
        moving = motion(tree, at, tape.rows(tree.size), tape.rows(tree.size))
        parts = (moving.omega, moving.velocity, moving.alpha, moving.acceleration)
        return tape.program(np.concatenate([part.ravel() for part in parts]))

    flat = tree.once("motions", write).values(q.T, v.T, a.T).T
    return Motion(v, *(part.reshape(-1, tree.size + 1, 3) for part in np.split(flat, 4, axis=1)))


def point_acceleration(at: Pose, moving: Motion, joint: int, offset: Floats) -> NDArray[Any]:
    """Acceleration (..., 3) [m/s2] of a point at ``offset`` (3,) [m] in a joint's frame."""
    arm, omega, alpha = at.arm(joint, offset), moving.omega[..., joint, :], moving.alpha[..., joint, :]
    return moving.acceleration[..., joint, :] + (cross(alpha, arm) + cross(omega, cross(omega, arm)))


def point_jacobian(tree: Tree, at: Pose, joint: int, offset: Floats) -> NDArray[Any]:
    """Velocity (..., 3, nv) of a point at ``offset`` (3,) [m] in a joint's frame, per joint rate [m, -]."""
    point = at.point(joint, offset)
    found = np.full((*point.shape, tree.size), 0.0, dtype=point.dtype)
    for i in tree.path(joint):
        axis = at.axis[..., i, :]
        found[..., i] = cross(axis, point - at.position[..., i, :]) if tree.joints[i].revolute else axis
    return found


def angular_jacobian(tree: Tree, at: Pose, joint: int) -> NDArray[Any]:
    """Angular velocity (..., 3, nv) of a joint's frame, per joint rate."""
    turning = [i for i in tree.path(joint) if tree.joints[i].revolute]
    found = np.full((*at.axis.shape[:-2], 3, tree.size), 0.0, dtype=at.axis.dtype)
    found[..., turning] = np.swapaxes(at.axis[..., turning, :], -1, -2)
    return found
