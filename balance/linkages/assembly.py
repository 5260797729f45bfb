"""A linkage put together: places and angles of its bodies at which all joints close, near those of the description."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..errors import ClosureError, ModelError
from .linkage import GROUND, Joint, Linkage


@dataclass(frozen=True)
class Assembly:
    """Positions of the bodies: origin [m] and angle [rad] of every body's frame in the base."""

    origin: Mapping[str, Floats]
    angle: Mapping[str, float]

    def point(self, body: str, at: Floats) -> Floats:
        """A point of a body, in its frame (2,) [m], in the base, (2,) [m]."""
        return self.origin[body] + rotated(self.angle[body], at)


def assemble(linkage: Linkage, values: Mapping[str, float]) -> Assembly:
    """Close all joints near the angles under [start], the driven body at its own.

    Raises ModelError where a place on the ground or an angle is not given, ClosureError where it cannot be closed.
    """
    from scipy.optimize import least_squares

    pins: dict[str, list[Floats]] = {name: [] for name in linkage.joints}
    for name, joint in linkage.joints.items():
        for end in joint.ends:
            if end.point is None:
                raise ModelError(
                    f"{linkage.name} cannot be simulated: where joint {name} is on the ground is not given"
                )
            pins[name].append(end.point.at(values))
    if linkage.drive is None:
        raise ModelError(f"{linkage.name} has no driven joint: add drive = 'JOINT'")
    joint = linkage.joint(linkage.drive)
    if not joint.revolute or not joint.joins(GROUND):
        raise ModelError(f"{linkage.name}: the driven joint {joint.name} must be a revolute joint on the ground")
    if unknown := [b for b in linkage.bodies if b not in linkage.start and b not in linkage.translating]:
        raise ModelError(f"{linkage.name}: [start] has no angle of body {unknown[0]}: add it, approximately")
    angles, driven = dict.fromkeys(linkage.bodies, 0.0) | dict(linkage.start), joint.other(GROUND)

    def state(x: Floats) -> Assembly:  # of x, y and angle of each body in turn
        parts = dict(zip(linkage.bodies, x.reshape(-1, 3), strict=True))
        origin = {GROUND: np.zeros(2)} | {name: part[:2] for name, part in parts.items()}
        return Assembly(origin, {GROUND: 0.0} | {name: float(part[2]) for name, part in parts.items()})

    def gaps(x: Floats) -> Floats:
        at = state(x)
        rows = [row for joint in linkage.joints.values() for row in _gaps(joint, at, *pins[joint.name])]
        return np.array([*rows, at.angle[driven] - angles[driven]])

    turned = np.array([[angles[name]] for name in linkage.bodies])

    def placed(p: Floats) -> Floats:  # at the angles under [start]
        return gaps(np.hstack([p.reshape(-1, 2), turned]).ravel())

    places = least_squares(placed, np.zeros(2 * len(turned))).x
    guess = np.hstack([places.reshape(-1, 2), turned]).ravel()
    found = least_squares(gaps, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    size = max([1e-3, *(float(np.abs(p).max()) for pair in pins.values() for p in pair)])
    if not np.abs(found.fun).max() < 1e-7 * size:
        raise ClosureError(
            f"{linkage.name} cannot be closed near the angles under [start]: {np.abs(found.fun).max():.3g} m stays open"
        )
    return state(found.x)


def _gaps(joint: Joint, at: Assembly, first: Floats, second: Floats) -> list[float]:
    """Gaps of a joint: two lengths of a pin; across the line and in direction of a slide."""
    a, b = joint.ends
    gap = at.point(a.body, first) - at.point(b.body, second)
    if joint.revolute:
        return [float(gap[0]), float(gap[1])]
    direction = at.angle[a.body] + a.along
    turn = direction - at.angle[b.body] - b.along
    return [float(np.cos(direction) * gap[1] - np.sin(direction) * gap[0]), float(np.sin(turn))]


def rotated(angle: float, at: Floats) -> Floats:
    """A vector (2,) turned by an angle [rad], (2,) [its unit]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * at[0] - s * at[1], s * at[0] + c * at[1]])
