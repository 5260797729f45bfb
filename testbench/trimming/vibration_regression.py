"""What the vibration of the base says of the balance conditions, through the base that the rig states.

M x'' + C x' + K x = W pi, with the base on its mounts and the mechanism's inertia locked onto it: the response to each
column of W is computed, and the readings of the accelerometers on the base are least squares of it. As with torque,
pi = C^+ c + N z: what does not shake with a force, but turns the base, is a nuisance, the same in all runs. How the
base was pushed in a gap is unknown: how it rings after one is a nuisance of the run.

Where the rig states ``weight``, W holds its moment as the first moment s of mass moves, (s - s0) x g, K the weight and
the mounts' preload, and accelerometers show a + phi x g. Where c is zero s rests: no further unknowns.

What the encoders' resolution leaves open in what the base's vibration says: no block of a record shows it.

The readings r of an encoder move the columns, A(r) x = y, so that dx = -A^+ dA x: the gain of the least squares times
the readings of a wrench that changes by dw = w_q dq + w_v dv + w_a da with the driven coordinates. That sum is taken
from its end (adjoint): base and low-pass answer backwards in time as they do forwards, for M, C, K are symmetric, and
the tilt phi x g in a reading answers by the displacement under moments g x f. What remains is by how much each value
moves per reading, and so its covariance, for a reading is as good as q^2 / 12.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from balance.arrays import Floats
from balance.balancing.conditions import Conditions
from balance.closure import Closure, Trajectory
from balance.dynamics.moving_base import (
    BaseMotion,
    ElasticBase,
    apparent_gravity,
    gravity_in_tilted_axes,
    locked_inertia,
    skew,
)
from balance.dynamics.regressor import first_moment_regressor, wrench_regressor
from balance.mechanism.mechanism import Mechanism
from balance.motion import Samples

from ..errors import AnalysisError
from ..kinematics import base_motion
from ..kinematics.gaps import ValidSamples
from ..kinematics.smoothing_and_derivatives import Grid, smoothed_derivatives
from ..loads.shaking_wrench import refuse_clipped_base
from ..rig import Column
from ..runs.aligned_run import AlignedRun
from .problem import (
    RunEquations,
    excited_combinations,
    motion_name,
    offset_and_drift,
    parameter_basis,
    refuse_no_motion,
)

POSITION_BANDWIDTH = 4.0
"""Cut-off of the positions, in cut-offs of the readings: the moment, far larger, must be known to a thousandth."""
RINGING_S = 0.25
"""How long the base's ringing after the motion counts [s]."""
IMPULSES = 3
"""Instants of a gap at which pushes stand for all that may have pushed."""
LEAST_SHARE = 1e-6
"""Ringings of the base that differ by less, relative to the strongest, are one."""


@dataclass(frozen=True)
class ShakenBase:
    """One run: what moved, the base that answers, and what its accelerometers showed."""

    model: Mechanism
    """As mounted."""
    grid: Grid
    path: Trajectory
    base: ElasticBase
    """With the mechanism's inertia locked onto it."""
    gravity: Floats
    """In the axes of the base at rest, (3,) [m/s2]; zero where the rig does not state ``weight``."""
    sensors: base_motion.BaseAcceleration
    readings: Floats
    """Readings on the grid, (n, channels) [m/s2]."""
    used: slice
    """The samples that count."""
    cutoff: float
    """[Hz]"""
    motion: str
    valid: ValidSamples

    def smooth(self, values: Floats) -> Floats:
        """Values (n, channels, k) low-passed, on the samples that count; zero where gaps touch them."""
        return self.valid.low_pass(values, self.cutoff)[self.used]

    def wrench_regressor(self, path: Trajectory) -> Floats:
        """W with ``W @ pi`` = shaking wrench, and the weight's less that at the start, (n, 6, 10 nb) [N, N m]."""
        columns = wrench_regressor(self.model, path.q, path.v, path.a)
        if self.gravity.any():
            start, first = (first_moment_regressor(self.model, q) for q in (self.path.q[:1], path.q))
            columns[:, 3:] -= skew(self.gravity) @ (first - start)
        return columns

    def moved(self, wrenches: Floats) -> BaseMotion:
        """Motion of the base under wrenches (n, k, 6) [N, N m], (n, k, 6) each.

        Taken for straight between samples a wave loses (omega h)^2 / 12, half a per cent of 40 Hz at 1 kHz, of what
        moves the base: a twelfth of the second difference puts that back, up to (omega h)^4 / 240. At the samples
        themselves the wrench is as it is.
        """
        bent = np.zeros_like(wrenches)
        bent[1:-1] = (wrenches[2:] - 2.0 * wrenches[1:-1] + wrenches[:-2]) / 12.0
        motion = self.base.respond(wrenches - bent, self.grid.step)
        return replace(motion, acceleration=motion.acceleration + bent @ np.linalg.inv(self.base.mass).T)

    def answers(self, columns: Floats) -> Floats:
        """What the accelerometers show of wrenches (n, 6, k) on the base, (n, channels, k) [m/s2]; none in gaps."""
        return self._shown(columns * self.valid.kept[:, None, None])

    def ringing(self) -> Floats:
        """What the accelerometers may show after gaps, low-passed, (samples that count, channels, k).

        Pushes at IMPULSES instants of a gap leave the base in any state that it may have at its end.
        """
        found = [np.zeros((self.used.stop - self.used.start, len(self.sensors.rows), 0))]
        for gap in self.valid.left_out:
            pushes = np.zeros((self.grid.count, 6, 6 * IMPULSES))
            for k, i in enumerate(np.linspace(gap.start, gap.stop - 1, IMPULSES).astype(int)):
                pushes[i, :, 6 * k : 6 * k + 6] = np.eye(6)
            shown = self.smooth(self._shown(pushes))
            if shown.any():
                found.append(shown @ excited_combinations([shown], LEAST_SHARE))
        return np.concatenate(found, axis=2)

    def _shown(self, columns: Floats) -> Floats:
        pushed = np.flatnonzero(columns.any(axis=(0, 1)))
        found = np.zeros((len(columns), len(self.sensors.rows), columns.shape[2]))
        wrenches = np.ascontiguousarray(np.moveaxis(columns[:, :, pushed], 1, 2))
        motion = self.moved(wrenches)
        motion.acceleration[..., :3] += apparent_gravity(self.gravity, motion.displacement)
        found[:, :, pushed] = np.moveaxis(motion.acceleration @ self.sensors.rows.T, 1, 2)
        return found


def vibration_regression(run: ShakenBase, conditions: Conditions) -> RunEquations:
    """The equations of a run."""
    columns = run.wrench_regressor(run.path) @ parameter_basis(conditions)
    made = run.answers(columns)
    rate = run.valid.rates(run.readings)
    smooth = run.smooth(np.concatenate([made, run.readings[:, :, None], rate[:, :, None]], axis=2))
    kept = run.valid.kept[run.used]
    count = run.readings.shape[1]
    before = slice(round(1.0 / (run.cutoff * run.grid.step)), run.used.start)
    rest = None if run.valid.gaps else run.valid.low_pass(run.readings, run.cutoff)[before]
    nuisance = [offset_and_drift(kept, count), np.eye(count)[None] * smooth[:, :, -1:], run.ringing()]
    return RunEquations.of(
        run.valid,
        run.cutoff,
        smooth[:, :, :-2],
        smooth[:, :, -2],
        np.concatenate(nuisance, axis=2),
        kept[:, None],
        run.motion,
        [column.channel for column in run.sensors.columns],
        conditions.rank,
        rest=rest,
    )


def shaken_base(run: AlignedRun, cutoff: float) -> ShakenBase:
    """A run and its base. Raises AnalysisError where no base is stated, no sensor is on it, or gaps leave nothing."""
    rig, name = run.rig, run.name
    if not rig.bench.is_stated:
        raise AnalysisError(
            f"{name}: its rig does not state the base (bench: mass, mounts): state it, or make runs with "
            "trial masses, by which the base's response is measured (--from trials)"
        )
    sensors = run.base
    if sensors is None:
        raise AnalysisError(f"{name}: no accelerometer on the base was recorded: nothing shows how it vibrates")
    refuse_clipped_base(run.run)
    bandwidth = POSITION_BANDWIDTH * cutoff
    path = run.trajectory(bandwidth)
    valid = run.valid_samples(bandwidth, {sensors.group})
    refuse_no_motion(valid, path)
    readings = run.on_grid(sensors.group, sensors.time, sensors.values)
    level = run.mechanism.gravity if rig.bench.weight else np.zeros(3)
    gravity = gravity_in_tilted_axes(level, np.array(rig.bench.tilt))
    base = rig.bench.elastic(locked_inertia(run.mechanism, path.q[0]), gravity)
    used = run.motion_span(bandwidth, RINGING_S)
    model, motion = run.mechanism, motion_name(run)
    return ShakenBase(model, run.grid, path, base, gravity, sensors, readings, used, cutoff, motion, valid)


DIFFERENCE = 1e-4
"""Of driven positions and speeds, for derivatives of the wrench [rad, rad/s, m, m/s]."""


def step_covariance(run: ShakenBase, encoders: Sequence[Column], gain: Floats, pi: Floats) -> Floats:
    """Of the conditions' values, (rank, rank) [kg2 m2], from what one run's encoders leave open.

    ``gain`` is what the values rise by per reading that counts, (n, channels, rank); ``pi`` the parameters found.
    """
    moves = per_reading(run, [column.component for column in encoders], gain, pi)
    variances = np.array([column.resolution**2 / 12.0 + column.noise**2 for column in encoders])
    return np.asarray(np.einsum("j,njk,njl->kl", variances, moves, moves))


def step_readings(run: ShakenBase, encoders: Sequence[Column], pi: Floats) -> Floats:
    """What the model shows of the encoders' steps and noise, drawn once as white noise of their variance, (samples that
    count, channels) [m/s2].
    """
    deviations = np.array([column.total_noise for column in encoders])
    if not deviations.any():
        return np.zeros((run.used.stop - run.used.start, len(run.sensors.rows)))
    drawn = deviations * np.random.default_rng(0).normal(size=(run.grid.count, len(encoders)))
    moved = smoothed_derivatives(drawn, POSITION_BANDWIDTH * run.cutoff, run.grid.rate)
    slopes = wrench_slopes(run, [column.component for column in encoders], pi)
    wrench = sum(np.einsum("nij,nj->ni", *pair) for pair in zip(slopes, (moved.q, moved.v, moved.a), strict=True))
    return run.smooth(run.answers(np.asarray(wrench)[:, :, None]))[..., 0]


def per_reading(run: ShakenBase, joints: Sequence[str], gain: Floats, pi: Floats) -> Floats:
    """What the values rise by per unit of each encoder's reading, (n, joints, rank) [kg m / rad or m]."""
    weight = backwards(run, gain)
    by_place, by_speed, by_rate = (np.einsum("nij,nik->njk", slope, weight) for slope in wrench_slopes(run, joints, pi))
    bandwidth, rate = POSITION_BANDWIDTH * run.cutoff, run.grid.rate
    flat = [smoothed_derivatives(b.reshape(len(b), -1), bandwidth, rate) for b in (by_place, by_speed, by_rate)]
    return np.asarray((flat[0].q - flat[1].v + flat[2].a).reshape(by_place.shape))


def backwards(run: ShakenBase, gain: Floats) -> Floats:
    """What the values rise by per wrench on the base, (n, 6, rank)."""
    whole = np.zeros((run.grid.count, *gain.shape[1:]))
    whole[run.used] = gain
    smooth = run.valid.low_pass(whole, run.cutoff)
    pushed = np.ascontiguousarray(np.einsum("nck,ci->nki", smooth, run.sensors.rows)[::-1])
    back = run.moved(pushed).acceleration
    if run.gravity.any():
        turned = np.cross(run.gravity, pushed[..., :3])
        back = back + run.moved(np.concatenate([np.zeros_like(turned), turned], axis=2)).displacement
    return np.moveaxis(back[::-1], 1, 2) * run.valid.kept[:, None, None]


def wrench_slopes(run: ShakenBase, joints: Sequence[str], pi: Floats) -> tuple[Floats, Floats, Floats]:
    """How the wrench on the base changes with position, speed, acceleration of driven joints, (n, 6, joints) each."""
    path, closure = run.path, Closure(run.model)
    places = [run.model.coordinate_index(joint) for joint in joints]
    start = [x[:, places] for x in (path.q, path.v, path.a)]

    def wrench(driven: Sequence[Floats]) -> Floats:
        moved = closure.follow(Samples(path.time, driven[0], driven[1], driven[2], tuple(joints)), near=path)
        return run.wrench_regressor(moved) @ pi

    still = wrench(start)

    def slope(order: int) -> Floats:
        changed = []
        for j in range(len(joints)):
            driven = [x.copy() for x in start]
            driven[order][:, j] += DIFFERENCE
            changed.append((wrench(driven) - still) / DIFFERENCE)
        return np.stack(changed, axis=2)

    return slope(0), slope(1), slope(2)
