"""Regression of the measured forces of a run on the balance conditions, both low-passed alike.

P F + m P a = P W_F[pivots] c (see ``measured_loads``). Offsets and slow drifts of each row, and small errors of the
clocks (a delay of the forces, one of the accelerations), are nuisances.
"""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats, Indices
from balance.balancing.conditions import Conditions
from balance.dynamics.regressor import wrench_regressor
from balance.estimation.first_moment_imbalance import condition_columns
from balance.estimation.regression import RegressionRecord

from ..errors import AnalysisError
from ..loads.measured_loads import measured_loads
from ..loads.shaking_wrench import COMPONENTS, MeasuredWrench, refuse_saturation, shaking_wrench
from ..recording import Finding
from ..runs.aligned_run import AlignedRun
from .sensor_errors import Effects, force_effects, reading_effects, stated_deviations
from .valid_samples import ValidSamples

CUTOFF_HZ = 40.0
"""Of forces and columns alike: most of what the moves excite lies below, and encoders tell accelerations there."""
BLOCKS = 20
"""Of a record, of equal information, that are left out in turn."""
POSITION_BANDWIDTH = 2.0
"""Cut-off of the positions, in cut-offs of the forces."""
MARGIN_PERIODS = 3.0
"""Periods of the cut-off kept before and after the motion."""
LEAST_MOTION = 1e-2
"""Force of a first moment of 1 kg m below which nothing moves [1/s2]."""


@dataclass(frozen=True)
class ForceRegression:
    """The equations of one run."""

    record: RegressionRecord
    base_known: bool
    """Whether the base's motion was taken out."""
    findings: tuple[Finding, ...]
    effects: Effects
    """Of the sensors' stated errors."""
    period: float
    """Of the cut-off [samples]."""


def force_regression(run: AlignedRun, conditions: Conditions, cutoff: float = CUTOFF_HZ) -> ForceRegression:
    """The equations of a run.

    Raises AnalysisError without force channels, with sensors at the end of their range, no motion, clocks that cannot
    be aligned, gaps that leave nothing.
    """
    bandwidth = POSITION_BANDWIDTH * cutoff
    wrench = shaking_wrench(run.run)
    refuse_saturation(run.run, wrench)
    path = run.trajectory(bandwidth)
    regressor = wrench_regressor(run.mechanism, path.q, path.v, path.a)
    columns = condition_columns(conditions, regressor[:, :3])
    names = _names(run, wrench, columns)
    axes = [COMPONENTS.index(name) for name in names]
    loads = measured_loads(run, wrench, names, bandwidth)
    valid = ValidSamples.of(run, loads.groups, bandwidth)
    valid.refuse_no_motion(path)
    nuisance = [loads.projected(valid.rates(loads.forces))]
    deviations = stated_deviations([run.rig])
    effects = {entry: loads.projected(change) for entry, change in force_effects(run, deviations, axes).items()}
    if run.base is not None and loads.inertial is not None:
        nuisance.append(loads.base_projected(valid.rates(loads.inertial)))
        of_base = reading_effects(loads.inertial, run.base.columns, deviations)
        effects |= {entry: loads.base_projected(change) for entry, change in of_base.items()}
    used = run.motion_span(bandwidth, MARGIN_PERIODS / cutoff)
    own, readings, *delays = (
        valid.low_pass(v, cutoff)[used] for v in (loads.projected(columns[:, axes]), loads.values, *nuisance)
    )
    slope = np.linspace(-1.0, 1.0, len(own))[:, None, None]
    kept, unit = valid.kept[used, None, None], np.eye(len(names))[None]
    record = RegressionRecord.of(
        own,
        readings,
        equal_blocks(own, 1.0 / (cutoff * run.grid.step)),
        np.concatenate([unit * kept, unit * slope * kept, *(delay[:, :, None] for delay in delays)], axis=2),
        kept[:, :, 0],
        motion=motion_name(run),
        rows=names,
    )
    smooth = {entry: valid.low_pass(change, cutoff)[used] for entry, change in effects.items()}
    findings = (*wrench.findings, *valid.findings)
    return ForceRegression(record, run.base is not None, findings, smooth, 1.0 / (cutoff * run.grid.step))


def _names(run: AlignedRun, wrench: MeasuredWrench, columns: Floats) -> list[str]:
    """The components of force in which the mechanism can shake and that are determined."""
    size = np.abs(columns).max(axis=(0, 2))
    if not size.max() > LEAST_MOTION:
        raise AnalysisError(f"{run.name}: no motion: the encoders stand still, so that the record tells nothing")
    wanted = [COMPONENTS[i] for i in range(3) if size[i] > 1e-9 * size.max()]
    names = [name for name in wanted if wrench.values[name] is not None]
    if not names:
        reasons = "; ".join(f"{name}: {wrench.reasons[name]}" for name in wanted)
        raise AnalysisError(
            f"{run.name}: the force sensors determine no component in which this mechanism shakes: {reasons}"
        )
    return names


def motion_name(run: AlignedRun) -> str:
    """What repeats of one motion have in common; empty where the conditions do not say."""
    motion, peak = run.conditions.get("motion"), run.conditions.get("peak_acceleration_g")
    return "" if motion is None or peak is None else f"{motion} at {peak:.9g} g0"


def equal_blocks(columns: Floats, shortest: float) -> Indices:
    """Numbers of blocks of equal information on the conditions, each at least so many samples long, (n,)."""
    energy = np.sum(columns**2, axis=(1, 2))
    numbers = np.minimum((np.cumsum(energy) / energy.sum() * BLOCKS).astype(np.intp), BLOCKS - 1)
    merged, current, begun = np.zeros(len(numbers), dtype=np.intp), -1, -np.inf
    starts = np.flatnonzero(np.diff(numbers, prepend=-1))
    for a, b in zip(starts, np.r_[starts[1:], len(numbers)], strict=True):
        if a - begun >= shortest:
            current, begun = current + 1, float(a)
        merged[a:b] = current
    return merged
