"""Regression of the measured forces, and of the motor torques, of a run on the balance conditions.

Forces, both sides low-passed alike: P (F + 2 phi' x p) + m P a = P W_F C^+ c (see ``shaking_wrench``), with the
momentum p = W_p C^+ c on a base that turns at phi'. What of phi' is seen by the forces depends on c as well: the
equations are those of first order about values of c. What of the first moment differs from the file's is held as well,
-phi'' x H (c - c_file), and m is an unknown near the file's. Offsets and slow drifts of each row, and small errors of
the clocks (a delay of the forces, one of the accelerations), are nuisances. A change of m multiplies the noise of a,
which stands in P m a as well: least squares would make m smaller, and the noise with it. Its instrument is what of a
the shaking wrench by the file and a itself, at instants before and after, explain.

Torques, in which gravity turns the first moments and inertia shakes them: of W pi of the driven joints, loops closed,
pi = C^+ c + N z with the conditions C pi = c and N what they leave free. A base that accelerometers show to move is the
root that moves (``loads.base_motion_in_torque``). The columns of c are W C^+; z (inertias, and what of the first
moments balances), friction and the drives' own inertia are nuisances, the same in all runs, offsets, drifts and delays
of the torques run by run.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from balance.arrays import Floats
from balance.balancing.conditions import Conditions
from balance.dynamics.inverse_dynamics import simulate
from balance.dynamics.regressor import (
    driven_torque_regressor,
    first_moment,
    joint_friction_regressor,
    momentum_regressor,
    wrench_regressor,
)
from balance.estimation.first_moment_imbalance import condition_columns, with_condition_values

from ..errors import AnalysisError
from ..kinematics.base_motion import BaseRates, coriolis_force
from ..kinematics.gaps import ValidSamples, true_segments
from ..kinematics.smoothing_and_derivatives import DRY_PART, rest_speeds
from ..loads.base_motion_in_torque import known_base, root_motion
from ..loads.shaking_wrench import COMPONENTS, NOTHING, MeasuredLoads, measured_loads
from ..rig import Column
from ..rig.sensors import Torque
from ..runs.aligned_run import AlignedRun
from .problem import MASS, Entry, RunEquations, motion_name, offset_and_drift, parameter_basis, refuse_no_motion
from .sensor_errors import force_effects, reading_effects, stated_deviations

MARGIN_PERIODS = 3.0
"""Periods of the cut-off kept before and after the motion."""
CUTOFF_HZ = 40.0
"""Of forces and columns alike: most of what the moves excite lies below, and encoders tell accelerations there."""
POSITION_BANDWIDTH = 2.0
"""Cut-off of the positions, in cut-offs of the forces."""
_WRENCH_AT, _READ_AT = (-2, -1, 0, 1, 2), (-4, -3, -2, 2, 3, 4)
"""Half periods of the cut-off after an instant, from which the base's acceleration at that instant is explained: of the
wrench and of the readings, whose noise below the cut-off is another from a whole period on.
"""
LEAST_MOTION = 1e-2
"""Force of a first moment of 1 kg m below which nothing moves [1/s2]."""


class _TurningBase:
    """What forces show of a mechanism on a base that turns, to first order about values of the conditions."""

    def __init__(self, loads: MeasuredLoads, columns: Floats, momentum: Floats, values: Floats) -> None:
        """Columns of force and momentum per condition, (n, 3, rank) each, about ``values`` (rank,) [kg m]."""
        self.loads, self.axes = loads, [COMPONENTS.index(name) for name in loads.names]
        self.columns, self.readings, self.rates = columns[:, self.axes], loads.forces, loads.rates
        self.momentum = momentum @ values
        if self.rates is None:
            return
        own = self._seen(self.rates, self.columns)
        made = own @ values
        turning = self.rates.rates(self.rates.shown[:, :, None], self.momentum, self.axes)[..., 0] - made
        self.columns = self.columns + coriolis_force(turning[..., None], momentum)[:, self.axes] - self._held(own)
        self.readings = self.readings - self._held(made[..., None])[..., 0]

    @property
    def by_forces(self) -> bool:
        """Whether the forces, and so the values, tell how fast the base turns."""
        return self.rates is not None and self.rates.by_forces

    def hold(self, rates: BaseRates, first_moments: Floats, by_file: Floats) -> None:
        """Count what the turning base holds of ``first_moments`` (n, 3, rank) [-] by which values differ from the
        file's (rank,) [kg m]; those of the file are in P.
        """
        held = -np.cross(rates.shown[:, :, None], first_moments, axis=1)[:, self.axes]
        self.columns, self.readings = self.columns + held, self.readings + held @ by_file

    def _seen(self, rates: BaseRates, forces: Floats) -> Floats:
        """Rates of the base that forces (n, k, p) [N, or per parameter] seem to show, (n, 3, p) [rad/s]."""
        return rates.rates(rates.gains @ forces, self.momentum, self.axes)

    def _held(self, rates: Floats) -> Floats:
        """Coriolis force of rates (n, 3, p), (n, k, p) [N]."""
        return coriolis_force(rates, self.momentum[:, :, None])[:, self.axes]

    def projected(self, forces: Floats) -> Floats:
        """A change of the forces (n, k) [N], with that of the rates that they show, behind P."""
        if self.rates is not None and self.rates.by_forces:
            forces = forces - self._held(self._seen(self.rates, forces[:, :, None]))[..., 0]
        return self.loads.projected(forces)

    def wander(self, valid: ValidSamples) -> Floats:
        """Of rates that are integrals: offset and drift between gaps, (n, k, few) [N]; none where the base rests."""
        found = [np.zeros((*self.readings.shape, 0))]
        if self.rates is not None:
            for part in true_segments(valid.kept > 0.0):
                rates = np.zeros((len(valid.kept), 3, 6))
                rates[part] = offset_and_drift(np.ones(part.stop - part.start), 3)
                found.append(self._held(rates))
        every = np.concatenate(found, axis=2)
        size = np.abs(every).max(axis=(0, 1), initial=0.0)
        return self.loads.projected(every[:, :, size > NOTHING * size.max(initial=0.0)])


def _first_moments(run: AlignedRun, conditions: Conditions, q: Floats) -> Floats:
    """First moment of the mechanism at positions q (n, joints) per value of each condition, (n, 3, rank) [-]."""
    by_file, before = conditions.values(run.mechanism), first_moment(run.mechanism, q)
    each = [with_condition_values(conditions, run.mechanism, by_file + unit) for unit in np.eye(conditions.rank)]
    return np.stack([first_moment(one, q) - before for one in each], axis=2)


def force_regression(
    run: AlignedRun, conditions: Conditions, cutoff: float = CUTOFF_HZ, values: Floats | None = None
) -> RunEquations:
    """The equations of a run, to first order about ``values`` (rank,) [kg m] of the conditions, or those of the file.

    Raises AnalysisError without force channels, with sensors at the end of their range, no motion, clocks that cannot
    be aligned, gaps that leave nothing.
    """
    bandwidth = POSITION_BANDWIDTH * cutoff
    path = run.trajectory(bandwidth)
    columns = condition_columns(conditions, wrench_regressor(run.mechanism, path.q, path.v, path.a)[:, :3])
    if not np.abs(columns).max() > LEAST_MOTION:
        raise AnalysisError(f"{run.name}: no motion: the encoders stand still, so that the record tells nothing")
    loads, _ = measured_loads(run, columns, bandwidth)
    axes = [COMPONENTS.index(name) for name in loads.names]
    valid = run.valid_samples(bandwidth, loads.groups)
    refuse_no_motion(valid, path)
    momentum = condition_columns(conditions, momentum_regressor(run.mechanism, path.q, path.v)[:, :3])
    about = conditions.values(run.mechanism) if values is None else values
    turning = _TurningBase(loads, columns, momentum, about)
    if loads.rates is not None:
        turning.hold(loads.rates, _first_moments(run, conditions, path.q), conditions.values(run.mechanism))
    nuisance = [turning.projected(valid.rates(loads.forces))]
    deviations = stated_deviations(run.run)
    effects = {entry: turning.projected(change) for entry, change in force_effects(run, deviations, axes).items()}
    held, explained = loads.projected(turning.readings), dict[Entry, Floats]()
    used = run.motion_span(bandwidth, MARGIN_PERIODS / cutoff)
    if run.base is not None and loads.inertial is not None:
        held = held + loads.base_projected(loads.inertial)
        nuisance.append(loads.base_projected(valid.rates(loads.inertial)))
        for found, inertial in (effects, loads.inertial), (explained, _explained(run, valid, loads.inertial, cutoff)):
            of_base = reading_effects(inertial, run.base.columns, deviations)
            found |= {entry: loads.base_projected(change) for entry, change in of_base.items()}
            found[MASS] = -loads.base_projected(inertial)
    own, whole, wander, *delays = (
        valid.low_pass(v, cutoff) for v in (loads.projected(turning.columns), held, turning.wander(valid), *nuisance)
    )
    own, readings, wander, *delays = (values[used] for values in (own, whole, wander, *delays))
    before = slice(round(MARGIN_PERIODS / (cutoff * run.grid.step)), used.start)
    kept = valid.kept[used]
    slow = [offset_and_drift(kept, len(axes)), wander]
    equations = RunEquations.of(
        valid,
        cutoff,
        own,
        readings,
        np.concatenate([*slow, *(delay[:, :, None] for delay in delays)], axis=2),
        kept[:, None],
        motion_name(run),
        loads.names,
        conditions.rank,
        {entry: valid.low_pass(change, cutoff)[used] for entry, change in effects.items()},
        None if valid.gaps else whole[before],
    )
    explained = {entry: change[used] for entry, change in explained.items()}
    return replace(equations, about_values=turning.by_forces, explained=explained)


def _explained(run: AlignedRun, valid: ValidSamples, inertial: Floats, cutoff: float) -> Floats:
    """What of ``inertial`` (n, channels) [N] is explained below a cut-off [Hz] without its noise at that instant.

    By the shaking wrench by the file about that instant, and by ``inertial`` so long before and after that noise below
    the cut-off is another.
    """
    response = simulate(run.mechanism, run.trajectory(POSITION_BANDWIDTH * cutoff))
    made = np.hstack([response.force, response.moment])
    made, shown = (valid.low_pass(values, cutoff) * valid.kept[:, None] for values in (made, inertial))
    count, step = len(made), round(0.5 / (cutoff * run.grid.step))

    def around(values: Floats, halves: Sequence[int]) -> Floats:
        place = np.arange(count)[:, None] + step * np.array(halves)
        return values[np.clip(place, 0, count - 1)].reshape(count, -1)

    causes = np.hstack([around(made, _WRENCH_AT), around(shown, _READ_AT)])
    size = np.sqrt(np.mean(causes**2, axis=0))
    used = size > NOTHING * size.max()
    causes = causes[:, used] / size[used]
    return np.asarray(causes @ np.linalg.lstsq(causes, shown, rcond=None)[0])


TORQUE_CUTOFF_HZ = 20.0
"""Of torques and columns alike: gravity speaks below, and above the encoders' steps are taken for inertia."""
TORQUE_POSITION_BANDWIDTH = 4.0
"""Cut-off of the positions, in cut-offs of the torques: inertia of many N m must be known to a thousandth."""


def torque_regression(run: AlignedRun, conditions: Conditions, cutoff: float) -> RunEquations:
    """The equations of a run.

    Raises AnalysisError where a joint has no torque or encoder, a sensor is clipped, or gaps leave nothing.
    """
    model, bandwidth = run.mechanism, TORQUE_POSITION_BANDWIDTH * cutoff
    channels = torque_channels(run)
    groups = run.run.groups_of(channels)
    if len(groups) > 1:
        raise AnalysisError(f"{run.name}: its motor torques are on several loggers, {', '.join(groups)}")
    path, base, root = run.trajectory(bandwidth), known_base(run), root_motion(run)
    valid = run.valid_samples(bandwidth, [*groups, *([base.group] if base else [])])
    refuse_no_motion(valid, path)
    torque = run.channels(channels)
    places = [model.coordinate_index(joint) for joint in model.driven]
    seen = [column.component for column in run.encoders]
    if sorted(seen) != sorted(model.driven):
        raise AnalysisError(
            f"{run.name}: encoders on {', '.join(seen)}, motors on {', '.join(model.driven)}: expected the same joints"
        )
    speed = path.v[:, places]
    readings = run.channels([run.encoders[seen.index(joint)] for joint in model.driven])
    turning = [model.drive_unit(joint) != "N" for joint in model.driven]
    rest = rest_speeds([(readings, speed)], bandwidth, turning)
    moving = np.abs(speed) > rest
    if not moving.any():
        raise AnalysisError(
            f"{run.name}: no motion: every driven joint rests, but for steps and noise of its readings, so that its "
            "torque is friction alone"
        )
    terms, _ = joint_friction_regressor(model.driven, speed, path.a[:, places], DRY_PART * rest)
    joints = len(places)
    friction = terms.reshape(len(terms), joints, joints, 4)[..., [0, 1, 3]].reshape(len(terms), joints, -1)
    rates = path.per_drive[:, :, [seen.index(joint) for joint in model.driven]]
    bodies = driven_torque_regressor(model, path.q, path.v, path.a, rates, root)
    whole = np.concatenate(
        [bodies @ parameter_basis(conditions), friction, torque[:, :, None], valid.rates(torque)[:, :, None]], axis=2
    )
    used = run.motion_span(bandwidth, MARGIN_PERIODS / cutoff)
    moves = moving[:, :, None]
    smooth = (valid.low_pass(whole, cutoff) * moves)[used]
    counts = (moves * valid.kept[:, None, None])[used]
    return RunEquations.of(
        valid,
        cutoff,
        smooth[:, :, :-2],
        smooth[:, :, -2],
        np.concatenate([offset_and_drift(valid.kept[used], joints) * moves[used], smooth[:, :, -1:]], axis=2),
        counts[:, :, 0].astype(float),
        motion_name(run),
        model.driven,
        conditions.rank,
    )


def torque_channels(run: AlignedRun) -> list[Column]:
    """The torque channel of every driven joint. Raises AnalysisError for a joint that has none, or one at its limit."""
    known = {column.component: column for column in run.rig.columns_of(Torque)}
    driven = run.mechanism.driven
    if lacking := [joint for joint in driven if joint not in known]:
        raise AnalysisError(
            f"{run.name}: its rig has no motor torque of joint {lacking[0]}: the torques of all driven joints, "
            f"{', '.join(driven)}, are needed"
        )
    columns = [known[joint] for joint in driven]
    for column in columns:
        if column.range is not None and (at := run.run.at_range(column)).any():
            raise AnalysisError(
                f"{run.name}: {column.channel}: {int(at.sum())} samples at the end of its range of "
                f"{column.range:g} (SI): a clipped torque cannot tell what is missing; use gentler runs"
            )
    return columns
