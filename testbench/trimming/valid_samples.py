"""The part of a run that no gap touches, on the grid of its encoders: what an analysis may rest on."""

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats
from balance.closure import Trajectory

from ..errors import AnalysisError
from ..kinematics.gaps import Gaps, gap_reach, true_segments
from ..kinematics.smoothing_and_derivatives import Grid, low_pass
from ..recording import Finding
from ..runs.aligned_run import AlignedRun

MOVES = 1e-3
"""Change of a joint's position in a block from which it moves there [rad, m]."""


class NoValidMotion(AnalysisError):
    """Gaps leave nothing of a run's motion."""


@dataclass(frozen=True)
class ValidSamples:
    """Where every record that counts holds samples; values there are smoothed block by block, zero elsewhere."""

    run: str
    grid: Grid
    gaps: Gaps
    """On the grid's clock."""
    reach: float
    """How far beyond its ends a gap disturbs [s]."""

    @classmethod
    def of(cls, run: AlignedRun, groups: Collection[str], bandwidth_hz: float) -> "ValidSamples":
        """Of the encoders, positions smoothed below ``bandwidth_hz``, and of other ``groups`` by their clocks."""
        return cls(run.name, run.grid, run.gaps(groups), gap_reach(bandwidth_hz))

    @property
    def left_out(self) -> list[slice]:
        """The samples that gaps touch, gap by gap."""
        return true_segments(self.kept == 0.0)

    @cached_property
    def kept(self) -> Floats:
        """One where nothing is left out, else zero, (n,) [-]."""
        return self.gaps.valid_samples(self.grid, self.reach).astype(float)

    def low_pass(self, values: Floats, cutoff: float) -> Floats:
        """Values (n, ...) smoothed below a cut-off [Hz]; zero where they are left out."""
        flat = values.reshape(len(values), -1)
        smooth = self.gaps.by_segment(lambda part: low_pass(part, cutoff, self.grid.rate), flat, self.grid, self.reach)
        return (smooth * self.kept[:, None]).reshape(values.shape)

    def rates(self, values: Floats) -> Floats:
        """Rates (n, k) [1/s] by central differences; smoothed later with everything else."""
        return self.gaps.by_segment(
            lambda part: np.gradient(part, self.grid.step, axis=0), values, self.grid, self.reach
        )

    def refuse_no_motion(self, path: Trajectory) -> None:
        """Raise AnalysisError where the gaps leave no motion."""
        if self.gaps and not any(np.ptp(path.q[s], axis=0).max() > MOVES for s in true_segments(self.kept > 0.0)):
            raise NoValidMotion(
                f"{self.run}: {'; '.join(self.gaps.texts(self.reach))}: nothing of its motion is left; give another run"
            )

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is left out, a finding for each record."""
        return self.gaps.findings(self.run, self.reach)
