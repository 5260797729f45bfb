"""Gaps of the records that an analysis rests on: what lies on either side is smoothed apart, what they touch left out.

A low-pass takes what it does not know beyond the end of a stretch from what it does know, by a rule that is linear. Run
over measured values and over the columns that explain them alike, stretch by stretch, it so changes nothing between
them. Only positions, which the columns are made of, are uncertain near a gap: REACH_PERIODS of their bandwidth.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats

from ..recording import Finding
from .smoothing_and_derivatives import LARGEST_STEP, Grid, Rates, smoothed_derivatives

REACH_PERIODS = 2.0
"""How far beyond its ends a gap disturbs positions that are smoothed, in periods of their bandwidth."""
LEAST_SAMPLES = 16
"""Of a stretch between gaps that counts."""
CODE = "time_gap"


def wide_steps(time: Floats, largest: float = LARGEST_STEP) -> Floats:
    """From and to of steps between instants (n,) [s] that are longer than ``largest`` median ones, (g, 2) [s]."""
    steps = np.diff(time)
    wide = np.flatnonzero(steps > largest * np.median(steps)) if len(steps) else np.zeros(0, dtype=np.intp)
    return np.column_stack([time[wide], time[wide + 1]])


@dataclass(frozen=True)
class Gaps:
    """Where records hold no samples, on one clock."""

    spans: Mapping[str, Floats] = field(default_factory=dict)
    """From and to by the record's name, (g, 2) each [s]; records without a gap are left away."""

    @classmethod
    def of(cls, records: Mapping[str, Floats]) -> "Gaps":
        """Of records by name: their instants on the one clock, (n,) each [s]."""
        found = {name: wide_steps(time) for name, time in records.items()}
        return cls({name: spans for name, spans in found.items() if len(spans)})

    def __bool__(self) -> bool:
        return bool(self.spans)

    def sound(self, grid: Grid, reach: float = 0.0) -> NDArray[np.bool_]:
        """Which samples of a grid are recorded and ``reach`` [s] away from any gap, in stretches of LEAST_SAMPLES."""
        kept = np.ones(grid.count, dtype=bool)
        margin = reach - 0.5 * grid.step
        for begin, end in (span for spans in self.spans.values() for span in spans):
            kept &= (grid.time <= begin - margin) | (grid.time >= end + margin)
        for part in true_segments(kept):
            if part.stop - part.start < LEAST_SAMPLES and self:
                kept[part] = False
        return kept

    def apart(self, work: Callable[[Floats], Floats], values: Floats, grid: Grid, reach: float = 0.0) -> Floats:
        """``work`` done on each stretch of ``values`` (n, ...) by itself; what gaps touch stays as it is."""
        if not self:
            return work(values)
        done = np.array(values, dtype=float)
        for part in true_segments(self.sound(grid, reach)):
            done[part] = work(values[part])
        return done

    def rates(self, position: Floats, cutoff: float, grid: Grid) -> Rates:
        """Positions (n, joints) smoothed and differentiated stretch by stretch; in gaps straight lines."""
        if not self:
            return smoothed_derivatives(position, cutoff, grid.rate)
        speed = np.gradient(position, grid.step, axis=0)
        whole = Rates(position.copy(), speed, np.zeros_like(position))
        for part in true_segments(self.sound(grid)):
            own = smoothed_derivatives(position[part], cutoff, grid.rate)
            whole.q[part], whole.v[part], whole.a[part] = own.q, own.v, own.a
        return whole

    def findings(self, run: str, reach: float) -> tuple[Finding, ...]:
        """One for each record: how much is left out, and where."""
        return tuple(Finding(CODE, None, run, f"{run}: {text}") for text in self.texts(reach))

    def texts(self, reach: float) -> list[str]:
        """What is left out of each record."""
        return [f"{text}: left out, with {reach:.3g} s about each" for text in self.described]

    @property
    def described(self) -> list[str]:
        """How many gaps each record has, how long and where."""
        return [
            f"{len(spans)} gap{'s' if len(spans) > 1 else ''} in the record of {name}, "
            f"{np.sum(spans[:, 1] - spans[:, 0]):.4g} s in all, the first after {spans[0, 0]:.6g} s"
            for name, spans in self.spans.items()
        ]


def longest_segment(kept: NDArray[np.bool_]) -> slice:
    """The longest stretch in which something holds."""
    return max(true_segments(kept), key=lambda part: part.stop - part.start, default=slice(0, 0))


def reach_of(bandwidth_hz: float) -> float:
    """How far beyond its ends a gap disturbs positions smoothed below a bandwidth [s]."""
    return REACH_PERIODS / bandwidth_hz


def true_segments(kept: NDArray[np.bool_]) -> list[slice]:
    """The stretches in which something holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], kept, [False]])))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
