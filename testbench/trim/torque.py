"""What the motor torques of runs say of the balance conditions: gravity turns the first moments, inertia shakes them.

Of the torques W pi of the driven joints, loops closed, pi = C^+ c + N z with the conditions C pi = c and N what they
leave free: the columns of c are W C^+; z (inertias, and what of the first moments balances), friction and the
drives' own inertia are fitted beside, the same in all runs, offsets and delays of the torques run by run.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import null_space

from balance.arrays import Floats
from balance.conditions import Conditions
from balance.dynamics.joint_friction import joint_terms
from balance.dynamics.regressor import driven_torque_regressor
from balance.mechanism import Mechanism

from ..errors import AnalysisError
from ..rig.sensors import Torque
from ..runs.aligned_run import AlignedRun
from ..runs.si_run import SIRun
from .evidence import motion_of
from .parts import Part
from .sound import Sound

if TYPE_CHECKING:
    from balance.closure import Trajectory

    from ..rig import Column

CUTOFF_HZ = 20.0
"""Of torques and columns alike: gravity speaks below, and above the encoders' steps are taken for inertia."""
POSITION_BANDWIDTH = 4.0
"""Cut-off of the positions, in cut-offs of the torques: inertia of many N m must be told to a thousandth."""
REST_SPEED = 0.1
"""A joint slower than this is at rest, where dry friction may hold any torque: it says nothing [rad/s, m/s]."""
MARGIN_PERIODS = 3.0
"""Periods of the cut-off kept before and after the motion."""


def torque_part(run: AlignedRun, conditions: Conditions, cutoff: float) -> Part:
    """The equations of a run. Raises AnalysisError where a joint has no torque or encoder, or gaps leave nothing."""
    model, bandwidth = run.mechanism, POSITION_BANDWIDTH * cutoff
    channels, path = torque_channels(run.run, model), run.trajectory(bandwidth)
    sound = Sound.of(run, bandwidth, {_group(run.run, channels)})
    sound.refuse_nothing(path)
    torque = run.channels(channels)
    own, beside = _columns(model, conditions, path, _driven_rates(run, path))
    places = [model.coordinate_index(joint) for joint in model.driven]
    speed = path.v[:, places]
    terms, _ = joint_terms(model.driven, speed, path.a[:, places])
    joints = len(places)
    friction = terms.reshape(len(terms), joints, joints, 4)[..., [0, 1, 3]].reshape(len(terms), joints, -1)
    beside = np.concatenate([beside, friction], axis=2)
    sizes = [own.shape[2], beside.shape[2], 1, 1]
    whole = np.concatenate([own, beside, torque[:, :, None], sound.rate_of(torque)[:, :, None]], axis=2)
    used = run.motion_span(bandwidth, MARGIN_PERIODS / cutoff)
    moving = (np.abs(speed) > REST_SPEED)[:, :, None]
    smooth = (sound.low_pass(whole, cutoff) * moving)[used]
    own, beside, seen, delay = np.split(smooth, np.cumsum(sizes)[:-1], axis=2)
    offset = np.eye(joints)[None] * (moving * sound.kept[:, None, None])[used]
    nuisance = np.concatenate([offset, delay], axis=2)
    shortest, findings = 1.0 / (cutoff * run.grid.step), sound.findings
    every = offset.max(axis=2)
    return Part(own, beside, seen[:, :, 0], nuisance, every, model.driven, shortest, motion_of(run), findings)


def _driven_rates(run: AlignedRun, path: "Trajectory") -> Floats:
    """Rates of all coordinates per rate of the driven joints, (n, nv, dof). Raises AnalysisError without encoders."""
    model, seen = run.mechanism, [column.component for column in run.encoders]
    if sorted(seen) != sorted(model.driven):
        raise AnalysisError(
            f"{run.name}: encoders on {', '.join(seen)}, motors on {', '.join(model.driven)}: expected the same joints"
        )
    return path.per_drive[:, :, [seen.index(joint) for joint in model.driven]]


def _columns(model: Mechanism, conditions: Conditions, path: "Trajectory", rates: Floats) -> tuple[Floats, Floats]:
    """W C^+ and W N, (n, joints, rank) and (n, joints, 10 nb - rank)."""
    whole = driven_torque_regressor(model, path.q, path.v, path.a, rates)
    return whole @ np.linalg.pinv(conditions.matrix), whole @ null_space(conditions.matrix)


def torque_channels(run: SIRun, model: Mechanism) -> "list[Column]":
    """The torque channel of every driven joint. Raises AnalysisError for a joint that has none, or one at its limit."""
    known = {column.component: column for column in run.rig.columns_of(Torque)}
    if lacking := [joint for joint in model.driven if joint not in known]:
        raise AnalysisError(
            f"{run.name}: its rig has no motor torque of joint {lacking[0]}: the torques of all driven joints, "
            f"{', '.join(model.driven)}, are needed"
        )
    columns = [known[joint] for joint in model.driven]
    for column in columns:
        if column.range is not None and (at := run.at_range(column)).any():
            raise AnalysisError(
                f"{run.name}: {column.channel}: {int(at.sum())} samples at the end of its range of "
                f"{column.range:g} (SI): a clipped torque cannot tell what is missing; use gentler runs"
            )
    return columns


def _group(run: SIRun, columns: "Sequence[Column]") -> str:
    groups = run.groups_of(columns)
    if len(groups) > 1:
        raise AnalysisError(f"{run.name}: its motor torques are on several loggers, {', '.join(groups)}")
    return groups[0]
