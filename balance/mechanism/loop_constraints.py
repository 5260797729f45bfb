"""Constraints between two frames, or two joints: residual, Jacobian and acceleration bias, for many states at once.

A loop closes where the residual r(q) vanishes: J q' = 0, J q'' = -bias. Rows are of the base axes; n is the number of
samples, nv that of the joint coordinates.
"""

from dataclasses import dataclass

from ..arrays import Floats
from . import forward_kinematics
from .forward_kinematics import Motion, Pose, Tree
from .sparse_components import (
    ZERO,
    Entries,
    Entry,
    Matrix,
    Rows,
    Vector,
    add,
    cross,
    matrix,
    minus,
    mul,
    plus,
    product,
    scale,
    sub,
    zeros,
)


@dataclass(frozen=True)
class Anchor:
    """A frame fixed in the frame of an elementary joint, or in the base for joint -1."""

    joint: int
    rotation: Floats
    """Rotation of the anchor in the joint's frame, (3, 3)."""
    position: Floats
    """Origin of the anchor in the joint's frame, (3,) [m]."""


@dataclass(frozen=True)
class Loop:
    """Two anchors that coincide: their origins (connect, 3 rows), or also their axes (weld, 6 rows)."""

    name: str
    first: Anchor
    second: Anchor
    weld: bool

    def residual(self, at: Pose) -> list[Entry]:
        """First anchor less the second: origins [m], for a weld also orientation [rad], (3, n) or (6, n)."""
        gap = minus(at.point(self.first.joint, self.first.position), at.point(self.second.joint, self.second.position))
        return [*gap, *self._small_rotation(at)] if self.weld else [*gap]

    def jacobian(self, tree: Tree, at: Pose) -> Rows:
        """Rate of the residual per joint rate, (3, nv) or (6, nv)."""
        rows = zeros(self.size, tree.size)
        for end, sign in ((self.first, 1.0), (self.second, -1.0)):
            point = at.point(end.joint, end.position)
            forward_kinematics.add_point_jacobian(tree, at, end.joint, point, rows[:3], sign)
            if self.weld:
                forward_kinematics.add_angular_jacobian(tree, at, end.joint, rows[3:], sign)
        return rows

    def bias(self, at: Pose, moving: Motion) -> list[Entry]:
        """Second rate of the residual at zero joint accelerations (``moving``), (3, n) or (6, n) [m/s2, rad/s2]."""
        ends = [
            forward_kinematics.point_acceleration(at, moving, end.joint, end.position)
            for end in (self.first, self.second)
        ]
        turns = [moving.alpha[end.joint] if end.joint >= 0 else ZERO for end in (self.first, self.second)]
        return [*minus(*ends), *minus(*turns)] if self.weld else [*minus(*ends)]

    @property
    def size(self) -> int:
        """Number of rows."""
        return 6 if self.weld else 3

    def _small_rotation(self, at: Pose) -> Vector:
        """Small rotation from the second anchor to the first: half the sum of second x first over the axes."""
        axes = zip(self._axes(at, self.second), self._axes(at, self.first), strict=True)
        x, y, z = (cross(second, first) for second, first in axes)
        return scale(0.5, plus(plus(x, y), z))

    @staticmethod
    def _axes(at: Pose, end: Anchor) -> Matrix:
        own = matrix(end.rotation)
        return product(at.rotation[end.joint], own) if end.joint >= 0 else own


@dataclass(frozen=True)
class Coupling:
    """Two coordinates of which the first follows a polynomial of the second, such as two gears; or one that is held.

    q_first - zero_first = c0 + c1 (q_second - zero_second) + ... + c4 (q_second - zero_second)^4.
    """

    name: str
    first: int
    second: int | None
    """None where the first is held at c0."""
    coefficients: Floats
    """c0 to c4, (5,) [rad, m, ...]."""
    zero: tuple[float, float]
    """What the two are counted from [rad, m]."""
    size = 1
    """Number of rows."""

    def gap(self, q: Entries) -> Entry:
        """First coordinate less what the second asks of it [rad, m], for each configuration of ``q`` (nv, ...)."""
        return sub(sub(q[self.first], self.zero[0]), self._polynomial(q, 0))

    def row(self, q: Entries) -> list[Entry]:
        """Rate of the gap per joint rate, for each configuration of ``q`` (nv, ...)."""
        rates: list[Entry] = [0.0] * len(q)
        rates[self.first] = 1.0
        if self.second is not None:
            rates[self.second] = sub(0.0, self._polynomial(q, 1))
        return rates

    def residual(self, at: Pose) -> list[Entry]:
        """The gap, (1, n) [rad, m]."""
        return [self.gap(at.q)]

    def jacobian(self, tree: Tree, at: Pose) -> Rows:
        """Rate of the residual per joint rate, (1, nv)."""
        return [self.row(at.q)]

    def bias(self, at: Pose, moving: Motion) -> list[Entry]:
        """Second rate of the residual at zero joint accelerations (``moving``), (1, n) [rad/s2, m/s2]."""
        if self.second is None:
            return [0.0]
        rate = moving.rate[self.second]
        return [sub(0.0, mul(self._polynomial(at.q, 2), mul(rate, rate)))]

    def _polynomial(self, q: Entries, order: int) -> Entry:
        """The polynomial, or its derivative of an ``order``, for each configuration."""
        coefficients = self.coefficients.tolist()
        for _ in range(order):
            coefficients = [k * c for k, c in enumerate(coefficients)][1:]
        *others, value = coefficients
        if self.second is None:
            return others[0] if others else value
        from_zero = sub(q[self.second], self.zero[1])
        for coefficient in reversed(others):
            value = add(mul(value, from_zero), coefficient)
        return value


Constraint = Loop | Coupling
"""What ties coordinates to each other."""


def constraint_residual(loops: tuple[Constraint, ...], at: Pose) -> list[Entry]:
    """Residuals of all loops stacked, (rows, n) [m, rad]; no rows for an open chain."""
    return [entry for loop in loops for entry in loop.residual(at)]


def constraint_jacobian(loops: tuple[Constraint, ...], tree: Tree, at: Pose) -> Rows:
    """Jacobians of all loops stacked, by component, (rows, nv)."""
    return [row for loop in loops for row in loop.jacobian(tree, at)]


def constraint_bias(loops: tuple[Constraint, ...], at: Pose, moving: Motion) -> list[Entry]:
    """Acceleration bias of all loops stacked, (rows, n) [m/s2, rad/s2]."""
    return [entry for loop in loops for entry in loop.bias(at, moving)]
