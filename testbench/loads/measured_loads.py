"""Shaking forces and moments of a run on the grid of its encoders, the base's motion taken out where it is measured.

P F + m P a = P W pi, with F the measured loads, a the readings of the base's accelerometers, W the regressor of the
shaking wrench, and P the projection behind which the base's motion does not appear (``kinematics.base_motion``).
Without accelerometers the base is taken to be at rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError
from ..kinematics import base_motion
from ..runs.aligned_run import AlignedRun
from .shaking_wrench import COMPONENTS, MeasuredWrench, refuse_saturation, shaking_wrench

NOTHING = 1e-9
"""Share of the largest component in which a mechanism that does not shake so seems to."""


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
        """Rows of these loads in P W of a regressor W (n, 3 or 6, p) [N, N m per parameter], (n, k, p)."""
        return self.projected(wrench[:, [COMPONENTS.index(name) for name in self.names]])


def measured_loads(run: AlignedRun, regressor: Floats, bandwidth_hz: float) -> tuple[MeasuredLoads, tuple[str, ...]]:
    """What force sensors measure of the components in which a run shakes, on its grid; and why others are left out.

    ``regressor`` (n, 3 or 6, p) [N, N m per parameter] says which components shake; where the base moves, of forces
    alone. P follows from positions smoothed below ``bandwidth_hz``. Raises AnalysisError where none is determined, a
    sensor is at the end of its range, or clocks cannot be aligned.
    """
    wrench = shaking_wrench(run.run)
    refuse_saturation(run.run, wrench)
    size = np.abs(regressor).max(axis=(0, 2))
    possible = COMPONENTS[: len(size) if run.base is None else 3]
    shaking = [name for name, one in zip(possible, size, strict=False) if one > NOTHING * size.max()]
    names = wrench.determined(shaking)
    if not names:
        reasons = "; ".join(f"{name}: {wrench.reasons[name]}" for name in shaking) or "the encoders stand still"
        raise AnalysisError(
            f"{run.name}: the force sensors determine no component in which this mechanism shakes: {reasons}"
        )
    left_out = tuple(f"{name} left out: {wrench.reasons[name]}" for name in shaking if name not in names)
    return _on_grid(run, wrench, names, bandwidth_hz), left_out


def _on_grid(run: AlignedRun, wrench: MeasuredWrench, names: Sequence[str], bandwidth_hz: float) -> MeasuredLoads:
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
