"""Loop constraints between two frames: residual, Jacobian and acceleration bias, for many states at once."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from . import kinematics
from .arrays import Floats
from .kinematics import Motion, Pose
from .tree import Tree

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
    def of(cls, joint: int, placement: "pinocchio.SE3") -> "Anchor":
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
        """First minus second: origins [m], for a weld also orientation [rad], (3 or 6, n)."""
        gap = at.point(self.first.joint, self.first.position) - at.point(self.second.joint, self.second.position)
        return np.concatenate([gap, self._turn(at)]) if self.weld else gap

    def jacobian(self, tree: Tree, at: Pose) -> Floats:
        """Rate of the residual per joint rate, (3 or 6, nv, n)."""
        ends = [
            kinematics.point_jacobian(tree, at, end.joint, at.point(end.joint, end.position))
            for end in (self.first, self.second)
        ]
        if not self.weld:
            return ends[0] - ends[1]
        turns = [kinematics.angular_jacobian(tree, at, end.joint) for end in (self.first, self.second)]
        return np.concatenate([ends[0] - ends[1], turns[0] - turns[1]])

    def bias(self, at: Pose, moving: Motion) -> Floats:
        """Second rate of the residual where ``moving`` has zero joint accelerations, (3 or 6, n) [m/s2, rad/s2]."""
        ends = [kinematics.point_motion(at, moving, end.joint, end.position)[1] for end in (self.first, self.second)]
        if not self.weld:
            return ends[0] - ends[1]
        turns = [moving.alpha[end.joint] if end.joint >= 0 else 0.0 for end in (self.first, self.second)]
        return np.concatenate([ends[0] - ends[1], turns[0] - turns[1]])

    def _turn(self, at: Pose) -> Floats:
        """Small rotation from the second anchor to the first, base frame: vee of (R1 R2' - R2 R1') / 2."""
        first, second = (self._rotation(at, end) for end in (self.first, self.second))
        turn = np.einsum("ijn,kjn->ikn", first, second)
        return 0.5 * np.stack([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])

    @staticmethod
    def _rotation(at: Pose, end: Anchor) -> Floats:
        samples = at.axis[0].shape[1]
        if end.joint < 0:
            return np.broadcast_to(end.rotation[:, :, None], (3, 3, samples))
        return np.einsum("ijn,jk->ikn", at.rotation[end.joint], end.rotation)


def residual(loops: tuple[Loop, ...], at: Pose) -> Floats:
    """Residuals of all loops stacked, (rows, n) [m, rad]; no rows for an open chain."""
    return _stack([loop.residual(at) for loop in loops], (at.axis[0].shape[1],))


def jacobian(loops: tuple[Loop, ...], tree: Tree, at: Pose) -> Floats:
    """Jacobians of all loops stacked, (rows, nv, n)."""
    return _stack([loop.jacobian(tree, at) for loop in loops], (tree.size, at.axis[0].shape[1]))


def bias(loops: tuple[Loop, ...], at: Pose, moving: Motion) -> Floats:
    """Acceleration bias of all loops stacked, (rows, n) [m/s2, rad/s2]."""
    return _stack([loop.bias(at, moving) for loop in loops], (at.axis[0].shape[1],))


def _stack(parts: list[Floats], shape: tuple[int, ...]) -> Floats:
    return np.concatenate(parts) if parts else np.empty((0, *shape))
