"""What two loggers both saw: signals of the one clock that make up those of the other, low-passed alike."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from ..derivatives import HIGHEST_CUTOFF, Grid, low_pass
from ..errors import AnalysisError

CUTOFF_SHARE = 0.2
"""Of the slower sampling rate: the highest frequency that is compared where none is asked for."""
OVERSAMPLING = 8.0
"""Samples in a period of the highest frequency that is compared; more are thinned out."""
LEAST_SHARE = 0.02
"""Of the strongest direction among columns, below which one is mostly noise."""
LEAST_SAMPLES = 64


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
    modelled: bool = False
    """The one side follows from the other by a model, which may lack something that moves along."""
    fixed_doubt: float = 0.0
    """Standard deviation of when the fixed part happened [s]."""


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
    modelled: bool
    fixed_doubt: float


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
        shared.modelled,
        shared.fixed_doubt,
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


def _smooth(name: str, time: Floats, values: Floats, grid: Grid, cutoff: float) -> Floats:
    """Values (n, k) at scattered instants (n,), on a grid, without what is above the cut-off."""
    if not np.isfinite(values).all():
        raise AnalysisError(f"{name}: samples that are no numbers cannot be aligned: repair the channel first")
    order = np.argsort(time, kind="stable")
    even = np.column_stack([np.interp(grid.time, time[order], v[order]) for v in values.T])
    smooth = low_pass(even - even.mean(axis=0), cutoff, grid.rate)
    return smooth - smooth.mean(axis=0)


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
