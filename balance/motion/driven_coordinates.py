"""What a motion drives: joints, or a point of a body along axes of the base."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..errors import ModelError
from ..mechanism.forward_kinematics import Motion, Pose, Tree, point_acceleration, point_jacobian
from ..mechanism.mechanism import Mechanism
from ..mechanism.tape import Symbols

if TYPE_CHECKING:
    from ..mechanism.pinocchio_engine import PinocchioEngine

AXES = {"x": 0, "y": 1, "z": 2}


@dataclass(frozen=True)
class Drive:
    """Driven coordinates u(q), with their Jacobian and acceleration bias: joints, or base coordinates of a point."""

    names: tuple[str, ...]
    indices: tuple[int, ...]
    """Which joints, or which axes of the base."""
    point: tuple[int, Floats] | None = None
    """The joint that carries the point, and the point in its frame, (3,) [m]; None where joints are driven."""

    @classmethod
    def of_joints(cls, mechanism: Mechanism, joints: tuple[str, ...], sliding: tuple[bool, ...] = ()) -> "Drive":
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

    @classmethod
    def of_point(cls, mechanism: Mechanism, place: str, axes: tuple[str, ...]) -> "Drive":
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
        return cls(names, tuple(AXES[axis] for axis in axes), (mechanism.tree.bodies[body], offset))

    @property
    def size(self) -> int:
        """Number of driven coordinates."""
        return len(self.indices)

    @property
    def key(self) -> tuple[object, ...]:
        """What tells it from other drives of the same mechanism."""
        return self.indices, self.point and (self.point[0], self.point[1].tobytes())

    def position(self, at: Pose) -> Symbols:
        """Driven coordinates, (size,) [rad, m]."""
        return self._chosen(at.point(*self.point) if self.point else at.q)

    def jacobian(self, tree: Tree, at: Pose) -> Symbols:
        """Their rates per joint rate, (size, nv)."""
        return self._chosen(point_jacobian(tree, at, *self.point) if self.point else np.eye(tree.size).astype(object))

    def bias(self, at: Pose, moving: Motion) -> Symbols:
        """Their second rates where ``moving`` has zero joint accelerations, (size,) [rad/s2, m/s2]."""
        return self._chosen(point_acceleration(at, moving, *self.point) if self.point else 0.0 * at.q)

    def scales(self, of_all: Floats, length: float) -> Floats:
        """Scales of the driven coordinates, (size,) [rad, m]: their own ``of_all`` (nv,), of a point ``length`` [m]."""
        return np.full(self.size, length) if self.point else self._chosen(of_all)

    def value(self, engine: "PinocchioEngine", q: Floats) -> Floats:
        """Driven coordinates (size,) [rad, m] of one configuration ``q`` (nv,)."""
        return self._chosen(engine.point(q, *self.point)[0] if self.point else q)

    def rates(self, engine: "PinocchioEngine", q: Floats) -> Floats:
        """Their rates per joint rate (size, nv) [-, m] at one configuration ``q`` (nv,) [rad, m]."""
        return self._chosen(engine.point(q, *self.point)[1] if self.point else np.eye(len(q)))

    def _chosen(self, of_all: NDArray[Any]) -> NDArray[Any]:
        return of_all[list(self.indices)]
