"""What changes from turn to turn beyond jitter: the shape of a turn, as loads make it, and its duration."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import chi_square_tail

from . import fit
from .edges import Edges

_DOUBT = 0.01
"""Probability below which changes are no jitter."""


@dataclass(frozen=True)
class Changes:
    """Turns held against the steady turn."""

    shape: Floats
    """Harmonics of each turn less those of all, (turns, 2 harmonics) [s]."""
    is_told: bool
    """Whether they differ by more than jitter explains."""
    wander: float
    """Variance of the duration of turns beyond jitter [s2]; zero where jitter explains them."""


def of_turns(edges: Edges, residual: Floats, harmonics: int, jitter: float) -> Changes:
    """Changes in what a fit of steady turns leaves over, (n,) [s]; ``jitter`` is the deviation of an instant [s]."""
    number = np.floor(edges.angle / (2.0 * np.pi) + 1e-9).astype(int)
    offsets, shapes, share, size = [], [], [], 0.0
    for k in np.unique(number):
        here = np.flatnonzero(number == k)
        if len(here) <= 2 * harmonics + 4:
            continue
        rows = np.delete(fit.time_rows(edges.angle[here], harmonics), 1, axis=1)
        inverse = np.linalg.inv(rows.T @ rows)
        solved = inverse @ (rows.T @ residual[here])
        offsets.append(solved[0])
        shapes.append(solved[1:])
        share.append(float(inverse[0, 0]))
        size += float(solved[1:] @ np.linalg.solve(inverse[1:, 1:], solved[1:]))
    shape, turns = np.array(shapes).reshape(len(shapes), 2 * harmonics), len(shapes)
    is_told = turns > 2 and _beyond(size, jitter, (turns - 1) * 2 * harmonics)
    return Changes(shape, is_told, _wander(np.array(offsets), jitter**2 * float(np.mean(share or [0.0])), jitter))


def _beyond(squares: float, jitter: float, freedom: int) -> bool:
    return chi_square_tail(squares / max(jitter**2, 1e-40), freedom) < _DOUBT


def _wander(offsets: Floats, variance: float, jitter: float) -> float:
    """Variance of the steps between the offsets of turns beyond that of the offsets themselves [s2]."""
    if len(offsets) < 4 or variance == 0.0:
        return 0.0
    off = offsets - offsets.mean()
    if not _beyond(float((off**2).sum()) * jitter**2 / variance, jitter, len(offsets) - 2):
        return 0.0
    return max(0.0, float(np.var(np.diff(offsets), ddof=1)) - 2.0 * variance)
