"""Readings with the base's motion taken out, as far as accelerometers on the base measure that motion.

The base's accelerations x'' = (u'', phi'') appear in a sensor's readings as S x'' and in those of an accelerometer on
the base as A x''. One accelerometer does not determine the rotation phi''. But whatever x'' is, it does not appear
behind the projection P = I - [S; A] [S; A]^+: with one accelerometer of three axes P keeps the components along the
line from it to the sensor or, for the force on the supports, to the mechanism's centre of mass. No property of the base
is needed.

A base that turns at phi' holds a mechanism of linear momentum p, which moves on it, with the force -2 phi' x p besides
(Coriolis). phi' is the integral of what A determines of phi'', and, of what it leaves open, of what the forces show by
their lever from it. The turning that neither shows, about the line from one accelerometer to the mechanism's centre of
mass, gives no force along that line.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.closure import Trajectory
from balance.dynamics.moving_base import displacement_at, skew
from balance.dynamics.regressor import first_moment
from balance.mechanism.forward_kinematics import poses
from balance.mechanism.loop_constraints import Anchor
from balance.mechanism.mechanism import Mechanism

from ..rig import Column
from ..runs.si_run import SIRun
from .encoder_motion import rest_before

NEAR = 1e-3
"""Lever below which the base's rotation is not taken out [m]."""
RATE_LEVER = 0.02
"""Lever below which forces, or accelerometers by their difference, do not tell how fast the base turns [m]."""
_APART = 0.02
"""Singular value of A, relative to the largest, below which accelerometers do not tell the base's motion."""
_ROUNDED = 1e-9
"""Turning of the base per acceleration of the mechanism that is none [rad/m]."""


@dataclass(frozen=True)
class BaseAcceleration:
    """Readings of the accelerometers on the base in one group."""

    group: str
    rows: Floats
    """A: reading of each channel per acceleration of the base, (k, 6) [-, m]."""
    time: Floats
    """On the group's clock, (m,) [s]."""
    values: Floats
    """Less their level at rest (or mean): a sensor's offset, or its share of weight, (m, k) [m/s2]."""
    columns: tuple[Column, ...]
    """The channels, (k,)."""

    @property
    def told(self) -> Floats:
        """Acceleration of the base per reading of each channel, (6, k) [-, 1/m]: it turns as readings differ, so that
        what one accelerometer shows is no turning, wherever the origin of the base frame is.
        """
        shown, turning = self.rows[:, :3], self.rows[:, 3:]
        moved = np.linalg.pinv(shown, rcond=_APART)
        left, sizes, right = np.linalg.svd(turning - shown @ moved @ turning, full_matrices=False)
        apart = sizes > RATE_LEVER
        turned = (right[apart].T / sizes[apart]) @ left[:, apart].T
        return np.vstack([moved @ (np.eye(len(shown)) - turning @ turned), turned])

    @property
    def noise(self) -> Floats:
        """Standard deviations of a sample by the rig, (k,) [m/s2]; zero where it states none."""
        return np.array([column.total_noise for column in self.columns])


def base_acceleration(run: SIRun, group: str | None = None) -> BaseAcceleration | None:
    """The accelerometers on the base in a group, else those of the group with most of their channels; None: none."""
    found = [_in_group(run, g.name) for g in run.groups if group in {None, g.name}]
    return max((f for f in found if f is not None), key=lambda f: len(f.rows), default=None)


def _in_group(run: SIRun, group: str) -> BaseAcceleration | None:
    columns = [
        (sensor.position, column)
        for name, sensor in run.rig.base_accelerometers.items()
        for column in sensor.columns(name)
        if run.holds(column, group)
    ]
    if not columns:
        return None
    rows = np.array([displacement_at(np.array(p))["xyz".index(c.component)] for p, c in columns])
    channels = tuple(c for _, c in columns)
    time, values = run.instants(channels[0]), run.stacked(channels)
    return BaseAcceleration(group, rows, time, without_rest(values, time), channels)


def without_rest(values: Floats, time: Floats) -> Floats:
    """Readings (n, k) [any unit] at instants (n,) [s], each less its level at rest, or mean: offsets and weight."""
    rate = (len(time) - 1) / (float(np.ptp(time)) or 1.0)  # one sample is its own mean
    still = (rest_before([column], rate) for column in values.T)
    level = [column[slice(None) if at is None else at].mean() for column, at in zip(values.T, still, strict=True)]
    return values - np.array(level)


def projector(rows: Floats, accelerometers: Floats) -> Floats:
    """First k rows of P, (n, k, k + j) [-], of sensor rows (n, k, 6) and accelerometer rows (j, 6) [-, m].

    Rotation at a lever below NEAR is not taken out, so that P stays smooth where the line has no direction.
    """
    count, k, _ = rows.shape
    seen = np.concatenate([rows, np.broadcast_to(accelerometers, (count, *accelerometers.shape))], axis=1)
    inner = np.einsum("nij,nik->njk", seen, seen) + NEAR**2 * np.eye(6)
    whole = np.eye(seen.shape[1]) - np.einsum("nij,njk->nik", seen, np.linalg.solve(inner, seen.transpose(0, 2, 1)))
    return np.asarray(whole[:, :k])


@dataclass(frozen=True)
class BaseRates:
    """How fast the base turns, by its accelerometers and, of what these leave open, by the forces on the supports.

    A force f that the mechanism's inertia does not explain turns the base by phi'' = G f; Coriolis forces are among
    those that turn it: phi'' = shown + G (2 phi' x p - W c).
    """

    shown: Floats
    """phi'' by the accelerometers and all the forces that were measured, (n, 3) [rad/s2]."""
    gains: Floats
    """G, of the forces, (n, 3, k) [rad/s2/N]; zero where accelerometers tell it."""
    step: float
    """[s]"""

    @classmethod
    def of(
        cls, rows: Floats, mass: float, forces: Floats, accelerometers: Floats, readings: Floats, step: float
    ) -> "BaseRates":
        """From ``rows`` S of the forces per ``mass`` [kg], ``forces`` (n, k) [N], A and ``readings`` (n, j) [m/s2]."""
        sizes, motions = np.linalg.svd(accelerometers)[1:]
        open_to = motions[int(np.count_nonzero(sizes > _APART * sizes[0])) :].T
        levers = rows @ open_to
        inner = np.einsum("nki,nkj->nij", levers, levers) + RATE_LEVER**2 * np.eye(open_to.shape[1])
        gains = open_to[3:] @ np.linalg.solve(inner, levers.transpose(0, 2, 1)) / mass
        gains[np.abs(gains) < _ROUNDED / mass] = 0.0
        told = readings @ np.linalg.pinv(accelerometers, rcond=_APART).T
        beside = forces - mass * np.einsum("nkm,nm->nk", rows, told)
        return cls(told[:, 3:] + np.einsum("nik,nk->ni", gains, beside), gains, step)

    @property
    def by_forces(self) -> bool:
        """Whether forces tell part of it."""
        return bool(self.gains.any())

    def rates(self, turning: Floats, momentum: Floats, axes: Sequence[int]) -> Floats:
        """phi' from rest, of ``turning`` phi'' (n, 3, p) [rad/s2, or per parameter] beside what Coriolis forces make.

        Those along ``axes``, which were measured, of the mechanism's ``momentum`` (n, 3) [kg m/s]; (n, 3, p).
        """
        half = 0.5 * self.step
        pushed, found = half * (turning[1:] + turning[:-1]), np.zeros_like(turning)
        if not self.by_forces:
            np.cumsum(pushed, axis=0, out=found[1:])
            return found
        slowed = 2.0 * half * self.gains @ skew(momentum)[:, axes]
        after = np.linalg.inv(np.eye(3) + slowed[1:])
        carried, pushed = after @ (np.eye(3) - slowed[:-1]), after @ pushed
        for i, one in enumerate(carried):  # trapezoidal
            found[i + 1] = one @ found[i] + pushed[i]
        return found


def coriolis_force(rates: Floats, momentum: Floats) -> Floats:
    """-2 phi' x p on the base, (n, 3, p) [N]: of rates (n, 3, 1 or p) [rad/s], momentum (n, 3, 1 or p) [kg m/s]."""
    return -2.0 * np.cross(rates, momentum, axis=1)


def sensor_rows(mechanism: Mechanism, path: Trajectory, sensor: Anchor, axes: Iterable[str]) -> Floats:
    """S of an accelerometer on a moving body: reading of each axis per acceleration of the base, (n, k, 6) [-, m]."""
    at = poses(mechanism.tree, path.q)
    point, turned = at.point(sensor.joint, sensor.position), at.rotation[:, sensor.joint] @ sensor.rotation
    units = [turned[:, :, "xyz".index(axis)] for axis in axes]
    return np.stack([np.hstack([unit, np.cross(point, unit)]) for unit in units], axis=1)


def force_rows(mechanism: Mechanism, path: Trajectory) -> Floats:
    """S of the force on the supports per mechanism mass, -(u'' + phi'' x c), base axes, (n, 3, 6) [-, m]."""
    centre = mass_centre(mechanism, path)
    return np.stack(
        [-np.hstack([np.tile(unit, (len(centre), 1)), np.cross(centre, unit)]) for unit in np.eye(3)], axis=1
    )


def mass_centre(mechanism: Mechanism, path: Trajectory) -> Floats:
    """Centre of mass of all moving bodies in the base frame, (n, 3) [m]."""
    return first_moment(mechanism, path.q) / mechanism.total_mass
