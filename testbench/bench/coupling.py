"""Moving base and moving mechanism together, to first order in the base's motion x = (u, phi).

A particle at rho(t) in the base frame is at u + R(phi) rho, so with p and L the mechanism's linear and angular momentum
on a base at rest, and w = (F, M) = -(p', L') its shaking wrench, what moves the base about its own origin is

    w + phi x w - M(t) x'' - G(t) x',   G x' = (2 phi' x p, I' phi' + phi' x L)

with M(t) the mechanism's inertia at q(t) and I' the rate of its turning part. Locked, M is that at the start and the
rest is left out. The joints follow the command relative to the base, whatever the base does.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.closure import Trajectory
from balance.dynamics.inverse_dynamics import momentum
from balance.dynamics.moving_base import BaseMotion, ElasticBase, first_moment, inertia_along, skew, skews, times
from balance.mechanism import Mechanism

from ..errors import RigError
from ..rig.effects import Rotor
from .rotors import momentum as spin

ROUNDS = 40
AGREED = 1e-7
"""Change of the base's acceleration in a round, as a share of its largest, at which the motion counts as found."""


@dataclass(frozen=True)
class Coupling:
    """What couples a moving mechanism to a moving base, at each instant."""

    inertia: Floats
    """M, (n, 6, 6)."""
    gyration: Floats
    """G, (n, 6, 6)."""
    turning: Floats
    """N with -N x = (phi x F, phi x M + (phi x s) x g), (n, 6, 6); s: first moment of mass less that at the start."""

    @classmethod
    def of(
        cls,
        mechanism: Mechanism,
        trajectory: Trajectory,
        wrench: Floats,
        rotors: Mapping[str, Rotor],
        gravity: Floats,
    ) -> "Coupling":
        """Along a trajectory with shaking wrench (n, 6) [N, N m], that of the rotors included; gravity (3,) or zero."""
        inertia = inertia_along(mechanism, trajectory.q)
        moving = momentum(mechanism, trajectory.q, trajectory.v)
        gyration, turning = np.zeros((2, len(wrench), 6, 6))
        gyration[:, :3, 3:] = -2.0 * skews(moving[:, :3])
        rate = np.gradient(inertia[:, 3:, 3:], float(trajectory.time[1] - trajectory.time[0]), axis=0)
        gyration[:, 3:, 3:] = rate - skews(moving[:, 3:] + spin(mechanism, rotors, trajectory.v))
        turning[:, :3, 3:], turning[:, 3:, 3:] = skews(wrench[:, :3]), skews(wrench[:, 3:])
        wandered = first_moment(inertia) - first_moment(inertia[:1])
        turning[:, 3:, 3:] -= skew(gravity) @ skews(wandered)
        return cls(inertia, gyration, turning)

    def respond(self, base: ElasticBase, carried: Floats, push: Floats, step: float) -> BaseMotion:
        """Motion from rest under ``push`` (n, 6), the base holding ``carried``; the rest of M by iteration.

        Raises RigError if the mechanism is so heavy beside its base that the rounds do not agree.
        """
        moved = base.respond(push, step)
        for _ in range(ROUNDS):
            more = self.reaction(moved) - times(carried, moved.acceleration) + _times(self.turning, moved.displacement)
            after = base.respond(push - more, step)
            change = np.abs(after.acceleration - moved.acceleration).max()
            moved = after
            if change <= AGREED * np.abs(moved.acceleration).max():
                return moved
        raise RigError(
            f"bench.coupling: the base's motion still changes by {change:.3g} m/s2 after {ROUNDS} rounds: expected a "
            "base that is heavier than what moves on it; state its mass, or coupling = 'locked'"
        )

    def reaction(self, motion: BaseMotion) -> Floats:
        """M x'' + G x', base axes, (n, 6) [N, N m]."""
        return _times(self.inertia, motion.acceleration) + _times(self.gyration, motion.velocity)


def _times(matrices: Floats, vectors: Floats) -> Floats:
    return np.matmul(matrices, vectors[:, :, None])[:, :, 0]
