"""Shaking forces and moments of a run on the grid of its encoders, the base's motion taken out where it is measured.

P F + m P a = P W pi, with F the measured loads, a the readings of the base's accelerometers, W the regressor of the
shaking wrench, and P the projection behind which the base's motion does not appear (``kinematics.base_motion``).
Without accelerometers the base is taken to be at rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from ..kinematics import base_motion
from ..runs.aligned_run import AlignedRun
from .shaking_wrench import COMPONENTS, MeasuredWrench


@dataclass(frozen=True)
class MeasuredLoads:
    """Readings of the force sensors with the base's motion taken out."""

    names: tuple[str, ...]
    """Components: Fx ... Mz."""
    forces: Floats
    """As measured, (n, k) [N, N m]."""
    groups: frozenset[str]
    """Groups of the channels that are used."""
    inertial: Floats | None = None
    """Mass times the readings of the base's accelerometers, (n, channels) [N]; None: the base is at rest."""
    projection: Floats | None = None
    """Columns of P for the forces, (n, k, k)."""
    base_projection: Floats | None = None
    """Columns of P for the accelerometers, (n, k, channels)."""

    @property
    def values(self) -> Floats:
        """P F + m P a, (n, k) [N, N m]."""
        found = self.projected(self.forces)
        return found if self.inertial is None else found + self.base_projected(self.inertial)

    def projected(self, rows: Floats) -> Floats:
        """P @ rows, (n, k) or (n, k, p) [N, N m, or per parameter]."""
        if self.projection is None:
            return rows
        return np.asarray(np.einsum("nij,nj...->ni...", self.projection, rows))

    def base_projected(self, readings: Floats) -> Floats:
        """P @ readings (n, channels) of the base's accelerometers times mass [N], (n, k) [N, N m]."""
        if self.base_projection is None:
            return np.zeros_like(self.forces)
        return np.asarray(np.einsum("nij,nj->ni", self.base_projection, readings))

    def projected_regressor(self, wrench: Floats) -> Floats:
        """Rows of these loads in P W of a regressor W (n, 6, p) [N, N m per parameter], (n, k, p)."""
        return self.projected(wrench[:, [COMPONENTS.index(name) for name in self.names]])


def measured_loads(run: AlignedRun, wrench: MeasuredWrench, names: Sequence[str], bandwidth_hz: float) -> MeasuredLoads:
    """Components of a wrench on the run's grid; P from positions smoothed below ``bandwidth_hz``.

    Raises AnalysisError where clocks cannot be aligned.
    """
    base = run.base
    groups = frozenset({wrench.group} | ({base.group} if base else set()))
    measured = np.column_stack([v for name in names if (v := wrench.values[name]) is not None])
    forces = run.on_grid(wrench.group, wrench.time, measured)
    if base is None:
        return MeasuredLoads(tuple(names), forces, groups)
    axes = [COMPONENTS.index(name) for name in names]
    rows = base_motion.force_rows(run.mechanism, run.trajectory(bandwidth_hz))[:, axes]
    share = base_motion.projector(rows, base.rows)
    inertial = run.mechanism.total_mass * run.on_grid(base.group, base.time, base.values)
    return MeasuredLoads(tuple(names), forces, groups, inertial, share[:, :, : len(axes)], share[:, :, len(axes) :])
