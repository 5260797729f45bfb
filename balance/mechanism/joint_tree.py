"""The tree of a mechanism as elementary joints, revolute or prismatic about one axis, in Pinocchio's frames.

A joint of several axes (two slides on a body) becomes several elementary joints with massless bodies between.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..errors import ModelError

if TYPE_CHECKING:
    import pinocchio


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


@dataclass(frozen=True)
class Tree:
    """Elementary joints in depth-first order, one velocity each, and which of them carries which body."""

    joints: tuple[Joint, ...]
    bodies: tuple[int, ...]
    """For each body, the elementary joint whose frame is the body's frame."""

    @property
    def size(self) -> int:
        """Number of elementary joints, which is the number of velocities."""
        return len(self.joints)

    def path(self, joint: int) -> list[int]:
        """Elementary joints from the base to ``joint``, which is the last."""
        found: list[int] = []
        while joint >= 0:
            found.append(joint)
            joint = self.joints[joint].parent
        return found[::-1]


def tree_of(model: "pinocchio.Model", name: str) -> Tree:
    """Take the elementary joints out of a Pinocchio model. Raises ModelError for a joint of another kind."""
    joints: list[Joint] = []
    last: dict[int, int] = {0: -1}
    for i in range(1, model.njoints):
        placement = model.jointPlacements[i]
        parent = last[model.parents[i]]
        for kind, offset in _elementary(model.joints[i].extract(), model.names[i], name):
            revolute, axis = _axis(kind, model.names[i], name)
            frame = placement * offset
            joints.append(Joint(parent, frame.rotation.copy(), frame.translation.copy(), axis, revolute))
            parent, placement = len(joints) - 1, frame.Identity()
        last[i] = parent
    return Tree(tuple(joints), tuple(last[i] for i in range(1, model.njoints)))


def _elementary(joint: object, label: str, name: str) -> list[tuple[object, "pinocchio.SE3"]]:
    import pinocchio

    if isinstance(joint, pinocchio.JointModelComposite):
        return [
            (part.extract(), placement) for part, placement in zip(joint.joints, joint.jointPlacements, strict=True)
        ]
    return [(joint, pinocchio.SE3.Identity())]


def _axis(joint: object, label: str, name: str) -> tuple[bool, Floats]:
    """Kind and axis of a joint, from Pinocchio's class names: RX, RY, RZ, PX, ..., or with an axis of its own.

    A joint without limits (RUB..., URDF's continuous) is a revolute one: its angle is the coordinate here.
    """
    kind = type(joint).__name__.removeprefix("JointModel").replace("RUB", "R").replace("Unbounded", "")
    letters = {"X": 0, "Y": 1, "Z": 2}
    if kind in {"RX", "RY", "RZ", "PX", "PY", "PZ"}:
        return kind[0] == "R", np.eye(3)[letters[kind[1]]]
    if kind in {"RevoluteUnaligned", "PrismaticUnaligned"}:
        return kind.startswith("R"), np.asarray(joint.axis, dtype=np.float64)  # type: ignore[attr-defined]
    raise ModelError(f"{name}: joint {label!r} is of kind {kind}; supported are revolute and prismatic joints")
