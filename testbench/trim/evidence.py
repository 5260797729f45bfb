"""What a run says of the balance conditions: forces against columns, low-passed alike, the base's motion taken out.

P F + m P a = P W_F[pivots] c, with F the measured force, a the accelerations of the base, P what does not see how the
base turns (see ``base_motion``). Offsets and slow drifts of each row, and small errors of the clocks (a delay of the
forces, one of the accelerations), are solved for with the conditions.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats, Indices
from balance.conditions import Conditions
from balance.dynamics.regressor import wrench_regressor
from balance.estimation.first_moment_imbalance import condition_columns
from balance.estimation.regression import RegressionRecord

from ..errors import AnalysisError
from ..findings import Finding
from ..motion import base_motion
from ..runs.aligned_run import AlignedRun
from ..wrench import MeasuredWrench, refuse_saturation, shaking_wrench
from .calibration import Effects, of_forces, of_readings, stated
from .sound import Sound

if TYPE_CHECKING:
    pass

CUTOFF_HZ = 40.0
"""Of forces and columns alike: most of what the moves excite lies below, and encoders tell accelerations there."""
STRETCHES = 20
"""Of a record, of equal information, that are left out in turn."""
POSITION_BANDWIDTH = 2.0
"""Cut-off of the positions, in cut-offs of the forces."""
MARGIN_PERIODS = 3.0
"""Periods of the cut-off kept before and after the motion."""
LEAST_MOTION = 1e-2
"""Force of a first moment of 1 kg m below which nothing moves [1/s2]."""
LONG_S = 5.0
"""From which the drift between clocks matters and can be told [s]."""


@dataclass(frozen=True)
class RunEvidence:
    """The equations of one run."""

    record: RegressionRecord
    base_known: bool
    """Whether the base's motion was taken out."""
    findings: tuple[Finding, ...]
    effects: Effects
    """Of the sensors' stated errors."""
    period: float
    """Of the cut-off [samples]."""


def run_evidence(run: AlignedRun, conditions: Conditions, cutoff: float = CUTOFF_HZ) -> RunEvidence:
    """The equations of a run.

    Raises AnalysisError where the run cannot tell: no force channels, sensors at the end of their range, no motion,
    clocks that cannot be aligned, gaps that leave nothing.
    """
    wrench, bandwidth = shaking_wrench(run.run), POSITION_BANDWIDTH * cutoff
    refuse_saturation(run.run, wrench)
    model, path = run.mechanism, run.trajectory(bandwidth)
    columns = condition_columns(conditions, wrench_regressor(model, path.q, path.v, path.a)[:, :3])
    rows = _rows(run, wrench, columns)
    sound = Sound.of(run, bandwidth, {wrench.group} | ({run.base.group} if run.base else set()))
    sound.refuse_nothing(path)
    seen = np.column_stack([v for i in rows if (v := wrench.values[f"F{'xyz'[i]}"]) is not None])
    force = run.on_grid(wrench.group, wrench.time, seen)
    columns = columns[:, rows]
    nuisance = [sound.rate_of(force)]
    deviations = stated([run.rig])
    effects = dict(of_forces(run, deviations, rows))
    if (base := run.base) is not None:
        share = base_motion.projector(base_motion.force_rows(model, path)[:, rows], base.rows)
        felt = model.total_mass * run.on_grid(base.group, base.time, base.values)
        k = len(rows)
        turned = share[:, :, :k]
        nuisance = [
            np.einsum("nij,nj->ni", turned, nuisance[0]),
            np.einsum("nij,nj->ni", share[:, :, k:], sound.rate_of(felt)),
        ]
        force = np.einsum("nij,nj->ni", turned, force) + np.einsum("nij,nj->ni", share[:, :, k:], felt)
        columns = np.einsum("nij,njk->nik", turned, columns)
        effects = {entry: np.einsum("nij,nj->ni", turned, change) for entry, change in effects.items()}
        for entry, change in of_readings(felt, base.columns, deviations).items():
            effects[entry] = np.einsum("nij,nj->ni", share[:, :, k:], change)
    names = [f"F{'xyz'[i]}" for i in rows]
    used = run.motion_span(bandwidth, MARGIN_PERIODS / cutoff)
    record = _record(motion_of(run), names, sound, columns, force, nuisance, cutoff, used)
    smooth = {entry: sound.low_pass(change, cutoff)[used] for entry, change in effects.items()}
    findings = (*wrench.findings, *sound.findings)
    return RunEvidence(record, base is not None, findings, smooth, 1.0 / (cutoff * run.grid.step))


def _rows(run: AlignedRun, wrench: MeasuredWrench, columns: Floats) -> list[int]:
    """The axes along which the mechanism can shake and the force is determined."""
    size = np.abs(columns).max(axis=(0, 2))
    if not size.max() > LEAST_MOTION:
        raise AnalysisError(f"{run.name}: no motion: the encoders stand still, so that the record tells nothing")
    wanted = [i for i in range(3) if size[i] > 1e-9 * size.max()]
    rows = [i for i in wanted if wrench.values[f"F{'xyz'[i]}"] is not None]
    if not rows:
        reasons = "; ".join(f"F{'xyz'[i]}: {wrench.reasons[f'F{chr(120 + i)}']}" for i in wanted)
        raise AnalysisError(
            f"{run.name}: the force sensors determine no component in which this mechanism shakes: {reasons}"
        )
    return rows


def motion_of(run: AlignedRun) -> str:
    """What repeats of one motion have in common; empty where the conditions do not say."""
    motion, peak = run.conditions.get("motion"), run.conditions.get("peak_acceleration_g")
    return "" if motion is None or peak is None else f"{motion} at {peak:.9g} g0"


def _record(
    motion: str,
    names: list[str],
    sound: Sound,
    columns: Floats,
    force: Floats,
    nuisance: list[Floats],
    cutoff: float,
    used: slice,
) -> RegressionRecord:
    """All low-passed alike, cut to the motion with a margin, with an offset and a drift for every row.

    What gaps touch is zero.
    """
    count, rows, _ = columns.shape
    smooth = sound.low_pass(np.concatenate([columns.reshape(count, -1), force, *nuisance], axis=1), cutoff)[used]
    split = np.cumsum([columns[0].size, rows, *(n.shape[1] for n in nuisance)])[:-1]
    made, pushed, *delays = np.split(smooth, split, axis=1)
    made = made.reshape(len(made), rows, -1)
    slope = np.linspace(-1.0, 1.0, len(made))
    kept = sound.kept[used, None, None]
    own: list[Floats] = [np.eye(rows)[None] * kept, np.eye(rows)[None] * slope[:, None, None] * kept]
    own += [delay[:, :, None] for delay in delays]
    blocks = stretches_of(made, 1.0 / (cutoff * sound.grid.step))
    every = np.broadcast_to(sound.kept[used, None], pushed.shape)
    return RegressionRecord.of(made, pushed, blocks, np.concatenate(own, axis=2), every, motion=motion, rows=names)


def stretches_of(columns: Floats, shortest: float) -> Indices:
    """Numbers of stretches of equal information on the conditions, each at least so many samples long, (n,)."""
    energy = np.sum(columns**2, axis=(1, 2))
    numbers = np.minimum((np.cumsum(energy) / energy.sum() * STRETCHES).astype(np.intp), STRETCHES - 1)
    merged, current, begun = np.zeros(len(numbers), dtype=np.intp), -1, -np.inf
    starts = np.flatnonzero(np.diff(numbers, prepend=-1))
    for a, b in zip(starts, np.r_[starts[1:], len(numbers)], strict=True):
        if a - begun >= shortest:
            current, begun = current + 1, float(a)
        merged[a:b] = current
    return merged
