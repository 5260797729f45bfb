"""What the motor torques of runs say of the balance conditions: gravity turns the first moments, inertia shakes them.

Of the torques W pi of the driven joints, loops closed, pi = C^+ c + N z with the conditions C pi = c and N what they
leave free: the columns of c are W C^+; z (inertias, and what of the first moments balances), friction and the
drives' own inertia are nuisances, the same in all runs, offsets, drifts and delays of the torques run by run.
"""

import numpy as np

from balance.arrays import Floats
from balance.balancing.conditions import Conditions
from balance.closure import Trajectory
from balance.dynamics.regressor import driven_torque_regressor, joint_friction_regressor

from ..errors import AnalysisError
from ..rig import Column
from ..rig.sensors import Torque
from ..runs.aligned_run import AlignedRun
from .problem import RunEquations, ValidSamples, motion_name, offset_and_drift, parameter_basis

CUTOFF_HZ = 20.0
"""Of torques and columns alike: gravity speaks below, and above the encoders' steps are taken for inertia."""
POSITION_BANDWIDTH = 4.0
"""Cut-off of the positions, in cut-offs of the torques: inertia of many N m must be known to a thousandth."""
REST_SPEED = 0.1
"""A joint slower than this is at rest, where dry friction may hold any torque: it says nothing [rad/s, m/s]."""
MARGIN_PERIODS = 3.0
"""Periods of the cut-off kept before and after the motion."""


def torque_regression(run: AlignedRun, conditions: Conditions, cutoff: float) -> RunEquations:
    """The equations of a run. Raises AnalysisError where a joint has no torque or encoder, or gaps leave nothing."""
    model, bandwidth = run.mechanism, POSITION_BANDWIDTH * cutoff
    channels = torque_channels(run)
    groups = run.run.groups_of(channels)
    if len(groups) > 1:
        raise AnalysisError(f"{run.name}: its motor torques are on several loggers, {', '.join(groups)}")
    path = run.trajectory(bandwidth)
    valid = ValidSamples.of(run, groups, bandwidth)
    valid.refuse_no_motion(path)
    torque = run.channels(channels)
    places = [model.coordinate_index(joint) for joint in model.driven]
    speed = path.v[:, places]
    terms, _ = joint_friction_regressor(model.driven, speed, path.a[:, places])
    joints = len(places)
    friction = terms.reshape(len(terms), joints, joints, 4)[..., [0, 1, 3]].reshape(len(terms), joints, -1)
    bodies = driven_torque_regressor(model, path.q, path.v, path.a, _driven_rates(run, path))
    whole = np.concatenate(
        [bodies @ parameter_basis(conditions), friction, torque[:, :, None], valid.rates(torque)[:, :, None]], axis=2
    )
    used = run.motion_span(bandwidth, MARGIN_PERIODS / cutoff)
    moving = (np.abs(speed) > REST_SPEED)[:, :, None]
    smooth = (valid.low_pass(whole, cutoff) * moving)[used]
    counts = (moving * valid.kept[:, None, None])[used]
    return RunEquations.of(
        valid,
        1.0 / (cutoff * run.grid.step),
        smooth[:, :, :-2],
        smooth[:, :, -2],
        np.concatenate([offset_and_drift(valid.kept[used], joints) * moving[used], smooth[:, :, -1:]], axis=2),
        counts[:, :, 0].astype(float),
        motion_name(run),
        model.driven,
        conditions.rank,
    )


def _driven_rates(run: AlignedRun, path: Trajectory) -> Floats:
    """Rates of all coordinates per rate of the driven joints, (n, nv, dof). Raises AnalysisError without encoders."""
    seen, driven = [column.component for column in run.encoders], run.mechanism.driven
    if sorted(seen) != sorted(driven):
        raise AnalysisError(
            f"{run.name}: encoders on {', '.join(seen)}, motors on {', '.join(driven)}: expected the same joints"
        )
    return path.per_drive[:, :, [seen.index(joint) for joint in driven]]


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
