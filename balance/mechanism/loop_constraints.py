"""Loop constraints between two frames: residual, Jacobian and acceleration bias, for many states at once.

A loop closes where the residual r(q) vanishes: J q' = 0, J q'' = -bias. Rows are of the base axes; n is the number of
samples, nv that of the joint coordinates.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from . import forward_kinematics
from .forward_kinematics import Motion, Pose, Tree
from .sparse_components import (
    ZERO,
    Matrix,
    Rows,
    Vector,
    cross,
    dense,
    dense_rows,
    matrix,
    minus,
    plus,
    product,
    scale,
    zeros,
)

if TYPE_CHECKING:
    import pinocchio


@dataclass(frozen=True)
class Anchor:
    """A frame fixed in the frame of an elementary joint, or in the base for joint -1."""

    joint: int
    rotation: Floats
    """Rotation of the anchor in the joint's frame, (3, 3)."""
    position: Floats
    """Origin of the anchor in the joint's frame, (3,) [m]."""

    @classmethod
    def from_placement(cls, joint: int, placement: "pinocchio.SE3") -> "Anchor":
        """The anchor at a Pinocchio placement."""
        return cls(joint, placement.rotation.copy(), placement.translation.copy())


@dataclass(frozen=True)
class Loop:
    """Two anchors that coincide: their origins (connect, 3 rows), or also their axes (weld, 6 rows)."""

    name: str
    first: Anchor
    second: Anchor
    weld: bool

    def residual(self, at: Pose) -> Floats:
        """First anchor less the second: origins [m], for a weld also orientation [rad], (3, n) or (6, n)."""
        gap = minus(at.point(self.first.joint, self.first.position), at.point(self.second.joint, self.second.position))
        return self._rows(at, gap, self._small_rotation(at) if self.weld else ZERO)

    def jacobian(self, tree: Tree, at: Pose) -> Rows:
        """Rate of the residual per joint rate, (3, nv) or (6, nv)."""
        rows = zeros(self.size, tree.size)
        for end, sign in ((self.first, 1.0), (self.second, -1.0)):
            point = at.point(end.joint, end.position)
            forward_kinematics.add_point_jacobian(tree, at, end.joint, point, rows[:3], sign)
            if self.weld:
                forward_kinematics.add_angular_jacobian(tree, at, end.joint, rows[3:], sign)
        return rows

    def bias(self, at: Pose, moving: Motion) -> Floats:
        """Second rate of the residual at zero joint accelerations (``moving``), (3, n) or (6, n) [m/s2, rad/s2]."""
        ends = [
            forward_kinematics.point_acceleration(at, moving, end.joint, end.position)
            for end in (self.first, self.second)
        ]
        turns = [moving.alpha[end.joint] if end.joint >= 0 else ZERO for end in (self.first, self.second)]
        return self._rows(at, minus(*ends), minus(*turns))

    @property
    def size(self) -> int:
        """Number of rows."""
        return 6 if self.weld else 3

    def _rows(self, at: Pose, gap: Vector, turn: Vector) -> Floats:
        parts = [gap, turn] if self.weld else [gap]
        return np.concatenate([dense(part, at.count) for part in parts])

    def _small_rotation(self, at: Pose) -> Vector:
        """Small rotation from the second anchor to the first: half the sum of second x first over the axes."""
        axes = zip(self._axes(at, self.second), self._axes(at, self.first), strict=True)
        x, y, z = (cross(second, first) for second, first in axes)
        return scale(0.5, plus(plus(x, y), z))

    @staticmethod
    def _axes(at: Pose, end: Anchor) -> Matrix:
        own = matrix(end.rotation)
        return product(at.rotation[end.joint], own) if end.joint >= 0 else own


def constraint_residual(loops: tuple[Loop, ...], at: Pose) -> Floats:
    """Residuals of all loops stacked, (rows, n) [m, rad]; no rows for an open chain."""
    return _stack([loop.residual(at) for loop in loops], (at.count,))


def constraint_jacobian(loops: tuple[Loop, ...], tree: Tree, at: Pose) -> Rows:
    """Jacobians of all loops stacked, by component, (rows, nv)."""
    return [row for loop in loops for row in loop.jacobian(tree, at)]


def loop_jacobian(loops: tuple[Loop, ...], tree: Tree, at: Pose) -> Floats:
    """Jacobians of all loops stacked as an array, (rows, nv, n) [-, m]."""
    return dense_rows(constraint_jacobian(loops, tree, at), tree.size, at.count)


def constraint_bias(loops: tuple[Loop, ...], at: Pose, moving: Motion) -> Floats:
    """Acceleration bias of all loops stacked, (rows, n) [m/s2, rad/s2]."""
    return _stack([loop.bias(at, moving) for loop in loops], (at.count,))


def _stack(parts: list[Floats], shape: tuple[int, ...]) -> Floats:
    return np.concatenate(parts) if parts else np.empty((0, *shape))
