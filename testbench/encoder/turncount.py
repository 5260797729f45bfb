"""After how many edges the motion repeats: once a turn, where the edges per turn are as stated."""

import numpy as np

from balance.arrays import Floats, Indices

from ..errors import RecordingError
from .edges import Edges

_LEAST = 8
"""Shortest repetition that is looked for, in edges."""
_FARTHEST = 5
"""Stated turns over which a repetition is looked for."""
_BESIDE = 3
_STEPS = 3.0
"""Steps of the clock, above which scatter is no rounding."""
_CLEAR = 0.35
"""Scatter of the time for a number of edges, of that for a few more or less, below which the motion repeats."""


def refuse_other_turn(edges: Edges) -> None:
    """Raise RecordingError where the motion in the later half plainly repeats, but not after the stated turn."""
    if edges.disc.pitch_is_apart:
        return
    stated = round(edges.disc.per_turn)
    lags, scatter = _scatter(edges)
    found = _repetitions(edges, lags, scatter)
    at_stated = dict(zip(lags.tolist(), scatter.tolist(), strict=True)).get(stated)
    if at_stated is None:  # too short a log to hold a stated turn against the next
        other = found[:1] if found and stated % found[0] else []
    else:
        other = [lag for lag in found if scatter[lag - lags[0]] < _CLEAR * at_stated]
    if other:
        raise RecordingError(
            f"{edges.name}: the motion repeats every {other[0]} edges, not every {stated}: state the edges per turn of "
            "the disc (--pulses) and its turns per turn of the crank (--ratio) as they are"
        )


def repetition(edges: Edges) -> int | None:
    """Edges after which the motion of the later half repeats, a turn or a whole part of one; None: nothing shows it."""
    per_turn = edges.disc.per_turn
    parts = [lag for lag in _repetitions(edges, *_scatter(edges)) if _divides(lag, per_turn)]
    return min(parts, default=None)


def _divides(lag: int, per_turn: float) -> bool:
    """Whether so many edges are a turn or a whole part of one, to the next edge."""
    times = round(per_turn / lag)
    return times >= 1 and abs(per_turn / times - lag) <= 0.5


def _scatter(edges: Edges) -> tuple[Indices, Floats]:
    """Numbers of edges, and how the time for each scatters along the later half of the log [s]; lost ones left out."""
    stated = round(edges.disc.per_turn)
    time = np.full(edges.pulse[-1] + 1, np.nan)
    time[edges.pulse] = edges.time
    time = time[len(time) // 2 :][-4 * _FARTHEST * stated :]
    most = min(_FARTHEST * stated + 2 * _BESIDE, 3 * len(time) // 4)
    if most < _LEAST + _BESIDE:
        return np.arange(0), np.empty(0)
    lags = np.arange(_LEAST - _BESIDE, most)
    return lags, np.array([np.nanstd(time[lag:] - time[:-lag]) for lag in lags]) + 1e-12


def _repetitions(edges: Edges, lags: Indices, scatter: Floats) -> list[int]:
    """Numbers of edges after which the motion plainly repeats; scatter of a few clock steps is rounding that beats."""
    found, least = [], _STEPS * (edges.clock_step or 0.0)
    for k in range(_BESIDE, len(lags) - _BESIDE):
        beside = np.r_[scatter[k - _BESIDE : k], scatter[k + 1 : k + 1 + _BESIDE]]
        if np.median(beside) > max(least, scatter[k] / _CLEAR) and scatter[k] < beside.min():
            found.append(int(lags[k]))
    return found
