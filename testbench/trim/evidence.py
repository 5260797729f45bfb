"""What a run says of the balance conditions: forces against columns, low-passed alike, the base's motion taken out.

P F + m P a = P W_F[pivots] c, with F the measured force, a the accelerations of the base, P what does not see how the
base turns (see ``base_motion``). Offsets and slow drifts of each row, and small errors of the clocks (a delay of the
forces, one of the accelerations), are solved for with the conditions.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats, Indices
from balance.conditions import Conditions
from balance.dynamics.regressor import wrench_regressor
from balance.estimation.first_moment_imbalance import condition_columns
from balance.estimation.regression import RegressionRecord
from balance.mechanism import Mechanism

from ..clocks.mapping import ClockMap
from ..clocks.run import align_run
from ..errors import AnalysisError
from ..findings import Finding
from ..motion import base_motion
from ..motion.derivatives import HIGHEST_CUTOFF, Grid, low_pass
from ..motion.joint_motion import encoder_trajectory, group_of_encoders, loaded
from ..motion.segments import moving
from ..runs.si_run import SIRun
from ..wrench import MeasuredWrench, shaking_wrench
from .calibration import Effects, of_forces, of_readings, stated
from .sound import Sound

if TYPE_CHECKING:
    from balance.closure import Trajectory

    from ..rig import Rig
    from ..store import Run

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


def run_evidence(
    run: "Run",
    rig: "Rig",
    mechanism: Mechanism,
    conditions: Conditions,
    cutoff: float = CUTOFF_HZ,
    clocks: Mapping[str, ClockMap] | None = None,
) -> RunEvidence:
    """The equations of a run of ``mechanism`` without payload and counter-masses, which the run's conditions put on.

    ``clocks`` are alignments that are known; without, they are found. Raises AnalysisError where the run cannot tell:
    no force channels, sensors at the end of their range, no motion, clocks that cannot be aligned, gaps that leave
    nothing.
    """
    model = loaded(run, mechanism)
    si = SIRun.of(run, rig)
    wrench = shaking_wrench(si)
    refuse_saturation(run, rig, wrench)
    grid, path = encoder_trajectory(si, model, POSITION_BANDWIDTH * cutoff)
    columns = condition_columns(conditions, wrench_regressor(model, path.q, path.v, path.a)[:, :3])
    rows = _rows(run, wrench, columns)
    base = base_motion.recorded(si)
    needed = {wrench.group} | ({base.group} if base else set())
    maps = clock_maps(run, rig, model, needed, clocks)
    sound = Sound.of(run, rig, grid, needed, maps, POSITION_BANDWIDTH * cutoff)
    sound.refuse_nothing(path)
    seen = np.column_stack([v for i in rows if (v := wrench.values[f"F{'xyz'[i]}"]) is not None])
    force = carried(wrench.time, seen, wrench.group, maps, grid)
    columns = columns[:, rows]
    nuisance = [sound.rate_of(force)]
    deviations = stated([rig])
    effects = dict(of_forces(run, rig, deviations, rows, lambda t, v: carried(t, v, wrench.group, maps, grid)))
    if base is not None:
        share = base_motion.projector(base_motion.force_rows(model, path)[:, rows], base.rows)
        felt = model.total_mass * carried(base.time, base.values, base.group, maps, grid)
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
    record = _record(motion_of(run), names, sound, columns, force, nuisance, cutoff, path)
    used = span_of(path, grid, MARGIN_PERIODS / cutoff)
    smooth = {entry: sound.low_pass(change, cutoff)[used] for entry, change in effects.items()}
    findings = (*wrench.findings, *sound.findings)
    return RunEvidence(record, base is not None, findings, smooth, 1.0 / (cutoff * grid.step))


def refuse_saturation(run: "Run", rig: "Rig", wrench: MeasuredWrench) -> None:
    """Raise AnalysisError where a force sensor or an accelerometer on the base is at the end of its range."""
    for finding in wrench.findings:
        if finding.code != "constant_channel":
            raise AnalysisError(f"{finding.message}: a clipped force cannot tell what is missing; use gentler runs")
    refuse_clipped_base(run, rig)


def refuse_clipped_base(run: "Run", rig: "Rig") -> None:
    """Raise AnalysisError where an accelerometer on the base is at the end of its range."""
    si = SIRun.of(run, rig)
    for column in rig.base_columns:
        if column.range is not None and si.holds(column) and (full := si.at_range(column)).any():
            raise AnalysisError(f"{run.name}: {column.channel}: {int(full.sum())} samples at the end of its range")


def _rows(run: "Run", wrench: MeasuredWrench, columns: Floats) -> list[int]:
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


def clock_maps(
    run: "Run", rig: "Rig", model: Mechanism, needed: set[str], known: Mapping[str, ClockMap] | None
) -> Mapping[str, ClockMap]:
    """Maps of the groups that are needed to the encoders' clock: those that are known, else found."""
    si = SIRun.of(run, rig)
    reference = group_of_encoders(si)
    needed = needed - {reference}
    if known is not None and needed <= known.keys():
        return known
    if not needed:
        return {}
    times = run.time(reference)
    found = align_run(si, lambda: model, reference, drift=bool(times[-1] - times[0] >= LONG_S), among=needed)
    return {group: found.map_of(group) for group in needed}


def carried(time: Floats, values: Floats, group: str, maps: Mapping[str, ClockMap], grid: Grid) -> Floats:
    """Values (m, k) of a group on the encoders' grid; smoothed first where the grid is coarser."""
    at = maps[group].to_reference(time) if group in maps else time
    rate = (len(time) - 1) / float(time[-1] - time[0])
    if rate > grid.rate:
        values = low_pass(values, HIGHEST_CUTOFF * grid.rate, rate)
    return np.column_stack([np.interp(grid.time, at, v) for v in values.T])


def motion_of(run: "Run") -> str:
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
    path: "Trajectory",
) -> RegressionRecord:
    """All low-passed alike, cut to the motion with a margin, with an offset and a drift for every row.

    What gaps touch is zero.
    """
    count, rows, _ = columns.shape
    margin = MARGIN_PERIODS / cutoff
    used, grid = span_of(path, sound.grid, margin), sound.grid
    smooth = sound.low_pass(np.concatenate([columns.reshape(count, -1), force, *nuisance], axis=1), cutoff)[used]
    split = np.cumsum([columns[0].size, rows, *(n.shape[1] for n in nuisance)])[:-1]
    made, pushed, *delays = np.split(smooth, split, axis=1)
    made = made.reshape(len(made), rows, -1)
    slope = np.linspace(-1.0, 1.0, len(made))
    kept = sound.kept[used, None, None]
    own: list[Floats] = [np.eye(rows)[None] * kept, np.eye(rows)[None] * slope[:, None, None] * kept]
    own += [delay[:, :, None] for delay in delays]
    blocks = stretches_of(made, 1.0 / (cutoff * grid.step))
    every = np.broadcast_to(sound.kept[used, None], pushed.shape)
    return RegressionRecord.of(made, pushed, blocks, np.concatenate(own, axis=2), every, motion=motion, rows=names)


def span_of(path: "Trajectory", grid: Grid, margin: float) -> slice:
    """Samples from the first to the last motion of any joint, with a margin [s]."""
    spans = [moving(v, grid.rate, margin) for v in path.v.T if np.ptp(v) > 0.0]
    return slice(min(s.start for s in spans), max(s.stop for s in spans))


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
