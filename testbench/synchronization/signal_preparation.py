"""Common signals of two loggers made ready for a fit: even grids, one low-pass, orthonormal columns, whitening.

Whitening is by an autoregression r_t = a_1 r_(t-1) + ... + a_p r_(t-p) + e_t of the residual, by least squares; the
filter (1, -a_1, ..., -a_p) makes white e of r, and both sides of the fit pass it (Cochrane and Orcutt, JASA 44, 1949),
so that frequencies of little noise have more weight. The quantization of an encoder, differentiated twice, is the case
in point: large at the highest frequencies, where motions have little content.
"""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats, Mask
from balance.results import instant_text

from ..errors import AnalysisError
from ..kinematics.gaps import gap_spans
from ..kinematics.smoothing_and_derivatives import HIGHEST_CUTOFF, Grid, low_pass

CUTOFF_SHARE = 0.2
"""Of the slower sampling rate: the highest frequency that is compared by default."""
OVERSAMPLING = 8.0
"""Samples in a period of the highest frequency compared; signals of a higher rate are decimated."""
LEAST_SHARE = 0.02
"""Of the strongest direction among columns, below which one is mostly noise."""
LEAST_SAMPLES = 64
LARGEST_STEP = 10.0
"""Longest step between samples, in median steps, that is bridged; longer ones are gaps."""
GAP_PERIODS = 2.0
"""How far beyond its ends a gap disturbs what is low-passed, in periods of the highest frequency compared."""


@dataclass(frozen=True)
class SharedSignals:
    """Signals of the own clock, each a constant plus a combination of the reference's columns plus a fixed part."""

    name: str
    reference_time: Floats
    """Recorded instants, (n,) [s]."""
    reference_columns: tuple[Floats, ...]
    """For each signal of the own clock, the columns that combine to it, (n, k) each."""
    own_time: Floats
    """Recorded instants, (m,) [s]."""
    own_signals: Floats
    """(m, signals)"""
    signed: bool = False
    """One column a signal, of the same sign: an opposite one is no match."""
    cutoff: float | None = None
    """Highest frequency that is compared [Hz]; by the sampling rates unless given."""
    fixed: Floats | None = None
    """A part of the signals of known size, on the reference's clock, (n, signals)."""
    partial: bool = False
    """Another motion, of unknown size, is in one side: the residual may bias the offset."""
    fixed_time_deviation: float = 0.0
    """Standard deviation of the time of the fixed part [s]."""
    own_nuisance: Floats | None = None
    """Nuisance columns, with factors of their own in every signal, on the own clock, (m, k)."""
    reference_nuisance: Floats | None = None
    """Nuisance columns on the reference's clock, (n, k)."""
    gaps: Floats | None = None
    """Start and end of gaps that the reference's columns bridge, (g, 2) [s]."""
    caution: str = ""
    """What else may be in one side, where it is not the same: said where they determine nothing."""


@dataclass(frozen=True)
class PreparedSignals:
    """Common signals on even grids, low-passed at one cut-off, means removed, the columns of a signal orthonormal."""

    name: str
    cutoff: float
    """[Hz]"""
    signed: bool
    partial: bool
    fixed_time_deviation: float
    reference: Grid
    reference_columns: tuple[Floats, ...]
    fixed: Floats
    """Zero where nothing is."""
    reference_nuisance: Floats
    """Of unit mean square, (n, k)."""
    gaps: Floats
    """Of the reference, start and end, (g, 2) [s]."""
    own: Grid
    own_signals: Floats
    own_nuisance: Floats
    """Of unit mean square, (m, k)."""
    own_gaps: Floats
    """Of the own record, (g, 2) [s]."""

    @property
    def valid(self) -> Mask:
        """Own samples that no gap of the own record disturbs, (m,) [-]."""
        return ~self.in_own_gap(self.own.time)

    def in_own_gap(self, instants: Floats) -> Mask:
        """Instants (m,) [s] of the own clock that a gap of the own record disturbs, (m,) [-]."""
        return self._disturbed(self.own_gaps, instants)

    def in_gap(self, instants: Floats) -> Mask:
        """Instants (n,) [s] of the reference's clock that a gap of its record disturbs, (n,) [-]."""
        return self._disturbed(self.gaps, instants)

    def _disturbed(self, gaps: Floats, instants: Floats) -> Mask:
        reach = GAP_PERIODS / self.cutoff
        near = [(instants > begin - reach) & (instants < end + reach) for begin, end in gaps]
        return np.any(near, axis=0) if near else np.zeros(len(instants), dtype=bool)

    @property
    def findings(self) -> tuple[str, ...]:
        """Gaps that are masked, as text."""
        sides = {"the reference's record": self.gaps, "its own record": self.own_gaps}
        return tuple(
            f"{self.name}: {len(found)} gap{'s' if len(found) > 1 else ''} in {side}, "
            f"{np.sum(found[:, 1] - found[:, 0]):.4g} s in all, the first after {instant_text(found[0, 0])} s: "
            f"left out, with {GAP_PERIODS / self.cutoff:.3g} s about each"
            for side, found in sides.items()
            if len(found)
        )


def prepare(shared: SharedSignals) -> PreparedSignals:
    """Both sides on even grids. Raises AnalysisError where one of them does not change, or the cut-off is too high."""
    own, reference = (even_grid(t, shared.name) for t in (shared.own_time, shared.reference_time))
    rate = min(own.rate, reference.rate)
    cutoff = shared.cutoff or CUTOFF_SHARE * rate
    if cutoff > HIGHEST_CUTOFF * rate:
        raise AnalysisError(
            f"{shared.name}: nothing can be compared up to {cutoff:g} Hz at {rate:g} samples per second: expected at "
            f"most {HIGHEST_CUTOFF * rate:g} Hz"
        )
    here, there = (shared.name, shared.own_time, own, cutoff), (shared.name, shared.reference_time, reference, cutoff)
    own_signals = _smooth(shared.own_signals, *here)
    columns = [_smooth(c, *there) for c in shared.reference_columns]
    if not (np.ptp(own_signals, axis=0) > 0.0).all() or not all(np.ptp(c, axis=0).max() > 0.0 for c in columns):
        raise AnalysisError(f"{shared.name}: one of the two never changes: name channels that both recorded the motion")
    nothing = np.zeros((len(shared.reference_time), shared.own_signals.shape[1]))
    fixed = _smooth(nothing if shared.fixed is None else shared.fixed, *there)
    every, other = (max(1, int(grid.rate / (OVERSAMPLING * cutoff))) for grid in (own, reference))
    return PreparedSignals(
        shared.name,
        cutoff,
        shared.signed,
        shared.partial,
        shared.fixed_time_deviation,
        _thinned(reference, other),
        tuple(_basis(c)[::other].copy() for c in columns),
        fixed[::other].copy(),
        _unit(shared.reference_nuisance, *there)[::other].copy(),
        gap_spans(np.sort(shared.reference_time), LARGEST_STEP) if shared.gaps is None else shared.gaps,
        _thinned(own, every),
        own_signals[::every].copy(),
        _unit(shared.own_nuisance, *here)[::every].copy(),
        gap_spans(np.sort(shared.own_time), LARGEST_STEP),
    )


def even_grid(time: Floats, what: str) -> Grid:
    """The even grid over recorded instants (n,) [s], of their mean step; instants may scatter about it."""
    if len(time) < LEAST_SAMPLES or not np.isfinite(time).all():
        raise AnalysisError(
            f"{what}: {len(time)} instants, or some that are no numbers: expected at least {LEAST_SAMPLES} to align by"
        )
    span = float(time.max() - time.min())
    if not span > 0.0:
        raise AnalysisError(f"{what}: its clock stands still")
    return Grid(float(time.min()), span / (len(time) - 1), len(time))


def _thinned(grid: Grid, stride: int) -> Grid:
    return Grid(grid.start, grid.step * stride, (grid.count + stride - 1) // stride)


def _smooth(values: Floats, name: str, time: Floats, grid: Grid, cutoff: float) -> Floats:
    """Values (n, k) at scattered instants (n,) on a grid, low-passed, mean removed."""
    if not np.isfinite(values).all():
        raise AnalysisError(f"{name}: samples that are no numbers cannot be aligned: repair the channel first")
    order = np.argsort(time, kind="stable")
    even = np.column_stack([np.interp(grid.time, time[order], v[order]) for v in values.T])
    smooth = low_pass(even - even.mean(axis=0), cutoff, grid.rate)
    return smooth - smooth.mean(axis=0)


def _unit(values: Floats | None, name: str, time: Floats, grid: Grid, cutoff: float) -> Floats:
    """Smoothed, of unit mean square; (count, 0) where there is none."""
    if values is None or not values.shape[1]:
        return np.zeros((grid.count, 0))
    smooth = _smooth(values, name, time, grid, cutoff)
    return smooth / np.maximum(smooth.std(axis=0), 1e-300)


def _basis(columns: Floats) -> Floats:
    """Significant directions of columns (n, k), orthogonal, of unit mean square, (n, r)."""
    left, values, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0).max(), full_matrices=False)
    kept = left[:, values > LEAST_SHARE * values[0]] * np.sqrt(len(columns))
    return kept * np.sign(kept[:, 0] @ columns[:, 0]) if columns.shape[1] == 1 else kept


PERIODS = 4.0
"""Length of the filter, in periods of the highest frequency compared."""
FLOOR = 1e-2
"""White noise added to the residual, as a share of its power: limits the gain at frequencies without content."""
LEAST_ROWS = 8
"""Least number of samples per estimated coefficient."""
MOST_ROWS = 200_000
"""Largest number of samples; more are decimated."""


def whitener(residual: Floats, used: Mask, longest: int) -> Floats:
    """Filter (p + 1,) [-] that whitens a residual (n,) [any unit] at ``used`` samples (n,) [-]; p <= ``longest``."""
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
    """Values (n, ...) [any unit] filtered along the first axis by ``taps`` (p + 1,) [-]; the first p lack history."""
    from scipy.signal import lfilter

    return np.asarray(lfilter(taps, [1.0], values, axis=0)) if len(taps) > 1 else values


def with_history(used: Mask, order: int) -> Mask:
    """Samples (n,) [-] before which ``order`` others are ``used`` (n,) too."""
    count = np.cumsum(np.r_[0, used])
    found = np.zeros(len(used), dtype=bool)
    found[order:] = count[order + 1 :] - count[: max(len(used) - order, 0)] == order + 1
    return found
