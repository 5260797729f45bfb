"""The parameters of the law, given published numbers: the best fit, and every value that they leave open.

Least squares from several starts gives the best fit. Marginalisation weighs every value by how well it fits, on a grid,
no chain: beforehand every value between a parameter's bounds is equally likely; given what is common to all axes, the
scatter and the law's own error, the axes are independent, and their couples are summed out one by one.

The law's own error is Kennedy and O'Hagan's discrepancy: an offset that the numbers of one payload, motion and axis
share, normal about zero, beside a scatter of each number alone. How large it is, the calibration says: offsets compete
with the law for what the known numbers have in common. Another payload's offsets are drawn anew.
Kennedy, O'Hagan 2001, Bayesian calibration of computer models, J. R. Stat. Soc. B 63.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from testbench.errors import AnalysisError

from .model import AXES, COMMON, DISCREPANCY, NAMES, PARAMETERS, SCATTER, Cases, felt, percent, reductions

STARTS = 12
_SAME = 1e-3
"""Share of the smallest sum of squares by which other starts may end above it and count as ended alike."""
CELLS = (14, 10, 10)
"""Cells of the grid along the common parameters; zoomed once onto where the weight lies."""
COUPLES = 16
SCATTERS = 10
DISCREPANCIES = 10
SAMPLES = 8000
LEVEL = 0.95
_SEED = 20191120
_NEGLIGIBLE = 1e-4
"""Share of the largest marginal weight below which a cell at the grid's end is cut off when zooming."""


@dataclass(frozen=True)
class Fit:
    """The best fit, and where the starts ended."""

    names: tuple[str, ...]
    """Of the free parameters; the others are zero."""
    values: Floats
    """(k,), in the parameters' units."""
    errors: Floats
    """Fitted - printed, (n,) [percentage points]."""
    starts: int
    alike: int
    """Starts that ended at the same sum of squares."""
    ranges: Floats
    """Smallest and largest value of each parameter among those, (k, 2): wide where the numbers leave it open."""

    def predict(self, cases: Cases) -> Floats:
        """Reductions [%], (n,)."""
        return reductions(dict(zip(self.names, self.values, strict=True)), cases)


def fit(cases: Cases, names: Sequence[str] = NAMES, starts: int = STARTS) -> Fit:
    """Fit the named parameters within their bounds. Raises AnalysisError if no start converges."""
    from scipy.optimize import least_squares

    free = [p for p in PARAMETERS if p.name in names]
    low, high = (np.array([getattr(p, side) for p in free]) for side in ("low", "high"))

    def residuals(share: Floats) -> Floats:
        return reductions(dict(zip(order, low + share * (high - low), strict=True)), cases) - cases.printed

    order = tuple(p.name for p in free)
    rng = np.random.default_rng(_SEED)
    ended = [
        least_squares(residuals, start, bounds=(0.0, 1.0)) for start in rng.uniform(0.05, 0.95, (starts, len(free)))
    ]
    ended = [end for end in ended if end.success]
    if not ended:
        raise AnalysisError(f"none of {starts} starts of the calibration converged on {len(cases.printed)} numbers")
    least = min(float(end.cost) for end in ended)
    alike = [end for end in ended if end.cost <= least * (1.0 + _SAME)]
    best = alike[0]  # of equals the first start's, not the one that rounding favours
    ends = np.array([end.x for end in alike])
    ranges = low[:, None] + np.stack([ends.min(axis=0), ends.max(axis=0)], axis=1) * (high - low)[:, None]
    return Fit(order, low + best.x * (high - low), residuals(best.x), starts, len(alike), ranges)


@dataclass(frozen=True)
class Posterior:
    """Parameters drawn by their weight, in the parameters' units, (SAMPLES,) each; scatter and discrepancy last."""

    samples: dict[str, Floats]

    def predict(self, cases: Cases) -> tuple[Floats, Floats]:
        """Median of the law's reductions [%], (n,), and intervals of 95 % for a printed number, (n, 2).

        The intervals hold what the known numbers leave open of the law, its own error and the scatter.
        """
        found = reductions({name: self.samples[name] for name in NAMES}, cases)
        rng = np.random.default_rng(_SEED)
        groups = cases.groups
        offsets = self.samples[DISCREPANCY.name][:, None] * rng.standard_normal((len(found), groups.shape[1]))
        scatter = self.samples[SCATTER.name][:, None] * rng.standard_normal(found.shape)
        tails = [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0]
        return np.median(found, axis=0), np.quantile(found + offsets @ groups.T + scatter, tails, axis=0).T

    def interval(self, name: str) -> tuple[float, float, float]:
        """Median and the ends of the interval of 95 % of a parameter."""
        middle, low, high = np.quantile(self.samples[name], [0.5, (1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
        return float(middle), float(low), float(high)


def marginalise(cases: Cases) -> Posterior:
    """The posterior of all parameters, given printed numbers."""
    box = np.array([(p.low, p.high) for p in PARAMETERS])
    box = _Grid.over(box, cases).zoomed()
    return Posterior(_Grid.over(box, cases).drawn())


@dataclass(frozen=True)
class _Grid:
    """Weights on a grid of cell centres within a box, (parameters, 2)."""

    box: Floats
    common: Floats
    """Cell centres of the common parameters, (cells, 3)."""
    couples: Floats
    """Cell centres of the couples, (axes, COUPLES)."""
    errors: list["_Errors"]
    """One an axis."""
    spreads: Floats
    """Scatter and discrepancy of every pair of their cell centres, (pairs, 2) [points]."""

    @classmethod
    def over(cls, box: Floats, cases: Cases) -> "_Grid":
        common = _pairs(*(_centres(ends, n) for ends, n in zip(box[:3], CELLS, strict=True)))
        couples = np.stack([_centres(ends, COUPLES) for ends in box[3:]])
        scatter = np.exp(_centres(np.log([SCATTER.low, SCATTER.high]), SCATTERS))
        discrepancy = _centres(np.array([DISCREPANCY.low, DISCREPANCY.high]), DISCREPANCIES)
        errors = [
            _errors(common, shares, cases.where(cases.axis == axis)) for axis, shares in zip(AXES, couples, strict=True)
        ]
        return cls(box, common, couples, errors, _pairs(scatter, discrepancy))

    @cached_property
    def log_weights(self) -> Floats:
        """Of common parameters and spreads, the couples summed out, (cells, pairs)."""
        return np.stack([sum(_log_sum(e.log_likelihood(*pair)) for e in self.errors) for pair in self.spreads], axis=1)

    def drawn(self) -> dict[str, Floats]:
        """Draw by weight; within a cell every value is as likely."""
        rng = np.random.default_rng(_SEED)
        weights = _normal(self.log_weights.ravel())
        cell, pair = np.unravel_index(rng.choice(len(weights), SAMPLES, p=weights), self.log_weights.shape)
        scatter, discrepancy = self.spreads[pair].T
        columns = [*self.common[cell].T]
        for errors, shares in zip(self.errors, self.couples, strict=True):
            columns.append(shares[_choose(errors.at(cell).log_likelihood(scatter[:, None], discrepancy[:, None]), rng)])
        widths = np.diff(self.box, axis=1)[:, 0] / [*CELLS, *[COUPLES] * len(AXES)]
        within = rng.uniform(-0.5, 0.5, (SAMPLES, len(columns))) * widths
        values = np.stack(columns, axis=1) + within
        step = np.log(SCATTER.high / SCATTER.low) / SCATTERS
        scatter = scatter * np.exp(step * rng.uniform(-0.5, 0.5, SAMPLES))
        step = (DISCREPANCY.high - DISCREPANCY.low) / DISCREPANCIES
        discrepancy = discrepancy + step * rng.uniform(-0.5, 0.5, SAMPLES)
        return dict(zip(NAMES, values.T, strict=True)) | {SCATTER.name: scatter, DISCREPANCY.name: discrepancy}

    def zoomed(self) -> Floats:
        """The part of the box that holds weight."""
        weights = _normal(self.log_weights.ravel()).reshape(*CELLS, -1)
        margins = [weights.sum(axis=tuple(j for j in range(4) if j != i)) for i in range(len(COMMON))]
        drawn = self.drawn()
        for name, ends in zip(NAMES[len(COMMON) :], self.box[len(COMMON) :], strict=True):
            margins.append(np.histogram(drawn[name], COUPLES, tuple(ends))[0] / SAMPLES)
        return np.array([_held(ends, margin) for ends, margin in zip(self.box, margins, strict=True)])


@dataclass(frozen=True)
class _Errors:
    """Sums of errors of one axis over a grid of cells and couples."""

    squares: Floats
    """Of squared errors, (cells, couples) [points^2]."""
    sums: Floats
    """Of the errors of each group that shares an offset, (groups, cells, couples) [points]."""
    counts: Floats
    """Numbers in each group, (groups,)."""

    def at(self, cells: NDArray[np.intp]) -> "_Errors":
        return _Errors(self.squares[cells], self.sums[:, cells], self.counts)

    def log_likelihood(self, scatter: Floats, discrepancy: Floats) -> Floats:
        """Of the errors, normal with variance scatter^2 I + discrepancy^2 within each group, (cells, couples)."""
        squares = self.squares / scatter**2
        determinant = 2.0 * self.counts.sum() * np.log(scatter)
        for total, count in zip(self.sums, self.counts, strict=True):
            grown = scatter**2 + count * discrepancy**2
            squares = squares - (total * discrepancy / scatter) ** 2 / grown
            determinant = determinant + np.log(grown / scatter**2)
        likelihood: Floats = -0.5 * (squares + determinant)
        return likelihood


def _pairs(*lines: Floats) -> Floats:
    """Every combination of the values of some lines, (combinations, lines)."""
    return np.stack([x.ravel() for x in np.meshgrid(*lines, indexing="ij")], axis=1)


def _log_sum(log_weights: Floats) -> Floats:
    """Logarithm of the sum of each row's weights, (rows,)."""
    most = log_weights.max(axis=1, keepdims=True)
    summed: Floats = np.log(np.exp(log_weights - most).sum(axis=1)) + most[:, 0]
    return summed


def _centres(ends: Floats, count: int) -> Floats:
    low, high = ends
    return low + (high - low) * (np.arange(count) + 0.5) / count


def _errors(common: Floats, shares: Floats, cases: Cases) -> _Errors:
    without, balanced = felt(common[:, :1], common[:, 1:2], common[:, 2:], cases)
    groups = cases.groups
    squares = np.empty((len(common), len(shares)))
    sums = np.empty((groups.shape[1], *squares.shape))
    for j, share in enumerate(shares):
        errors = percent(without, balanced + (share * cases.mechanics[:, 2]) ** 2) - cases.printed
        squares[:, j] = (errors**2).sum(axis=1)
        sums[:, :, j] = (errors @ groups).T
    return _Errors(squares, sums, groups.sum(axis=0))


def _normal(log_weights: Floats) -> Floats:
    weights = np.exp(log_weights - log_weights.max())
    return weights / weights.sum()


def _choose(log_weights: Floats, rng: np.random.Generator) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """One column a row, by weight."""
    weights = np.exp(log_weights - log_weights.max(axis=1, keepdims=True))
    summed = np.cumsum(weights, axis=1)
    return np.argmax(summed > rng.uniform(size=(len(summed), 1)) * summed[:, -1:], axis=1)


def _held(ends: Floats, margin: Floats) -> Floats:
    """Ends of the cells that hold weight, one cell more on either side."""
    heavy = np.flatnonzero(margin > _NEGLIGIBLE * margin.max())
    edges = np.linspace(ends[0], ends[1], len(margin) + 1)
    return np.array([edges[max(heavy[0] - 1, 0)], edges[min(heavy[-1] + 2, len(margin))]])
