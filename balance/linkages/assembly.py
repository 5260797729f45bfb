"""A position of the linkage to start from: every body placed so that all joints close, near the described one."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..errors import ClosureError, ModelError
from .description import GROUND, Joint, Linkage
from .turning import turning_groups


@dataclass(frozen=True)
class Assembly:
    """Where the bodies are: origin [m] and angle [rad] of every body's frame in the base."""

    origin: Mapping[str, Floats]
    angle: Mapping[str, float]

    def point(self, body: str, at: Floats) -> Floats:
        """A point of a body in the base, (2,) [m]."""
        return self.origin[body] + turned(self.angle[body], at)


def assemble(linkage: Linkage, values: Mapping[str, float]) -> Assembly:
    """Close all joints near the angles under [start], the driven body staying as it is said to stand.

    Raises ModelError where a place on the ground or an angle is not given, ClosureError where it cannot be closed.
    """
    from scipy.optimize import least_squares

    closing = _Closing(linkage, values)
    guess = closing.guess()
    places = np.array([k for k in range(len(guess)) if k % 3 != 2])

    def placed(p: Floats) -> Floats:
        full = guess.copy()
        full[places] = p
        return closing.gaps(full)

    guess[places] = least_squares(placed, guess[places]).x
    found = least_squares(closing.gaps, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    if not np.abs(found.fun).max() < 1e-7 * closing.size():
        raise ClosureError(
            f"{linkage.name} cannot be closed near the angles under [start]: {np.abs(found.fun).max():.3g} m stays open"
        )
    return closing.state(found.x)


class _Closing:
    """What all joints leave open, as a function of where the bodies are: x, y and angle of each in turn."""

    def __init__(self, linkage: Linkage, values: Mapping[str, float]) -> None:
        self.linkage = linkage
        self.names = list(linkage.bodies)
        self.pins = {j.name: tuple(_pin(linkage, j, k, values) for k in (0, 1)) for j in linkage.joints.values()}
        self.angles, self.driven = _angles(linkage), _driven_body(linkage)

    def guess(self) -> Floats:
        """All bodies at the origin, as they are said to stand, (3 bodies,) [m, rad]."""
        return np.array([[0.0, 0.0, self.angles[name]] for name in self.names]).ravel()

    def state(self, x: Floats) -> Assembly:
        """Where the bodies are."""
        parts = dict(zip(self.names, x.reshape(-1, 3), strict=True))
        origin = {GROUND: np.zeros(2)} | {name: part[:2] for name, part in parts.items()}
        return Assembly(origin, {GROUND: 0.0} | {name: float(part[2]) for name, part in parts.items()})

    def gaps(self, x: Floats) -> Floats:
        """Of all joints [m, -], and how far the driven body is from where it is said to stand [rad]."""
        at = self.state(x)
        rows = [row for joint in self.linkage.joints.values() for row in _gaps(joint, at, *self.pins[joint.name])]
        return np.array([*rows, at.angle[self.driven] - self.angles[self.driven]])

    def size(self) -> float:
        """Of the linkage [m]."""
        return max([1e-3, *(float(np.abs(p).max()) for pair in self.pins.values() for p in pair)])


def _angles(linkage: Linkage) -> dict[str, float]:
    """About how every body stands; those that only translate need not be described."""
    group = turning_groups(linkage)
    angles = dict(linkage.start)
    for body in linkage.bodies:
        if body not in angles:
            if group[body] != group[GROUND]:
                raise ModelError(f"{linkage.name}: [start] does not say how body {body} stands: add its angle, about")
            angles[body] = 0.0
    return angles


def _driven_body(linkage: Linkage) -> str:
    if linkage.drive is None:
        raise ModelError(f"{linkage.name} has no driven joint: add drive = 'JOINT'")
    joint = linkage.joint(linkage.drive)
    if not joint.revolute or not joint.joins(GROUND):
        raise ModelError(f"{linkage.name}: the driven joint {joint.name} must be a revolute joint on the ground")
    return joint.other(GROUND)


def _pin(linkage: Linkage, joint: Joint, side: int, values: Mapping[str, float]) -> Floats:
    end = joint.ends[side]
    if end.point is None:
        raise ModelError(f"{linkage.name} cannot be simulated: where joint {joint.name} is on the ground is not given")
    return end.point.at(values)


def _gaps(joint: Joint, at: Assembly, first: Floats, second: Floats) -> list[float]:
    """What a joint leaves open: two lengths of a pin; across the line and in direction of a slide."""
    a, b = joint.ends
    gap = at.point(a.body, first) - at.point(b.body, second)
    if joint.revolute:
        return [float(gap[0]), float(gap[1])]
    direction = at.angle[a.body] + a.along
    turn = direction - at.angle[b.body] - b.along
    return [float(np.cos(direction) * gap[1] - np.sin(direction) * gap[0]), float(np.sin(turn))]


def turned(angle: float, at: Floats) -> Floats:
    """A vector turned by an angle [rad], (2,)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * at[0] - s * at[1], s * at[0] + c * at[1]])
