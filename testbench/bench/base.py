"""The base: a rigid body on spring-damper mounts in six degrees of freedom.

Small motions x = (u, phi): translation of the base frame's origin [m], rotation [rad], base axes, from equilibrium.
With the mechanism's inertia locked onto the base and w its shaking wrench about the same origin:

    (M_base + M_mechanism) x'' + C x' + K x = w
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats

from ..errors import RigError
from .linear import respond, times

if TYPE_CHECKING:
    from ..rig.bench import Bench


def skew(vector: Floats) -> Floats:
    """The matrix S with S b = vector x b, (3, 3)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def displacement_at(point: Floats) -> Floats:
    """The matrix J with J x = u + phi x point, (3, 6)."""
    return np.hstack([np.eye(3), -skew(point)])


def rigid_body(mass: float, first: Floats, inertia: Floats) -> Floats:
    """Mass matrix about the origin, (6, 6): ``first`` moment of mass [kg m] and ``inertia`` [kg m2] about it."""
    return np.block([[mass * np.eye(3), -skew(first)], [skew(first), inertia]])


def first_moment(mass: Floats) -> Floats:
    """First moment of mass (..., 3) [kg m] of mass matrices (..., 6, 6)."""
    return np.stack([mass[..., 5, 1], mass[..., 3, 2], mass[..., 4, 0]], axis=-1)


@dataclass(frozen=True)
class BaseMotion:
    """Motion of the base frame, translations first: (n, 6) each."""

    displacement: Floats
    """[m, rad]"""
    velocity: Floats
    """[m/s, rad/s]"""
    acceleration: Floats
    """[m/s2, rad/s2]"""

    def plus(self, other: "BaseMotion") -> "BaseMotion":
        """This motion and another: the base is linear."""
        return BaseMotion(
            self.displacement + other.displacement,
            self.velocity + other.velocity,
            self.acceleration + other.acceleration,
        )

    def acceleration_at(self, point: Floats) -> Floats:
        """Acceleration of a point of the base, base axes, (n, 3) [m/s2]; small motions, no centripetal part."""
        return self.acceleration @ displacement_at(point).T


@dataclass(frozen=True)
class Base:
    """Mass, damping and stiffness about the base frame's origin, (6, 6) each, SI."""

    mass: Floats
    damping: Floats
    stiffness: Floats

    @classmethod
    def of(cls, bench: "Bench", carried: Floats | None = None) -> "Base":
        """The base of a rig, ``carried`` (6, 6) being the inertia of what it carries. Raises RigError if it falls."""
        centre, weight = np.array(bench.centre), bench.mass
        own = np.diag(bench.inertia) - weight * skew(centre) @ skew(centre)
        mass = rigid_body(weight, weight * centre, own)
        stiffness, damping = np.zeros((2, 6, 6))
        for mount in bench.mounts:
            at = displacement_at(np.array(mount.position))
            stiffness += at.T @ np.diag(mount.stiffness) @ at
            damping += at.T @ np.diag(mount.damping) @ at
        if np.linalg.cond(stiffness) > 1e12:
            raise RigError(
                f"bench.mounts: {len(bench.mounts)} mounts do not hold the base in all six degrees of freedom: "
                "expected at least three that are not in line"
            )
        return cls(mass if carried is None else mass + carried, damping, stiffness)

    @property
    def frequencies_hz(self) -> Floats:
        """Undamped natural frequencies, rising, (6,) [Hz]."""
        from scipy.linalg import eigh

        return np.sqrt(eigh(self.stiffness, self.mass, eigvals_only=True)) / (2.0 * np.pi)

    def state_space(self) -> tuple[Floats, Floats]:
        """A (12, 12) and B (12, 6) of y' = A y + B w with y = (x, x')."""
        a, b = np.zeros((12, 12)), np.zeros((12, 6))
        a[:6, 6:] = np.eye(6)
        a[6:, :6], a[6:, 6:] = (-np.linalg.solve(self.mass, matrix) for matrix in (self.stiffness, self.damping))
        b[6:] = np.linalg.inv(self.mass)
        return a, b

    def respond(self, wrench: Floats, step: float) -> BaseMotion:
        """Motion from rest under a wrench (n, 6) [N, N m] sampled every ``step`` [s]; exact where that is linear."""
        a, b = self.state_space()
        state = respond(a, b, wrench, step)
        return BaseMotion(state[:, :6], state[:, 6:], times(a[6:], state) + times(b[6:], wrench))
