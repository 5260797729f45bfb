"""What the vibration of the base says of the balance conditions, through the base that the rig states.

M x'' + C x' + K x = W pi, with the base on its mounts and the mechanism's inertia locked onto it: the response to each
column of W is computed, and the readings of the accelerometers on the base are least squares of it. As with torque,
pi = C^+ c + N z: what does not shake with a force, but turns the base, is fitted beside, the same in all runs.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import null_space

from balance import trim
from balance.arrays import Floats
from balance.conditions import Conditions
from balance.mechanism import Mechanism
from balance.regressor import wrench_regressor

from .. import base_motion
from ..bench.base import Base
from ..bench.carried import locked_inertia
from ..clocks.mapping import ClockMap
from ..derivatives import low_pass
from ..errors import AnalysisError
from ..joint_motion import followed, loaded
from .evidence import carried, clock_maps, motion_of, rate_of, refuse_clipped_base, span_of
from .parts import Part, records

if TYPE_CHECKING:
    from ..rig import Rig
    from ..store import Run

NEEDED = ("mass", "mounts")
"""What a rig must state of its bench, beside centre and inertia, for its base to be taken for a model."""
POSITION_BANDWIDTH = 4.0
"""Cut-off of the positions, in cut-offs of the readings: the moment, far larger, must be told to a thousandth."""
RINGING_S = 0.25
"""How long the base's ringing after the motion counts [s]."""


def vibration_records(
    runs: "Sequence[Run]",
    rigs: "Sequence[Rig]",
    mechanism: Mechanism,
    conditions: Conditions,
    cutoff: float,
    clocks: "Mapping[Path, Mapping[str, ClockMap]]",
    steps: np.random.Generator | None = None,
) -> list[trim.Record]:
    """The equations of runs of one mounting; with ``steps``, the encoders read elsewhere within their resolution.

    Raises AnalysisError where no base is stated, or no sensor is on it.
    """
    return records(
        [
            _part(run, rig, mechanism, conditions, cutoff, clocks.get(run.path), steps)
            for run, rig in zip(runs, rigs, strict=True)
        ]
    )


def states_base(rig: "Rig") -> bool:
    """Whether a rig itself states the base's mass and mounts."""
    return set(NEEDED) <= rig.bench.model_fields_set


def _part(
    run: "Run",
    rig: "Rig",
    mechanism: Mechanism,
    conditions: Conditions,
    cutoff: float,
    clocks: "Mapping[str, ClockMap] | None",
    steps: np.random.Generator | None,
) -> Part:
    if not states_base(rig):
        raise AnalysisError(
            f"{run.name}: its rig does not state the base (bench: {', '.join(NEEDED)}): state it, or make runs with "
            "trial masses, by which the base's response is measured (--from trials)"
        )
    base = base_motion.recorded(run, rig)
    if base is None:
        raise AnalysisError(f"{run.name}: no accelerometer on the base was recorded: nothing shows how it vibrates")
    refuse_clipped_base(run, rig)
    model = loaded(run, mechanism)
    grid, path = followed(run, rig, model, POSITION_BANDWIDTH * cutoff, steps)
    maps = clock_maps(run, rig, model, {base.group}, clocks)
    seen = carried(base.time, base.values, base.group, maps, grid)
    whole = wrench_regressor(model, path.q, path.v, path.a)
    columns = whole @ np.hstack([np.linalg.pinv(conditions.matrix), null_space(conditions.matrix)])
    answer = Base.of(rig.bench, locked_inertia(model, path.q[0]))
    moved = [_answer(answer, c, grid.step) @ base.rows.T for c in np.moveaxis(columns, 2, 0)]
    made = np.stack(moved, axis=2)
    used = span_of(path, grid, RINGING_S)
    stacked = np.concatenate([made, seen[:, :, None], rate_of(seen, grid)[:, :, None]], axis=2)
    smooth = low_pass(stacked.reshape(grid.count, -1), cutoff, grid.rate).reshape(stacked.shape)[used]
    rank = conditions.rank
    eye = np.eye(len(base.rows))[None]
    slope = np.linspace(-1.0, 1.0, len(smooth))[:, None, None]
    nuisance = np.concatenate([eye + 0.0 * slope, eye * slope, eye * smooth[:, :, -1:]], axis=2)
    return Part(
        smooth[:, :, :rank],
        smooth[:, :, rank:-2],
        smooth[:, :, -2],
        nuisance,
        1.0 / (cutoff * grid.step),
        motion_of(run),
    )


def _answer(base: Base, wrench: Floats, step: float) -> Floats:
    """Accelerations of the base under a wrench (n, 6), (n, 6) [m/s2, rad/s2]."""
    if not wrench.any():
        return np.zeros_like(wrench)
    return base.respond(np.ascontiguousarray(wrench), step).acceleration
