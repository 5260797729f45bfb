"""Shaking forces and moments of a run on the grid of its encoders, the base's motion taken out where it is known.

Where accelerometers tell how the base moves, what does not see its rotation is kept of the forces (see
``base_motion``), and moments are left out; without, the base is taken for still.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.dynamics.regressor import wrench_regressor

from ..errors import AnalysisError
from ..motion import base_motion
from ..motion.gaps import Gaps
from ..runs.aligned_run import AlignedRun
from ..wrench import COMPONENTS, refuse_saturation, shaking_wrench

if TYPE_CHECKING:
    pass

CUTOFF_HZ = 40.0
"""Of the motion by which the direction that does not see the base's rotation is told [Hz]."""
NOTHING = 1e-9
"""Share of the largest component in which a mechanism that does not shake so seems to."""
BASE_STILL = "No accelerometer on the base: it is taken for still."
BASE_MOVES = (
    "The base's motion is taken out of the forces with the mass that MECH has as mounted; moments are left out."
)


@dataclass(frozen=True)
class Loads:
    """What force sensors measured, less what the base's motion explains."""

    names: tuple[str, ...]
    """Components that the sensors determine: Fx ... Mz."""
    values: Floats
    """(n, k) [N, N m]"""
    share: Floats | None
    """What was kept of the components, (n, k, k); None: all."""
    gaps: Gaps
    """Of the encoders' record and of the others that count, on the encoders' clock."""

    def seen(self, wrench: Floats) -> Floats:
        """What these loads see of a regressor of the shaking wrench (n, 6, p), (n, k, p)."""
        rows = wrench[:, [COMPONENTS.index(name) for name in self.names]]
        return rows if self.share is None else np.einsum("nij,njk->nik", self.share, rows)


def loads_of(run: AlignedRun) -> tuple[Loads, tuple[str, ...]]:
    """The loads of a run, and why components are left out.

    Raises AnalysisError if no component is determined, a sensor is at the end of its range, clocks cannot be aligned.
    """
    wrench, base, mechanism = shaking_wrench(run.run), run.base, run.mechanism
    refuse_saturation(run.run, wrench)
    wanted: tuple[str, ...] = COMPONENTS[:3] if base is not None else COMPONENTS
    path = run.trajectory(CUTOFF_HZ)
    size = np.abs(wrench_regressor(mechanism, path.q, path.v, path.a)).max(axis=(0, 2))
    wanted = tuple(name for name in wanted if size[COMPONENTS.index(name)] > NOTHING * size.max())
    names = tuple(name for name in wanted if wrench.values[name] is not None)
    if not names:
        lacking = "; ".join(f"{name}: {wrench.reasons[name]}" for name in wanted) or "the encoders stand still"
        raise AnalysisError(
            f"{run.name}: its force sensors determine nothing in which this mechanism shakes: {lacking}"
        )
    groups = {wrench.group} | ({base.group} if base else set())
    gaps = run.gaps(groups)
    seen = np.column_stack([v for name in names if (v := wrench.values[name]) is not None])
    values = run.on_grid(wrench.group, wrench.time, seen)
    reasons = tuple(f"{name} left out: {wrench.reasons[name]}" for name in wanted if name not in names)
    if base is None:
        return Loads(names, values, None, gaps), (*reasons, BASE_STILL)
    axes = [COMPONENTS.index(name) for name in names]
    share = base_motion.projector(base_motion.force_rows(mechanism, path)[:, axes], base.rows)
    felt = mechanism.total_mass * run.on_grid(base.group, base.time, base.values)
    k = len(names)
    kept = np.einsum("nij,nj->ni", share[:, :, :k], values) + np.einsum("nij,nj->ni", share[:, :, k:], felt)
    return Loads(names, kept, share[:, :, :k], gaps), (*reasons, BASE_MOVES)
