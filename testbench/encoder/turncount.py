"""Whether the motion repeats once a turn, as it must where the edges per turn are as stated."""

import numpy as np

from balance.arrays import Floats, Indices

from ..errors import RecordingError
from .edges import Edges

_LEAST = 8
"""Shortest repetition that is looked for, in edges."""
_BESIDE = 3
_STEPS = 3.0
"""Steps of the clock, above which scatter is no rounding."""
_CLEAR = 0.35
"""Scatter of the time for a number of edges, of that for a few more or less, below which the motion repeats."""


def refuse_other_turn(edges: Edges) -> None:
    """Raise RecordingError where the motion in the later half plainly repeats, but not after the stated turn."""
    stated, lags, scatter = _scatter(edges)
    for lag in _repetitions(edges, lags, scatter):
        if scatter[lag - lags[0]] < _CLEAR * scatter[stated - lags[0]]:
            raise RecordingError(
                f"{edges.name}: the motion repeats every {lag} edges, not every {stated}: state the edges per turn of "
                "the disc (--pulses) and its turns per turn of the crank (--ratio) as they are"
            )


def repeats_within(edges: Edges) -> int | None:
    """Edges after which the motion repeats already, where they are half or a third of the stated turn; else None."""
    stated, lags, scatter = _scatter(edges)
    parts = [lag for lag in _repetitions(edges, lags, scatter) if stated in (2 * lag, 3 * lag)]
    return min(parts, default=None)


def _scatter(edges: Edges) -> tuple[int, Indices, Floats]:
    """Stated edges a turn; numbers of edges, and how the time for each scatters along the later half of the log [s]."""
    stated = round(edges.disc.per_turn)
    time = edges.time[len(edges.time) // 2 :]
    most = min(2 * stated + 2 * _BESIDE, len(time) // 2)
    if edges.gaps or edges.disc.pitch_is_apart or stated < _LEAST or most <= stated + _BESIDE:
        return stated, np.arange(0), np.empty(0)
    lags = np.arange(_LEAST - _BESIDE, most)
    return stated, lags, np.array([np.std(time[lag:] - time[:-lag]) for lag in lags]) + 1e-12


def _repetitions(edges: Edges, lags: Indices, scatter: Floats) -> list[int]:
    """Numbers of edges after which the motion plainly repeats; scatter of a few clock steps is rounding that beats."""
    found, least = [], _STEPS * (edges.clock_step or 0.0)
    for k in range(_BESIDE, len(lags) - _BESIDE):
        beside = np.r_[scatter[k - _BESIDE : k], scatter[k + 1 : k + 1 + _BESIDE]]
        if np.median(beside) > max(least, scatter[k] / _CLEAR) and scatter[k] < beside.min():
            found.append(int(lags[k]))
    return found
