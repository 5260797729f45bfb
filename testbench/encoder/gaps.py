"""Edges that are lost or too many, told from the intervals beside them."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

_BESIDE = 3
"""Intervals looked at on each side."""
_LONG, _SHORT = 1.5, 0.4
"""Shares of the expected interval above which an edge counts as lost, below which as one too many.

Discs with slots 10 % out of place make intervals of 0.6 to 1.4, and more now and then.
"""
_WIDE, _NARROW = 1.3, 0.7
"""Shares above and below which an interval counts as alike when the same slot comes again."""


@dataclass(frozen=True)
class Gap:
    """A place where edges are lost."""

    after: int
    """The edge before it, counted from 0."""
    time: float
    """Its instant [s]."""
    missing: int
    """How many edges are lost."""
    ratio: float
    """The interval over the one to expect."""

    def text(self) -> str:
        """The place for people."""
        return (
            f"{self.missing} after edge {self.after} at {self.time:.6f} s (interval {self.ratio:.2f} times the usual)"
        )


def lost(time: Floats, pulses: int) -> list[Gap]:
    """Gaps in the instants of edges (n,) [s] of a disc with so many pulses a turn.

    An interval as long one turn of the disc before or after is a wide slot, not a loss; a slot that is missing from
    the disc comes again one edge earlier each turn, and is a loss.
    """
    ratio = interval_ratios(time)
    return [
        Gap(int(k), float(time[k]), max(1, round(float(ratio[k])) - 1), float(ratio[k]))
        for k in np.flatnonzero(ratio > _LONG)
        if not _comes_again(ratio, int(k), pulses, ratio > _WIDE)
    ]


def spurious(time: Floats, pulses: int) -> list[int]:
    """Edges that come far too early after the one before, counted from 0; not those of a narrow slot."""
    ratio = interval_ratios(time)
    close = np.flatnonzero(ratio < _SHORT)
    return [int(k) + 1 for k in close if not _comes_again(ratio, int(k), pulses, ratio < _NARROW)]


def _comes_again(ratio: Floats, k: int, pulses: int, alike: "np.ndarray[tuple[int], np.dtype[np.bool_]]") -> bool:
    return any(0 <= i < len(ratio) and bool(alike[i]) for i in (k - pulses, k + pulses))


def interval_ratios(time: Floats) -> Floats:
    """Each interval over the one to expect: geometric mean of the medians of those before and after, (n - 1,).

    So a steady gain of speed counts as regular. The first and last intervals have one side only: they are judged where
    that side is even, and count as 1 elsewhere (a start from standstill).
    """
    log = np.log(np.diff(time))
    count = len(log)
    padded = np.concatenate([np.full(_BESIDE, np.nan), log, np.full(_BESIDE, np.nan)])
    before = np.stack([padded[k : k + count] for k in range(_BESIDE)])
    after = np.stack([padded[_BESIDE + 1 + k : _BESIDE + 1 + k + count] for k in range(_BESIDE)])
    left, right = _median(before), _median(after)
    expected = np.where(np.isnan(left), right, np.where(np.isnan(right), left, 0.5 * (left + right)))
    one_sided = np.isnan(left) | np.isnan(right)
    side = np.where(np.isnan(left), _spread(after), _spread(before))
    ratio = np.exp(log - expected)
    return np.where(one_sided & (side > np.log(1.3)), 1.0, ratio)


def _median(rows: Floats) -> Floats:
    """Median down the columns, NaN left out; NaN where a column holds nothing else."""
    order = np.sort(rows, axis=0)
    have = np.isfinite(rows).sum(axis=0)
    columns = np.arange(rows.shape[1])
    low, high = order[np.maximum(have - 1, 0) // 2, columns], order[np.maximum(have, 1) // 2 * (have > 1), columns]
    return np.where(have > 0, 0.5 * (low + np.where(have % 2 == 0, high, low)), np.nan)


def _spread(rows: Floats) -> Floats:
    """Largest less smallest down the columns, NaN left out."""
    return np.where(np.isnan(rows), -np.inf, rows).max(axis=0) - np.where(np.isnan(rows), np.inf, rows).min(axis=0)
