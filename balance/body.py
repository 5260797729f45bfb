"""One rigid body: its momentum, what moves it, and its weight; each linear in its ten inertial parameters.

``row`` is (m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz), inertia about the origin of the joint's frame, as in
``mechanism.PARAMETERS``. A unit row gives a column of a regressor, the body's own row gives its load.
"""

from dataclasses import dataclass

from .arrays import Floats
from .components import (
    ZERO,
    Entry,
    Matrix,
    Vector,
    apply,
    apply_transposed,
    cross,
    dot,
    minus,
    plus,
    scale,
    vector,
)
from .kinematics import Motion, Pose


@dataclass(frozen=True)
class Load:
    """A force and its moment about the origin of the base frame, or a linear and an angular momentum."""

    force: Vector = ZERO
    moment: Vector = ZERO

    def plus(self, other: "Load") -> "Load":
        """Sum of two loads."""
        return Load(plus(self.force, other.force), plus(self.moment, other.moment))

    def minus(self, other: "Load") -> "Load":
        """Difference of two loads."""
        return Load(minus(self.force, other.force), minus(self.moment, other.moment))

    def along(self, at: Pose, joint: int, revolute: bool) -> Entry:
        """Share along a joint's axis: torque [N m] or force [N]."""
        if revolute:
            return dot(at.axis[joint], minus(self.moment, cross(at.position[joint], self.force)))
        return dot(at.axis[joint], self.force)


def momentum(row: Floats, at: Pose, moving: Motion, joint: int) -> Load:
    """Linear [kg m/s] and angular momentum about the base origin [kg m2/s], o the joint's origin, h the first moment:

    p = m v_o + w x h,   L = o x p + h x v_o + I w.
    """
    first, omega, velocity = at.arm(joint, row[1:4]), moving.omega[joint], moving.velocity[joint]
    linear = plus(scale(float(row[0]), velocity), cross(omega, first))
    spin = _inertia_times(at.rotation[joint], row, omega)
    return Load(linear, plus(plus(cross(at.position[joint], linear), cross(first, velocity)), spin))


def rate_of_momentum(row: Floats, at: Pose, moving: Motion, joint: int) -> Load:
    """Force [N] and moment about the base origin [N m] that move the body. Newton-Euler about the joint's origin o:

    F = m a_o + al x h + w x (w x h),   M = o x F + h x a_o + I al + w x (I w).
    """
    first, acceleration = at.arm(joint, row[1:4]), moving.acceleration[joint]
    omega, alpha = moving.omega[joint], moving.alpha[joint]
    swept = plus(cross(alpha, first), cross(omega, cross(omega, first)))
    force = plus(scale(float(row[0]), acceleration), swept)
    spin = _inertia_times(at.rotation[joint], row, alpha)
    gyroscopic = cross(omega, _inertia_times(at.rotation[joint], row, omega))
    moment = plus(plus(cross(at.position[joint], force), cross(first, acceleration)), plus(spin, gyroscopic))
    return Load(force, moment)


def weight(row: Floats, at: Pose, gravity: Floats, joint: int) -> Load:
    """Weight [N] and its moment about the base origin [N m]."""
    g = vector(gravity)
    centre = plus(scale(float(row[0]), at.position[joint]), at.arm(joint, row[1:4]))
    return Load(scale(float(row[0]), g), cross(centre, g))


def _inertia_times(rotation: Matrix, row: Floats, angular: Vector) -> Vector:
    """Inertia about the joint's origin times a base-frame vector."""
    xx, xy, yy, xz, yz, zz = (float(x) for x in row[4:])
    inertia = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    return apply(rotation, apply(inertia, apply_transposed(rotation, angular)))
