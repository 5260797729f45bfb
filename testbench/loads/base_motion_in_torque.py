"""The base's motion in the torques of the drives: the root that moves (``driven_torque_regressor``)."""

from contextlib import suppress

import numpy as np

from balance.arrays import Floats
from balance.dynamics.inverse_dynamics import simulate
from balance.dynamics.moving_base import apparent_gravity, locked_inertia
from balance.dynamics.regressor import momentum_regressor
from balance.errors import CounterpoiseError

from ..kinematics.base_motion import BaseAcceleration
from ..runs.aligned_run import AlignedRun
from .shaking_wrench import refuse_clipped_base


def moves_on_base(run: AlignedRun) -> bool:
    """Whether the mechanism moves on the base as bodies do; a simulation may hold its inertia."""
    return run.run.origin != "simulated" or run.rig.bench.coupling == "moving"


def known_base(run: AlignedRun) -> BaseAcceleration | None:
    """What the accelerometers on the base read of a motion that drives feel; None where none is, or no clock relates
    them. Raises AnalysisError where one is clipped: the base moves, and how is not known.
    """
    if not moves_on_base(run) or run.base is None:
        return None
    refuse_clipped_base(run.run)
    with suppress(CounterpoiseError):
        return run.base if run.clock(run.base.group) else None
    return None


def root_motion(run: AlignedRun) -> Floats | None:
    """Of the base, as ``torque_regressor`` has it, on the run's grid, (n, 9) [rad/s, m/s2, rad/s2]; None: not known."""
    if (base := known_base(run)) is None:
        return None
    told = run.on_grid(base.group, base.time, base.values) @ base.told.T
    turning = np.cumsum(told[:, 3:], axis=0) * run.grid.step
    slow = np.vander(np.linspace(-1.0, 1.0, len(told)), 2)  # it rests before and after: a drift is the sensors'
    return np.hstack([turning - slow @ np.linalg.lstsq(slow, turning, rcond=None)[0], told])


def share_of_unseen_base(run: AlignedRun, bandwidth_hz: float) -> float:
    """Largest share of a drive's torque (rms) that the base makes by motion that no accelerometer shows [-].

    By the base that the rig states, which the mechanism shakes; zero where the rig states none, or one that rests.
    """
    if not (run.rig.bench.is_stated and moves_on_base(run)):
        return 0.0
    mechanism, path, base = run.mechanism, run.trajectory(bandwidth_hz), known_base(run)
    response = simulate(mechanism, path)
    stand = run.rig.bench.elastic(locked_inertia(mechanism, path.q[0]))
    moved = stand.respond(np.hstack([response.force, response.moment]), run.grid.step)
    moved.acceleration[:, :3] += apparent_gravity(mechanism.gravity, moved.displacement)
    unseen = moved.acceleration @ (np.eye(6) if base is None else np.eye(6) - base.told @ base.rows).T
    shares = []
    for one, torque in zip(np.moveaxis(path.per_drive, 2, 0), response.torque.values(), strict=True):
        felt = momentum_regressor(mechanism, path.q, one) @ mechanism.pi
        shares.append(float(np.linalg.norm(np.sum(felt * unseen, axis=1)) / np.linalg.norm(torque)))
    return max(shares)
