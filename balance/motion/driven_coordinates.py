"""What a motion drives: joints, or a point of a body along axes of the base."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..arrays import Floats
from ..errors import ModelError
from ..mechanism import forward_kinematics
from ..mechanism.forward_kinematics import Motion, Pose, Tree
from ..mechanism.mechanism import Mechanism
from ..mechanism.sparse_components import Entry, Rows, zeros

if TYPE_CHECKING:
    from ..mechanism.pinocchio_engine import PinocchioEngine

AXES = {"x": 0, "y": 1, "z": 2}


class Drive(Protocol):
    """Driven coordinates u(q), with their Jacobian and acceleration bias; samples on the last axis."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the driven coordinates."""
        ...

    @property
    def size(self) -> int:
        """Number of driven coordinates."""
        ...

    @property
    def key(self) -> tuple[object, ...]:
        """What tells it from other drives of the same mechanism."""
        ...

    def position(self, at: Pose) -> list[Entry]:
        """Driven coordinates, (size, n) [rad, m]."""
        ...

    def jacobian(self, tree: Tree, at: Pose) -> Rows:
        """Their rates per joint rate, (size, nv)."""
        ...

    def bias(self, at: Pose, moving: Motion) -> list[Entry]:
        """Their second rates where ``moving`` has zero joint accelerations, (size, n) [rad/s2, m/s2]."""
        ...

    def scale(self, length: float) -> float:
        """What a step of one radian amounts to in these coordinates, for a mechanism of ``length`` [rad, m]."""
        ...

    def value(self, engine: "PinocchioEngine", q: Floats) -> Floats:
        """Driven coordinates (size,) [rad, m] of one configuration ``q`` (nv,)."""
        ...

    def rates(self, engine: "PinocchioEngine", q: Floats) -> Floats:
        """Their rates per joint rate (size, nv) [-, m] at one configuration ``q`` (nv,) [rad, m]."""
        ...


@dataclass(frozen=True)
class JointDrive:
    """Joints that are driven directly."""

    names: tuple[str, ...]
    indices: tuple[int, ...]

    @classmethod
    def from_names(cls, mechanism: Mechanism, joints: tuple[str, ...], sliding: tuple[bool, ...] = ()) -> "JointDrive":
        """Drive joints by name; ``sliding``, where known: whether each is given in lengths, not angles.

        Raises ModelError for a joint that the mechanism does not have, or that turns where a length is given.
        """
        indices = tuple(mechanism.coordinate_index(joint) for joint in joints)
        for joint, index, slides in zip(joints, indices, sliding, strict=False):
            if mechanism.tree.joints[index].revolute == slides:
                raise ModelError(
                    f"joint {joint!r} of {mechanism.name} {'turns' if slides else 'slides'}, but the motion gives "
                    f"{'lengths' if slides else 'angles'}: write it in {'rad or deg' if slides else 'm or mm'}"
                )
        return cls(joints, indices)

    @property
    def size(self) -> int:
        """Number of driven joints."""
        return len(self.indices)

    @property
    def key(self) -> tuple[object, ...]:
        """The joints."""
        return self.indices

    def position(self, at: Pose) -> list[Entry]:
        """Joint positions, (size, n) [rad, m]."""
        return [at.q[index] for index in self.indices]

    def jacobian(self, tree: Tree, at: Pose) -> Rows:
        """Rows of the identity, (size, nv)."""
        return [[float(i == index) for i in range(tree.size)] for index in self.indices]

    def bias(self, at: Pose, moving: Motion) -> list[Entry]:
        """Zero, (size, n) [rad/s2, m/s2]: joint coordinates are linear."""
        return [0.0] * self.size

    def scale(self, length: float) -> float:
        """One radian."""
        return 1.0

    def value(self, engine: "PinocchioEngine", q: Floats) -> Floats:
        """Joint positions (size,) [rad, m] of one configuration ``q`` (nv,)."""
        return q[list(self.indices)]

    def rates(self, engine: "PinocchioEngine", q: Floats) -> Floats:
        """Rows of the identity, (size, nv) [-]."""
        return np.eye(len(q))[list(self.indices)]


@dataclass(frozen=True)
class PointDrive:
    """A point fixed in a body's frame, driven along axes of the base."""

    names: tuple[str, ...]
    joint: int
    offset: Floats
    axes: tuple[int, ...]

    @classmethod
    def from_place(cls, mechanism: Mechanism, place: str, axes: tuple[str, ...]) -> "PointDrive":
        """Drive a body's own centre of mass, or a site, by name, along ``axes`` such as ("x", "y").

        A name that both have is the body's, unless that has no mass.
        """
        if place in mechanism.own_mass and (mechanism.mass(place) > 0.0 or place not in mechanism.sites):
            body, offset = mechanism.body_index(place), mechanism.centre(place)
        else:
            site = mechanism.site(place)
            if site.body < 0:
                raise ModelError(f"site {place!r} of {mechanism.name} is on the base: it cannot be driven")
            body, offset = site.body, site.position
        names = tuple(f"{place}.{axis}" for axis in axes)
        return cls(names, mechanism.tree.bodies[body], offset, tuple(AXES[axis] for axis in axes))

    @property
    def size(self) -> int:
        """Number of driven axes."""
        return len(self.axes)

    @property
    def key(self) -> tuple[object, ...]:
        """Where the point is, and the axes."""
        return self.joint, self.offset.tobytes(), self.axes

    def position(self, at: Pose) -> list[Entry]:
        """Base coordinates of the point, (size, n) [m]."""
        point = at.point(self.joint, self.offset)
        return [point[axis] for axis in self.axes]

    def jacobian(self, tree: Tree, at: Pose) -> Rows:
        """Rows of the point's Jacobian, (size, nv)."""
        rows = zeros(3, tree.size)
        forward_kinematics.add_point_jacobian(tree, at, self.joint, at.point(self.joint, self.offset), rows)
        return [rows[axis] for axis in self.axes]

    def bias(self, at: Pose, moving: Motion) -> list[Entry]:
        """Acceleration of the point at zero joint accelerations, (size, n) [m/s2]."""
        acceleration = forward_kinematics.point_acceleration(at, moving, self.joint, self.offset)
        return [acceleration[axis] for axis in self.axes]

    def scale(self, length: float) -> float:
        """A length of the mechanism."""
        return length

    def value(self, engine: "PinocchioEngine", q: Floats) -> Floats:
        """Base coordinates (size,) [m] of the point at one configuration ``q`` (nv,)."""
        return engine.point(q, self.joint, self.offset)[0][list(self.axes)]

    def rates(self, engine: "PinocchioEngine", q: Floats) -> Floats:
        """Velocity of the point along the axes per joint rate, (size, nv) [m, -], at one configuration ``q`` (nv,)."""
        return engine.point(q, self.joint, self.offset)[1][list(self.axes)]
