"""Positions and torques of the driven joints of a stored run, by what its rig says, in SI on one even grid."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.mechanism import Mechanism

from .. import rig as rigs
from ..calibration.applied import readings
from ..derivatives import Grid, grid_of, on_grid
from ..errors import AnalysisError
from ..recording import Origin
from ..rig.sensors import Encoder, Torque
from ..store import Run


@dataclass(frozen=True)
class JointRecord:
    """What a run recorded of the driven joints."""

    name: str
    origin: Origin
    grid: Grid
    q: Floats
    """Positions as recorded, carried over to the grid, (n, joints) [rad, m]."""
    torque: Floats
    """Torques likewise, (n, joints) [N m, N]."""


def joint_record(run: Run, mechanism: Mechanism, rig: "rigs.Rig | None" = None) -> JointRecord:
    """Positions and torques of ``mechanism.driven`` from a run; the rig is the one stored with it unless given.

    Raises AnalysisError if the run has no rig, a driven joint no encoder or torque, or they are on several clocks.
    """
    if rig is None and run.rig is None:
        raise AnalysisError(
            f"{run.name}: stored without a rig, so nothing says which channel is which joint: "
            "ingest the log with --rig RIG"
        )
    rig = rig or rigs.load(run.rig or "")
    channels = [*_channels(run, rig, Encoder, mechanism.driven), *_channels(run, rig, Torque, mechanism.driven)]
    groups = {run.find(column.channel)[0].name for column in channels}
    if len(groups) > 1:
        raise AnalysisError(
            f"{run.name}: positions and torques are in several groups, {', '.join(sorted(groups))}: "
            "expected one clock for all of them"
        )
    time = run.time(groups.pop())
    values = np.stack([readings(run, column) for column in channels], axis=1)
    _refuse_gaps(run.name, [column.channel for column in channels], values, time)
    grid = grid_of(time, run.name)
    even = on_grid(time, values, grid)
    joints = len(mechanism.driven)
    return JointRecord(run.name, run.origin, grid, even[:, :joints], even[:, joints:])


def _channels(
    run: Run, rig: "rigs.Rig", kind: type[Encoder] | type[Torque], joints: tuple[str, ...]
) -> "list[rigs.Column]":
    """The channel of the one sensor of a kind on each joint."""
    name = kind.__name__.lower()
    columns = [column for sensor, s in rig.of_kind(kind).items() for column in s.columns(sensor)]
    found = []
    for joint in joints:
        here = [column for column in columns if column.component == joint]
        if len(here) != 1:
            known = ", ".join(column.component for column in columns) or "none"
            raise AnalysisError(
                f"{run.name}: its rig has {len(here)} sensors of kind {name!r} on joint {joint!r}, expected one; "
                f"it has them on: {known}"
            )
        found.append(here[0])
    return found


def _refuse_gaps(run: str, channels: list[str], values: Floats, time: Floats) -> None:
    lost = ~np.isfinite(values)
    if lost.any():
        sample, column = (int(i) for i in np.argwhere(lost)[0])
        raise AnalysisError(
            f"{run}: channel {channels[column]!r} holds {int(lost[:, column].sum())} samples that are no numbers, the "
            f"first at {time[sample]:.6g} s: expected none; cut the log there"
        )
