"""What the vibration of the base says of the balance conditions, through the base that the rig states.

M x'' + C x' + K x = W pi, with the base on its mounts and the mechanism's inertia locked onto it: the response to each
column of W is computed, and the readings of the accelerometers on the base are least squares of it. As with torque,
pi = C^+ c + N z: what does not shake with a force, but turns the base, is fitted beside, the same in all runs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import null_space

from balance.arrays import Floats
from balance.closure import Trajectory
from balance.conditions import Conditions
from balance.mechanism import Mechanism
from balance.regressor import wrench_regressor

from ..bench.base import Base
from ..bench.carried import locked_inertia
from ..clocks.mapping import ClockMap
from ..errors import AnalysisError
from ..motion import base_motion
from ..motion.derivatives import Grid, low_pass
from ..motion.joint_motion import followed, loaded
from .evidence import carried, clock_maps, motion_of, rate_of, refuse_clipped_base, span_of
from .parts import Part

if TYPE_CHECKING:
    from ..rig import Rig
    from ..store import Run

NEEDED = ("mass", "mounts")
"""What a rig must state of its bench, beside centre and inertia, for its base to be taken for a model."""
POSITION_BANDWIDTH = 4.0
"""Cut-off of the positions, in cut-offs of the readings: the moment, far larger, must be told to a thousandth."""
RINGING_S = 0.25
"""How long the base's ringing after the motion counts [s]."""


@dataclass(frozen=True)
class Shaken:
    """One run: what moved, the base that answers, and what its accelerometers showed."""

    model: Mechanism
    """As mounted."""
    grid: Grid
    path: Trajectory
    base: Base
    """With the mechanism's inertia locked onto it."""
    sensors: base_motion.BaseAcceleration
    seen: Floats
    """Readings on the grid, (n, channels) [m/s2]."""
    used: slice
    """The samples that count."""
    cutoff: float
    """[Hz]"""
    motion: str

    def smooth(self, values: Floats) -> Floats:
        """Values (n, channels, k) low-passed, on the samples that count."""
        flat = values.reshape(self.grid.count, -1)
        return low_pass(flat, self.cutoff, self.grid.rate).reshape(values.shape)[self.used]

    def moved(self, wrenches: Floats) -> Floats:
        """Accelerations of the base under wrenches (n, k, 6), (n, k, 6) [m/s2, rad/s2].

        Taken for straight between samples a wave loses (omega h)^2 / 12, half a per cent of 40 Hz at 1 kHz, of what
        moves the base: a twelfth of the second difference puts that back, up to (omega h)^4 / 240. At the samples
        themselves the wrench is as it is.
        """
        bent = np.zeros_like(wrenches)
        bent[1:-1] = (wrenches[2:] - 2.0 * wrenches[1:-1] + wrenches[:-2]) / 12.0
        return self.base.respond(wrenches - bent, self.grid.step).acceleration + bent @ np.linalg.inv(self.base.mass).T

    def answers(self, columns: Floats) -> Floats:
        """What the accelerometers show of wrenches (n, 6, k) on the base, (n, channels, k) [m/s2]."""
        pushed = np.flatnonzero(columns.any(axis=(0, 1)))
        found = np.zeros((len(columns), len(self.sensors.rows), columns.shape[2]))
        wrenches = np.ascontiguousarray(np.moveaxis(columns[:, :, pushed], 1, 2))
        moved = self.moved(wrenches)
        found[:, :, pushed] = np.moveaxis(moved @ self.sensors.rows.T, 1, 2)
        return found


def shaken(
    runs: "Sequence[Run]",
    rigs: "Sequence[Rig]",
    mechanism: Mechanism,
    cutoff: float,
    clocks: "Mapping[Path, Mapping[str, ClockMap]]",
) -> list[Shaken]:
    """The runs of one mounting. Raises AnalysisError where no base is stated, or no sensor is on it."""
    return [_shaken(run, rig, mechanism, cutoff, clocks.get(run.path)) for run, rig in zip(runs, rigs, strict=True)]


def states_base(rig: "Rig") -> bool:
    """Whether a rig itself states the base's mass and mounts."""
    return set(NEEDED) <= rig.bench.model_fields_set


def basis_of(conditions: Conditions) -> Floats:
    """Parameters per unit of each condition's value, then of each combination that is free beside, (10 nb, 10 nb)."""
    return np.hstack([np.linalg.pinv(conditions.matrix), null_space(conditions.matrix)])


def part_of(run: Shaken, conditions: Conditions) -> Part:
    """The equations of a run."""
    columns = wrench_regressor(run.model, run.path.q, run.path.v, run.path.a) @ basis_of(conditions)
    made = run.answers(columns)
    smooth = run.smooth(np.concatenate([made, run.seen[:, :, None], rate_of(run.seen, run.grid)[:, :, None]], axis=2))
    rank = conditions.rank
    eye = np.eye(run.seen.shape[1])[None]
    slope = np.linspace(-1.0, 1.0, len(smooth))[:, None, None]
    nuisance = np.concatenate([eye + 0.0 * slope, eye * slope, eye * smooth[:, :, -1:]], axis=2)
    return Part(
        smooth[:, :, :rank],
        smooth[:, :, rank:-2],
        smooth[:, :, -2],
        nuisance,
        1.0 / (run.cutoff * run.grid.step),
        run.motion,
    )


def _shaken(
    run: "Run", rig: "Rig", mechanism: Mechanism, cutoff: float, clocks: "Mapping[str, ClockMap] | None"
) -> Shaken:
    if not states_base(rig):
        raise AnalysisError(
            f"{run.name}: its rig does not state the base (bench: {', '.join(NEEDED)}): state it, or make runs with "
            "trial masses, by which the base's response is measured (--from trials)"
        )
    sensors = base_motion.recorded(run, rig)
    if sensors is None:
        raise AnalysisError(f"{run.name}: no accelerometer on the base was recorded: nothing shows how it vibrates")
    refuse_clipped_base(run, rig)
    model = loaded(run, mechanism)
    grid, path = followed(run, rig, model, POSITION_BANDWIDTH * cutoff)
    maps = clock_maps(run, rig, model, {sensors.group}, clocks)
    seen = carried(sensors.time, sensors.values, sensors.group, maps, grid)
    base = Base.of(rig.bench, locked_inertia(model, path.q[0]))
    return Shaken(model, grid, path, base, sensors, seen, span_of(path, grid, RINGING_S), cutoff, motion_of(run))
