"""The parameters of the law, given published numbers: the best fit, and every value that they leave open.

Least squares from several starts gives the best fit. Marginalisation weighs every value by how well it fits, on a grid,
no chain: beforehand every value between a parameter's bounds is equally likely; given what is common to all axes and
the scatter, the axes are independent, and their couples are summed out one by one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats
from testbench.errors import AnalysisError

from .model import AXES, COMMON, NAMES, PARAMETERS, SCATTER, Cases, felt, percent, reductions

STARTS = 12
_SAME = 1e-3
"""Share of the smallest sum of squares by which other starts may end above it and count as ended alike."""
CELLS = (20, 14, 14)
"""Cells of the grid along the common parameters; zoomed once onto where the weight lies."""
COUPLES = 30
SCATTERS = 20
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
    """Parameters drawn by their weight, in the parameters' units, (SAMPLES,) each; the scatter last."""

    samples: dict[str, Floats]

    def predict(self, cases: Cases) -> tuple[Floats, Floats]:
        """Median of the reductions [%], (n,), and intervals of 95 % for a printed number, scatter included, (n, 2)."""
        parameters = {name: values for name, values in self.samples.items() if name != SCATTER.name}
        found = reductions(parameters, cases)
        noise = np.random.default_rng(_SEED).standard_normal(found.shape)
        printed = found + self.samples[SCATTER.name][:, None] * noise
        tails = [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0]
        return np.median(found, axis=0), np.quantile(printed, tails, axis=0).T

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
    squares: Floats
    """Sums of squared errors of each axis, (axes, cells, COUPLES) [points^2]."""
    scatter: Floats
    """(SCATTERS,) [points]"""
    count: int
    """Printed numbers."""

    @classmethod
    def over(cls, box: Floats, cases: Cases) -> "_Grid":
        lines = [_centres(ends, n) for ends, n in zip(box[:3], CELLS, strict=True)]
        common = np.stack([x.ravel() for x in np.meshgrid(*lines, indexing="ij")], axis=1)
        couples = np.stack([_centres(ends, COUPLES) for ends in box[3:]])
        squares = np.stack([
            _squares(common, shares, cases.where(cases.axis == axis))
            for axis, shares in zip(AXES, couples, strict=True)
        ])  # fmt: skip
        return cls(
            box,
            common,
            couples,
            squares,
            np.exp(_centres(np.log([SCATTER.low, SCATTER.high]), SCATTERS)),
            len(cases.printed),
        )

    @cached_property
    def log_weights(self) -> Floats:
        """Of common parameters and scatter, the couples summed out, (cells, SCATTERS)."""
        least = self.squares.min(axis=2, keepdims=True)
        above, least = -0.5 * (self.squares - least), -0.5 * least[..., 0].sum(axis=0)
        return np.stack([
            np.log(np.exp(above / s**2).sum(axis=2)).sum(axis=0) + least / s**2 - self.count * np.log(s)
            for s in self.scatter
        ], axis=1)  # fmt: skip

    def drawn(self) -> dict[str, Floats]:
        """Draw by weight; within a cell every value is as likely."""
        rng = np.random.default_rng(_SEED)
        weights = _normal(self.log_weights.ravel())
        cell, scatter = np.unravel_index(rng.choice(len(weights), SAMPLES, p=weights), (len(self.common), SCATTERS))
        columns = [*self.common[cell].T]
        for squares, shares in zip(self.squares, self.couples, strict=True):
            columns.append(shares[_choose(-0.5 * squares[cell] / self.scatter[scatter, None] ** 2, rng)])
        widths = np.diff(self.box, axis=1)[:, 0] / [*CELLS, *[COUPLES] * len(AXES)]
        within = rng.uniform(-0.5, 0.5, (SAMPLES, len(columns))) * widths
        values = np.stack(columns, axis=1) + within
        step = float(np.log(self.scatter[1] / self.scatter[0]))
        spread = self.scatter[scatter] * np.exp(step * rng.uniform(-0.5, 0.5, SAMPLES))
        return dict(zip(NAMES, values.T, strict=True)) | {SCATTER.name: spread}

    def zoomed(self) -> Floats:
        """The part of the box that holds weight."""
        weights = _normal(self.log_weights.ravel()).reshape(*CELLS, SCATTERS)
        margins = [weights.sum(axis=tuple(j for j in range(4) if j != i)) for i in range(len(COMMON))]
        drawn = self.drawn()
        for name, ends in zip(NAMES[len(COMMON) :], self.box[len(COMMON) :], strict=True):
            margins.append(np.histogram(drawn[name], COUPLES, tuple(ends))[0] / SAMPLES)
        return np.array([_held(ends, margin) for ends, margin in zip(self.box, margins, strict=True)])


def _centres(ends: Floats, count: int) -> Floats:
    low, high = ends
    return low + (high - low) * (np.arange(count) + 0.5) / count


def _squares(common: Floats, shares: Floats, cases: Cases) -> Floats:
    """Sums of squared errors of one axis, (cells, couples) [points^2]."""
    without, balanced = felt(common[:, :1], common[:, 1:2], common[:, 2:], cases)
    total = np.empty((len(common), len(shares)))
    for j, share in enumerate(shares):
        found = percent(without, balanced + (share * cases.mechanics[:, 2]) ** 2)
        total[:, j] = ((found - cases.printed) ** 2).sum(axis=1)
    return total


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
