"""Gaps of the records that an analysis uses: segments between gaps are processed one by one, samples near gaps masked.

A low-pass extrapolates beyond the end of a segment by a linear rule. Applied to measured values and to regressor
columns alike, segment by segment, it leaves the regression between them unchanged. Only positions, from which the
columns are computed, are uncertain near a gap: within REACH_PERIODS of their bandwidth.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.results import instant_text

from ..recording import Finding
from .smoothing_and_derivatives import LARGEST_STEP, Grid, Rates, low_pass, smoothed_derivatives

REACH_PERIODS = 2.0
"""How far beyond its ends a gap disturbs positions that are smoothed, in periods of their bandwidth."""
LEAST_SEGMENT_SAMPLES = 16
"""Samples of the shortest segment between gaps that is used."""
GAP_FINDING = "time_gap"


def gap_spans(time: Floats, largest: float = LARGEST_STEP) -> Floats:
    """Start and end of steps between instants (n,) [s] that are longer than ``largest`` median steps, (g, 2) [s]."""
    steps = np.diff(time)
    wide = np.flatnonzero(steps > largest * np.median(steps)) if len(steps) else np.zeros(0, dtype=np.intp)
    return np.column_stack([time[wide], time[wide + 1]])


@dataclass(frozen=True)
class Gaps:
    """Where records hold no samples, on one clock."""

    spans: Mapping[str, Floats] = field(default_factory=dict)
    """Start and end of each gap by the record's name, (g, 2) [s]; records without a gap are not listed."""

    @classmethod
    def of(cls, records: Mapping[str, Floats]) -> "Gaps":
        """Gaps of records by name: their instants on one clock, (n,) each [s]."""
        found = {name: gap_spans(time) for name, time in records.items()}
        return cls({name: spans for name, spans in found.items() if len(spans)})

    def __bool__(self) -> bool:
        return bool(self.spans)

    def valid_samples(self, grid: Grid, reach: float = 0.0) -> NDArray[np.bool_]:
        """Samples of a grid that lie ``reach`` [s] or more from any gap, (n,) [-].

        Segments shorter than LEAST_SEGMENT_SAMPLES between gaps are not valid.
        """
        valid = np.ones(grid.count, dtype=bool)
        margin = reach - 0.5 * grid.step
        for begin, end in (span for spans in self.spans.values() for span in spans):
            valid &= (grid.time <= begin - margin) | (grid.time >= end + margin)
        for part in true_segments(valid):
            if part.stop - part.start < LEAST_SEGMENT_SAMPLES and self:
                valid[part] = False
        return valid

    def by_segment(self, work: Callable[[Floats], Floats], values: Floats, grid: Grid, reach: float = 0.0) -> Floats:
        """``work`` applied to each valid segment of ``values`` (n, ...) [any unit]; other samples stay unchanged."""
        if not self:
            return work(values)
        done = np.array(values, dtype=float)
        for part in true_segments(self.valid_samples(grid, reach)):
            done[part] = work(values[part])
        return done

    def derivatives(self, position: Floats, cutoff: float, grid: Grid) -> Rates:
        """Positions (n, joints) [rad, m] smoothed and differentiated segment by segment; in gaps straight lines.

        ``cutoff`` in Hz.
        """
        if not self:
            return smoothed_derivatives(position, cutoff, grid.rate)
        speed = np.gradient(position, grid.step, axis=0)
        whole = Rates(position.copy(), speed, np.zeros_like(position))
        for part in true_segments(self.valid_samples(grid)):
            own = smoothed_derivatives(position[part], cutoff, grid.rate)
            whole.q[part], whole.v[part], whole.a[part] = own.q, own.v, own.a
        return whole

    def findings(self, run: str, reach: float) -> tuple[Finding, ...]:
        """One for each record with gaps: how much is masked, and where."""
        return tuple(Finding(GAP_FINDING, None, run, f"{run}: {text}") for text in self.texts(reach))

    def texts(self, reach: float) -> list[str]:
        """What is masked in each record, as text."""
        return [f"{text}: left out, with {reach:.3g} s about each" for text in self.descriptions]

    @property
    def descriptions(self) -> list[str]:
        """How many gaps each record has, how long and where, as text."""
        return [
            f"{len(spans)} gap{'s' if len(spans) > 1 else ''} in the record of {name}, "
            f"{np.sum(spans[:, 1] - spans[:, 0]):.4g} s in all, the first after {instant_text(spans[0, 0])} s"
            for name, spans in self.spans.items()
        ]


@dataclass(frozen=True)
class ValidSamples:
    """Where every record that counts holds samples; values there are smoothed segment by segment, zero elsewhere."""

    run: str
    grid: Grid
    gaps: Gaps
    """On the grid's clock."""
    reach: float
    """How far beyond its ends a gap disturbs [s]."""

    @property
    def left_out(self) -> list[slice]:
        """The samples that gaps touch, gap by gap."""
        return true_segments(self.kept == 0.0)

    @cached_property
    def kept(self) -> Floats:
        """One where nothing is left out, else zero, (n,) [-]."""
        return self.gaps.valid_samples(self.grid, self.reach).astype(float)

    def low_pass(self, values: Floats, cutoff: float) -> Floats:
        """Values (n, ...) [any unit] smoothed below a cut-off [Hz]; zero where they are left out."""
        flat = values.reshape(len(values), -1)
        smooth = self.gaps.by_segment(lambda part: low_pass(part, cutoff, self.grid.rate), flat, self.grid, self.reach)
        return (smooth * self.kept[:, None]).reshape(values.shape)

    def rates(self, values: Floats) -> Floats:
        """Rates (n, k) [1/s] by central differences; smoothed later with everything else."""
        step = self.grid.step
        return self.gaps.by_segment(lambda part: np.gradient(part, step, axis=0), values, self.grid, self.reach)

    @property
    def texts(self) -> str:
        """What is left out of each record."""
        return "; ".join(self.gaps.texts(self.reach))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The same, a finding for each record."""
        return self.gaps.findings(self.run, self.reach)


def longest_segment(mask: NDArray[np.bool_]) -> slice:
    """The longest run of true samples of a mask (n,) [-]; empty where none is true."""
    return max(true_segments(mask), key=lambda part: part.stop - part.start, default=slice(0, 0))


def gap_reach(bandwidth_hz: float) -> float:
    """How far a gap disturbs positions smoothed below a bandwidth, beyond its ends [s]."""
    return REACH_PERIODS / bandwidth_hz


def true_segments(mask: NDArray[np.bool_]) -> list[slice]:
    """The runs of true samples of a mask (n,) [-], in order."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
