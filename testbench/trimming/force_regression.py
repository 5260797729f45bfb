"""Regression of the measured forces of a run on the balance conditions, both low-passed alike.

P F + m P a = P W_F[pivots] c (see ``shaking_wrench``). Offsets and slow drifts of each row, and small errors of the
clocks (a delay of the forces, one of the accelerations), are nuisances.
"""

import numpy as np

from balance.balancing.conditions import Conditions
from balance.dynamics.regressor import wrench_regressor
from balance.estimation.first_moment_imbalance import condition_columns

from ..errors import AnalysisError
from ..loads.shaking_wrench import COMPONENTS, measured_loads
from ..runs.aligned_run import AlignedRun
from .problem import RunEquations, ValidSamples, motion_name, offset_and_drift
from .sensor_errors import force_effects, reading_effects, stated_deviations

CUTOFF_HZ = 40.0
"""Of forces and columns alike: most of what the moves excite lies below, and encoders tell accelerations there."""
POSITION_BANDWIDTH = 2.0
"""Cut-off of the positions, in cut-offs of the forces."""
MARGIN_PERIODS = 3.0
"""Periods of the cut-off kept before and after the motion."""
LEAST_MOTION = 1e-2
"""Force of a first moment of 1 kg m below which nothing moves [1/s2]."""


def force_regression(run: AlignedRun, conditions: Conditions, cutoff: float = CUTOFF_HZ) -> RunEquations:
    """The equations of a run.

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
    valid = ValidSamples.of(run, loads.groups, bandwidth)
    valid.refuse_no_motion(path)
    nuisance = [loads.projected(valid.rates(loads.forces))]
    deviations = stated_deviations([run.run])
    effects = {entry: loads.projected(change) for entry, change in force_effects(run, deviations, axes).items()}
    if run.base is not None and loads.inertial is not None:
        nuisance.append(loads.base_projected(valid.rates(loads.inertial)))
        of_base = reading_effects(loads.inertial, run.base.columns, deviations)
        effects |= {entry: loads.base_projected(change) for entry, change in of_base.items()}
    used = run.motion_span(bandwidth, MARGIN_PERIODS / cutoff)
    own, readings, *delays = (
        valid.low_pass(v, cutoff)[used] for v in (loads.projected_regressor(columns), loads.values, *nuisance)
    )
    kept = valid.kept[used]
    return RunEquations.of(
        valid,
        1.0 / (cutoff * run.grid.step),
        own,
        readings,
        np.concatenate([offset_and_drift(kept, len(axes)), *(delay[:, :, None] for delay in delays)], axis=2),
        kept[:, None],
        motion_name(run),
        loads.names,
        conditions.rank,
        {entry: valid.low_pass(change, cutoff)[used] for entry, change in effects.items()},
    )
