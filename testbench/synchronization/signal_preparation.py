"""What two loggers both saw: signals of the one clock that make up those of the other, low-passed alike.

Residuals made white: an autoregression of what a fit leaves, so that what is quiet counts more than what is loud.

r_t = a_1 r_(t-1) + ... + a_p r_(t-p) + e_t by least squares; the filter (1, -a_1, ..., -a_p) makes e of r, and both
sides of the fit go through it (Cochrane and Orcutt, JASA 44, 1949). Steps of an encoder, differentiated twice, are the
case in point: loud at the highest frequencies, where motions say little.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats

from ..errors import AnalysisError
from ..kinematics.smoothing_and_derivatives import HIGHEST_CUTOFF, Grid, low_pass

Flags = NDArray[np.bool_]

CUTOFF_SHARE = 0.2
"""Of the slower sampling rate: the highest frequency that is compared where none is asked for."""
OVERSAMPLING = 8.0
"""Samples in a period of the highest frequency that is compared; more are thinned out."""
LEAST_SHARE = 0.02
"""Of the strongest direction among columns, below which one is mostly noise."""
LEAST_SAMPLES = 64
LARGEST_STEP = 10.0
"""Longest step between samples, in median steps, that is bridged; longer ones are gaps."""
GAP_PERIODS = 2.0
"""How far beyond its ends a gap disturbs what is low-passed, in periods of the highest frequency compared."""


@dataclass(frozen=True)
class Shared:
    """Every signal of the own clock is a constant, a combination of the reference's columns, and a fixed part."""

    name: str
    reference_time: Floats
    """Recorded instants, (n,) [s]."""
    columns: tuple[Floats, ...]
    """For each signal of the own clock, what makes it up, (n, k) each."""
    own_time: Floats
    """Recorded instants, (m,) [s]."""
    seen: Floats
    """(m, signals)"""
    signed: bool = False
    """One column a signal, of the same sign: an opposite one is no match."""
    cutoff: float | None = None
    """Highest frequency that is compared [Hz]; by the sampling rates unless given."""
    fixed: Floats | None = None
    """A part of the signals that is known to its size, on the reference's clock, (n, signals)."""
    partial: bool = False
    """Something else, of no known size, moves one side along: what stays unexplained may shift the answer."""
    fixed_doubt: float = 0.0
    """Standard deviation of when the fixed part happened [s]."""
    beside: Floats | None = None
    """What a model of the columns may lack: it moves every signal by factors of its own; on the own clock, (m, k)."""
    along: Floats | None = None
    """The same on the reference's clock, (n, k)."""
    gaps: Floats | None = None
    """Where the reference's columns are bridged and known to nobody, from and to, (g, 2) [s]."""


@dataclass(frozen=True)
class Prepared:
    """The same on even grids, low-passed at one cut-off, means removed, the columns of a signal orthonormal."""

    name: str
    cutoff: float
    """[Hz]"""
    reference: Grid
    columns: tuple[Floats, ...]
    fixed: Floats
    """Zero where nothing is."""
    own: Grid
    seen: Floats
    signed: bool
    partial: bool
    fixed_doubt: float
    beside: Floats
    """Of unit mean square, (m, k)."""
    along: Floats
    """(n, k)"""
    gaps: Floats
    """Of the reference, from and to, (g, 2) [s]."""
    own_gaps: Floats

    @property
    def sound(self) -> Flags:
        """Own samples that no gap of the own record disturbs, (m,)."""
        return ~self.in_own_gap(self.own.time)

    def in_own_gap(self, instants: Floats) -> Flags:
        """Which instants (m,) of the own clock a gap of the own record disturbs."""
        return self._disturbed(self.own_gaps, instants)

    def in_gap(self, instants: Floats) -> Flags:
        """Which instants (n,) of the reference's clock a gap of its record disturbs."""
        return self._disturbed(self.gaps, instants)

    def _disturbed(self, gaps: Floats, instants: Floats) -> Flags:
        reach = GAP_PERIODS / self.cutoff
        found = np.zeros(len(instants), dtype=bool)
        for begin, end in gaps:
            found |= (instants > begin - reach) & (instants < end + reach)
        return found

    @property
    def findings(self) -> tuple[str, ...]:
        """Gaps, which are left out."""
        sides = {"the reference's record": self.gaps, "its own record": self.own_gaps}
        return tuple(
            f"{self.name}: {len(found)} gap{'s' if len(found) > 1 else ''} in {side}, "
            f"{np.sum(found[:, 1] - found[:, 0]):.4g} s in all, the first after {found[0, 0]:.6g} s: left out, with "
            f"{GAP_PERIODS / self.cutoff:.3g} s about each"
            for side, found in sides.items()
            if len(found)
        )


def prepare(shared: Shared) -> Prepared:
    """Carry both sides over to even grids. Raises AnalysisError where one of them holds nothing that changes."""
    own, reference = (even_grid(t, shared.name) for t in (shared.own_time, shared.reference_time))
    rate = min(own.rate, reference.rate)
    cutoff = shared.cutoff or CUTOFF_SHARE * rate
    if cutoff > HIGHEST_CUTOFF * rate:
        raise AnalysisError(
            f"{shared.name}: nothing can be compared up to {cutoff:g} Hz at {rate:g} samples per second: expected at "
            f"most {HIGHEST_CUTOFF * rate:g} Hz"
        )
    seen = _smooth(shared.name, shared.own_time, shared.seen, own, cutoff)
    columns = [_smooth(shared.name, shared.reference_time, c, reference, cutoff) for c in shared.columns]
    zero = np.zeros((len(shared.reference_time), shared.seen.shape[1]))
    fixed = _smooth(
        shared.name, shared.reference_time, zero if shared.fixed is None else shared.fixed, reference, cutoff
    )
    if not (np.ptp(seen, axis=0) > 0.0).all() or not all(np.ptp(c, axis=0).max() > 0.0 for c in columns):
        raise AnalysisError(f"{shared.name}: one of the two never changes, so that there is nothing that both saw")
    bases = tuple(_thin(_basis(c), reference, cutoff) for c in columns)
    return Prepared(
        shared.name,
        cutoff,
        _thinned(reference, cutoff),
        bases,
        _thin(fixed, reference, cutoff),
        _thinned(own, cutoff),
        _thin(seen, own, cutoff),
        shared.signed,
        shared.partial,
        shared.fixed_doubt,
        _thin(_unit(shared.name, shared.own_time, shared.beside, own, cutoff), own, cutoff),
        _thin(_unit(shared.name, shared.reference_time, shared.along, reference, cutoff), reference, cutoff),
        gaps(shared.reference_time) if shared.gaps is None else shared.gaps,
        gaps(shared.own_time),
    )


def even_grid(time: Floats, what: str) -> Grid:
    """The even grid over recorded instants (n,) [s], of their mean step; they may scatter about it."""
    if len(time) < LEAST_SAMPLES or not np.isfinite(time).all():
        raise AnalysisError(
            f"{what}: {len(time)} instants, or some that are no numbers: expected at least {LEAST_SAMPLES} to align by"
        )
    span = float(time.max() - time.min())
    if not span > 0.0:
        raise AnalysisError(f"{what}: its clock stands still")
    return Grid(float(time.min()), span / (len(time) - 1), len(time))


def gaps(time: Floats, largest: float = LARGEST_STEP) -> Floats:
    """From and to of steps between instants (n,) [s] that are longer than ``largest`` median ones, (g, 2) [s]."""
    ordered = np.sort(time)
    steps = np.diff(ordered)
    wide = np.flatnonzero(steps > largest * np.median(steps))
    return np.column_stack([ordered[wide], ordered[wide + 1]])


def _smooth(name: str, time: Floats, values: Floats, grid: Grid, cutoff: float) -> Floats:
    """Values (n, k) at scattered instants (n,), on a grid, without what is above the cut-off."""
    if not np.isfinite(values).all():
        raise AnalysisError(f"{name}: samples that are no numbers cannot be aligned: repair the channel first")
    order = np.argsort(time, kind="stable")
    even = np.column_stack([np.interp(grid.time, time[order], v[order]) for v in values.T])
    smooth = low_pass(even - even.mean(axis=0), cutoff, grid.rate)
    return smooth - smooth.mean(axis=0)


def _unit(name: str, time: Floats, values: Floats | None, grid: Grid, cutoff: float) -> Floats:
    """Smoothed, of unit mean square; (count, 0) where there is none."""
    if values is None or not values.shape[1]:
        return np.zeros((grid.count, 0))
    smooth = _smooth(name, time, values, grid, cutoff)
    return smooth / np.maximum(smooth.std(axis=0), 1e-300)


def _basis(columns: Floats) -> Floats:
    """Directions of columns (n, k) that stand out, orthogonal, of unit mean square, (n, r)."""
    left, values, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0).max(), full_matrices=False)
    kept = left[:, values > LEAST_SHARE * values[0]] * np.sqrt(len(columns))
    return kept * np.sign(kept[:, 0] @ columns[:, 0]) if columns.shape[1] == 1 else kept


def _stride(grid: Grid, cutoff: float) -> int:
    return max(1, int(grid.rate / (OVERSAMPLING * cutoff)))


def _thin(values: Floats, grid: Grid, cutoff: float) -> Floats:
    return np.ascontiguousarray(values[:: _stride(grid, cutoff)])


def _thinned(grid: Grid, cutoff: float) -> Grid:
    stride = _stride(grid, cutoff)
    return Grid(grid.start, grid.step * stride, (grid.count + stride - 1) // stride)


PERIODS = 4.0
"""Length of the filter, in periods of the highest frequency compared."""
FLOOR = 1e-2
"""Of the residual's power, as white noise added to it: keeps frequencies that hold nothing from being blown up."""
LEAST_ROWS = 8
"""Samples for each coefficient that is estimated."""
MOST_ROWS = 200_000
"""More samples are thinned out."""


def whitener(residual: Floats, used: Flags, longest: int) -> Floats:
    """The filter (p + 1,) that whitens the residual (n,) at ``used`` samples, of at most ``longest`` coefficients."""
    power = float(np.mean(residual[used] ** 2))
    order = min(longest, int(np.count_nonzero(used)) // LEAST_ROWS)
    rows = np.flatnonzero(with_history(used, order))
    if order < 1 or not power > 0.0 or len(rows) < LEAST_ROWS * order // 2:
        return np.ones(1)
    rows = rows[:: 1 + len(rows) // MOST_ROWS]
    past = residual[rows[:, None] - np.arange(1, order + 1)]
    normal = past.T @ past + FLOOR * power * len(rows) * np.eye(order)
    return np.r_[1.0, -np.linalg.solve(normal, past.T @ residual[rows])]


def whitened(values: Floats, taps: Floats) -> Floats:
    """Values (n, ...) behind the filter, along the first axis; the first p of a stretch lack history."""
    from scipy.signal import lfilter

    return np.asarray(lfilter(taps, [1.0], values, axis=0)) if len(taps) > 1 else values


def with_history(used: Flags, order: int) -> Flags:
    """Samples before which ``order`` others are used too, (n,)."""
    count = np.cumsum(np.r_[0, used])
    found = np.zeros(len(used), dtype=bool)
    found[order:] = count[order + 1 :] - count[: max(len(used) - order, 0)] == order + 1
    return found
