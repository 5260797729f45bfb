"""What a moving base and the mechanism that moves on it do to each other, beyond M x'' + C x' + K x = w.

In axes of the base the momentum about its origin is h = (p, L) = h_mechanism + I(q) V with V = (v, omega), the speed of
that origin and of the base's turning, and exactly

    h' + (omega x p, omega x L + v x p) = mounts + weight.

Of first order in the base's motion x are an inertia I(q) that changes, Coriolis forces, and the weight of what has
moved on a base that tilts; of second order springs whose points turn, and centripetal accelerations. Springs stay along
the axes of the base at rest.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres
from scipy.spatial.transform import Rotation

from balance.arrays import Floats
from balance.balancing.conditions import Conditions
from balance.dynamics.moving_base import (
    BaseMotion,
    MountedBase,
    apparent_gravity,
    displacement_at,
    first_moment,
    inertia_along,
    locked_inertia,
)
from balance.dynamics.regressor import momentum_regressor, wrench_regressor
from balance.estimation.first_moment_imbalance import with_condition_values
from balance.mechanism.mechanism import Mechanism

from ..errors import AnalysisError
from ..runs.aligned_run import AlignedRun
from .vibration_regression import ShakenBase

_SMALL = 1e-3
"""Part of the base's motion by which terms of first order are told from those of second."""
_ROUNDS, _SETTLED = 60, 1e-4
"""Rounds to the base's motion at most, and what these leave of its equation, as a part, below which it is found."""


@dataclass(frozen=True)
class BaseCoupling:
    """One run, its base and a mechanism."""

    run: ShakenBase
    bench: MountedBase
    points: Floats
    """Of the accelerometers' channels, in the base's frame, (channels, 3) [m]."""
    mechanism: Mechanism
    """As it was found to be, with the names and joints of the run's."""
    exact: bool
    """Whether the base moves as bodies do, and not to first order, as simulated benches move."""
    carried: Mechanism | None = None
    """That whose inertia the base carries, where it is another."""

    @classmethod
    def of(cls, run: ShakenBase, aligned: AlignedRun, mechanism: Mechanism) -> "BaseCoupling":
        """Of a run, what its rig states, and the mechanism as it was found to be."""
        places = aligned.rig.base_accelerometers
        points = np.array([places[column.sensor].position for column in run.sensors.columns])
        return cls(run, aligned.rig.bench, points, mechanism, aligned.run.origin != "simulated")

    def with_heavier_joints(self, conditions: Conditions, share: float) -> "BaseCoupling":
        """Whose base carries a ``share`` more [-] of each body's mass, at its joint as far as no condition shows it."""
        heavy = replace(self.mechanism, parameters=self.mechanism.parameters * np.r_[1.0 + share, np.ones(9)])
        carried = with_condition_values(conditions, heavy, conditions.values(self.mechanism))
        return replace(self, carried=carried)

    def readings(self) -> tuple[Floats, Floats]:
        """What the coupling adds to the readings, and which part is of second order.

        (n, channels) [m/s2] each, of the samples that count. Simulated benches move to first order: of their runs no
        second order is added. Raises AnalysisError where the base's motion is not found.
        """
        run = self.run
        still = np.zeros((run.grid.count, 6))
        push = self.unbalanced(BaseMotion(still, still, still))

        def without_first(pushed: Floats) -> Floats:
            return pushed - self._first(self._motion(pushed)).ravel()

        size = (push.size, push.size)
        whole, left = gmres(
            LinearOperator(size, without_first, dtype=float), push.ravel(), rtol=_SETTLED, restart=_ROUNDS, maxiter=1
        )
        if left:
            raise AnalysisError(
                f"{run.valid.run}: the mechanism is too heavy for its base: how the base moves under it is not found "
                f"in {_ROUNDS} rounds; check mass and damping in the rig's [bench], or use trial masses (--from trials)"
            )
        motion = self._motion(whole)
        first = self._first(motion)
        second = self.unbalanced(motion) - push + self._linear(motion) - first
        shown = run.answers(np.stack([first, second], axis=2))
        shown[:, :, 1] += self._shown_exactly(motion) - self._shown_linearly(motion)
        smooth = run.smooth(shown)
        return smooth[:, :, 0] + self.exact * smooth[:, :, 1], smooth[:, :, 1]

    def _motion(self, pushed: Floats) -> BaseMotion:
        """Of the base, its inertia as at the start, under wrenches (6 n,) [N, N m]."""
        moved = self.run.moved(pushed.reshape(-1, 1, 6))
        return BaseMotion(moved.displacement[:, 0], moved.velocity[:, 0], moved.acceleration[:, 0])

    def _first(self, motion: BaseMotion) -> Floats:
        """What the coupling adds to a motion's wrenches, of first order in it, (n, 6) [N, N m]."""
        ahead, behind = (self.unbalanced(_scaled(motion, part)) for part in (_SMALL, -_SMALL))
        return (ahead - behind) / (2.0 * _SMALL) + self._linear(motion)

    def unbalanced(self, motion: BaseMotion) -> Floats:
        """Mounts and weight less h' and what turns with it, in axes of the base about its origin, (n, 6) [N, N m]."""
        run, first = self.run, first_moment(self._inertia)
        to_base, speed, rate = _in_base_axes(motion)
        momentum = self._momentum + _times(self._inertia, speed)
        found = self._wrench - _times(self._inertia, rate) - _times(self._inertia_rate, speed)
        found[:, :3] -= np.cross(speed[:, 3:], momentum[:, :3])
        found[:, 3:] -= np.cross(speed[:, 3:], momentum[:, 3:]) + np.cross(speed[:, :3], momentum[:, :3])
        weight = to_base @ run.gravity
        found += np.hstack([self._inertia[0, 0, 0] * weight, np.cross(first, weight)])
        at_rest = np.concatenate([self._inertia[0, 0, 0] * run.gravity, np.cross(first[0], run.gravity)])
        sag = np.linalg.solve(self.bench.elastic().stiffness, at_rest)
        for mount in self.bench.mounts:
            point = np.array(mount.position)
            arm = np.einsum("nji,j->ni", to_base, point)
            moved = motion.displacement[:, :3] + arm - point + displacement_at(point) @ sag
            velocity = motion.velocity[:, :3] + np.einsum("nji,nj->ni", to_base, np.cross(speed[:, 3:], point))
            force = _times(to_base, -np.array(mount.stiffness) * moved - np.array(mount.damping) * velocity)
            found += np.hstack([force, np.cross(point, force)])
        return found

    @cached_property
    def _inertia(self) -> Floats:
        """I(q), of base and mechanism, (n, 6, 6) [kg, kg m, kg m2]."""
        run = self.run
        return (
            run.base.mass
            - locked_inertia(run.model, run.path.q[0])
            + inertia_along(self.carried or self.mechanism, run.path.q)
        )

    @cached_property
    def _momentum(self) -> Floats:
        return momentum_regressor(self.mechanism, self.run.path.q, self.run.path.v) @ self.mechanism.pi

    @cached_property
    def _wrench(self) -> Floats:
        path = self.run.path
        return wrench_regressor(self.mechanism, path.q, path.v, path.a) @ self.mechanism.pi

    @cached_property
    def _inertia_rate(self) -> Floats:
        return np.gradient(self._inertia, self.run.grid.step, axis=0)

    def _linear(self, motion: BaseMotion) -> Floats:
        """M x'' + C x' + K x, (n, 6) [N, N m]."""
        base = self.run.base
        pairs = (
            (base.mass, motion.acceleration),
            (base.damping, motion.velocity),
            (base.stiffness, motion.displacement),
        )
        return np.sum([vectors @ matrix.T for matrix, vectors in pairs], axis=0)

    def _shown_linearly(self, motion: BaseMotion) -> Floats:
        acceleration = motion.acceleration.copy()
        acceleration[:, :3] += apparent_gravity(self.run.gravity, motion.displacement)
        return np.asarray(acceleration @ self.run.sensors.rows.T)

    def _shown_exactly(self, motion: BaseMotion) -> Floats:
        """Readings of the accelerometers less those at rest, (n, channels) [m/s2]."""
        to_base, speed, rate = _in_base_axes(motion)
        origin = _times(to_base, motion.acceleration[:, :3]) + self.run.gravity - to_base @ self.run.gravity
        found = np.empty((len(origin), len(self.points)))
        for k, (point, row) in enumerate(zip(self.points, self.run.sensors.rows, strict=True)):
            turning = np.cross(rate[:, 3:], point) + np.cross(speed[:, 3:], np.cross(speed[:, 3:], point))
            found[:, k] = (origin + turning) @ row[:3]
        return found


def _scaled(motion: BaseMotion, part: float) -> BaseMotion:
    return BaseMotion(part * motion.displacement, part * motion.velocity, part * motion.acceleration)


def _times(matrices: Floats, vectors: Floats) -> Floats:
    """Each of ``matrices`` (n, j, k) times its vector (n, k), (n, j)."""
    return np.asarray(np.einsum("njk,nk->nj", matrices, vectors))


def _in_base_axes(motion: BaseMotion) -> tuple[Floats, Floats, Floats]:
    """R' (n, 3, 3) [-], V and its rate of change, (n, 6) [m/s, rad/s] and [m/s2, rad/s2], to second order in x."""
    angle, turning = motion.displacement[:, 3:], motion.velocity[:, 3:]
    to_base = Rotation.from_rotvec(angle).as_matrix().transpose(0, 2, 1)
    omega = turning - 0.5 * np.cross(angle, turning)
    velocity = _times(to_base, motion.velocity[:, :3])
    rate = _times(to_base, motion.acceleration[:, :3]) - np.cross(omega, velocity)
    faster = motion.acceleration[:, 3:] - 0.5 * np.cross(angle, motion.acceleration[:, 3:])
    return to_base, np.hstack([velocity, omega]), np.hstack([rate, faster])
