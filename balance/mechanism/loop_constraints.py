"""Constraints between two frames, or two joints: residual, Jacobian and acceleration bias of a state.

A loop closes where the residual r(q) vanishes: J q' = 0, J q'' = -bias. Rows are of the base axes; nv is the number of
joint coordinates. A state is symbols of a tape.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from .forward_kinematics import Motion, Pose, Tree, angular_jacobian, point_acceleration, point_jacobian, pose
from .tape import Program, Symbols, Tape, cross


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

    @property
    def size(self) -> int:
        """Number of rows."""
        return 6 if self.weld else 3

    def residual(self, at: Pose) -> Symbols:
        """First anchor less the second: origins [m], (3,); for a weld also the small rotation [rad], (6,).

        That is half the sum of second x first over the axes.
        """
        ends = (self.first, self.second)
        gap = np.subtract(*(at.point(end.joint, end.position) for end in ends))
        if not self.weld:
            return gap
        first, second = (at.rotation[end.joint] @ end.rotation for end in ends)
        x, y, z = cross(second.T, first.T)
        return np.concatenate([gap, 0.5 * (x + y + z)])

    def jacobian(self, tree: Tree, at: Pose) -> Symbols:
        """Rate of the residual per joint rate, (3, nv) or (6, nv)."""
        ends = (self.first, self.second)
        rows = np.subtract(*(point_jacobian(tree, at, end.joint, end.position) for end in ends))
        if not self.weld:
            return rows
        return np.concatenate([rows, np.subtract(*(angular_jacobian(tree, at, end.joint) for end in ends))])

    def bias(self, at: Pose, moving: Motion) -> Symbols:
        """Second rate of the residual at zero joint accelerations (``moving``), (3,) or (6,) [m/s2, rad/s2]."""
        first, second = self.first, self.second
        gap = np.subtract(*(point_acceleration(at, moving, end.joint, end.position) for end in (first, second)))
        return np.concatenate([gap, moving.alpha[first.joint] - moving.alpha[second.joint]]) if self.weld else gap


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

    def gap(self, q: NDArray[Any]) -> Any:  # noqa: ANN401
        """First coordinate less what the second asks of it [rad, m], at a configuration ``q`` (nv,)."""
        return q[self.first] - self.zero[0] - self._polynomial(q, 0)

    def row(self, q: NDArray[Any]) -> NDArray[Any]:
        """Rate of the gap per joint rate, (nv,), at a configuration ``q`` (nv,) [rad, m]."""
        rates = np.full_like(q, 0.0)
        rates[self.first] = 1.0
        if self.second is not None:
            rates[self.second] = 0.0 - self._polynomial(q, 1)
        return rates

    def residual(self, at: Pose) -> Symbols:
        """The gap, (1,) [rad, m]."""
        return np.array([self.gap(at.q)], dtype=object)

    def jacobian(self, tree: Tree, at: Pose) -> Symbols:
        """Rate of the residual per joint rate, (1, nv)."""
        return self.row(at.q)[None]

    def bias(self, at: Pose, moving: Motion) -> Symbols:
        """Second rate of the residual at zero joint accelerations (``moving``), (1,) [rad/s2, m/s2]."""
        rate = 0.0 if self.second is None else moving.rate[self.second]
        return np.array([0.0 - self._polynomial(at.q, 2) * (rate * rate)], dtype=object)

    def _polynomial(self, q: NDArray[Any], order: int) -> Any:  # noqa: ANN401
        """The polynomial, or its derivative of an ``order``."""
        coefficients = self.coefficients.tolist()
        for _ in range(order):
            coefficients = [k * c for k, c in enumerate(coefficients)][1:]
        if self.second is None:
            return coefficients[0]
        from_zero = q[self.second] - self.zero[1]
        value = coefficients[-1]
        for coefficient in reversed(coefficients[:-1]):
            value = value * from_zero + coefficient
        return value


Constraint = Loop | Coupling
"""What ties coordinates to each other."""


def constraint_residual(loops: tuple[Constraint, ...], at: Pose) -> Symbols:
    """Residuals of all loops stacked, (rows,) [m, rad]; no rows for an open chain."""
    return np.concatenate([np.empty(0, object), *(loop.residual(at) for loop in loops)])


def constraint_jacobian(loops: tuple[Constraint, ...], tree: Tree, at: Pose) -> Symbols:
    """Jacobians of all loops stacked, (rows, nv)."""
    return np.concatenate([np.empty((0, tree.size), object), *(loop.jacobian(tree, at) for loop in loops)])


def constraint_bias(loops: tuple[Constraint, ...], at: Pose, moving: Motion) -> Symbols:
    """Acceleration bias of all loops stacked, (rows,) [m/s2, rad/s2]."""
    return np.concatenate([np.empty(0, object), *(loop.bias(at, moving) for loop in loops)])


def constraints_at(tree: Tree, loops: tuple[Constraint, ...], q: Floats) -> tuple[Floats, Floats]:
    """Residuals (n, rows) [m, rad] and Jacobians (n, rows, nv) of all loops at ``q`` (n, nv) [rad, m]."""

    def write() -> Program:
        tape = Tape()
        at = pose(tree, tape.rows(tree.size))
        gap, rows = constraint_residual(loops, at), constraint_jacobian(loops, tree, at)
        return tape.program([*gap, *rows.ravel()])

    flat = tree.once(("constraints", loop_key(loops)), write).values(q.T).T
    gap, rows = np.split(flat, [sum(loop.size for loop in loops)], axis=1)
    return gap, rows.reshape(len(q), -1, tree.size)


def loop_key(loops: tuple[Constraint, ...]) -> Hashable:
    """What tells loops from others of the same tree: coordinates that were fixed."""
    return tuple((one.first, one.zero) for one in loops if isinstance(one, Coupling) and one.second is None)
