"""Where in a record something moves."""

from collections.abc import Sequence

import numpy as np

from balance.arrays import Floats

QUIET = 8.0
"""How many robust standard deviations a signal must leave its resting level by to count as moving."""
_SIGMA_PER_MAD = 1.4826


def moving_interval(values: Floats, rate_hz: float, margin_s: float = 0.05) -> slice:
    """The span of a signal (n,) from its first to its last movement, with a margin; all of it if it never moves.

    The resting level and its scatter are those of the first and the last twentieth of the record.
    """
    edge = max(len(values) // 20, 1)
    resting = np.concatenate([values[:edge], values[-edge:]])
    level = float(np.median(resting))
    scatter = _SIGMA_PER_MAD * float(np.median(np.abs(resting - level)))
    away = np.flatnonzero(
        np.abs(values - level) > QUIET * scatter + 1e-3 * float(np.abs(values - level).max(initial=0.0))
    )
    if not away.size:
        return slice(0, len(values))
    margin = round(margin_s * rate_hz)
    return slice(max(int(away[0]) - margin, 0), min(int(away[-1]) + margin + 1, len(values)))


STILL = 30.0
"""How far something must leave its resting level to show that it rested before [robust standard deviations]."""


def rest_before(signals: Sequence[Floats], rate_hz: float, margin_s: float = 0.02) -> slice | None:
    """The stretch before anything moves in any of several signals of one clock (n,); None if no movement shows it.

    Level and scatter at rest are those of the first twentieth. A record that starts in motion scatters there as it
    does later, and then nothing is told: at least one signal must clearly move after the stretch.
    """
    onsets, shown = [], False
    for values in signals:
        edge = values[: max(len(values) // 20, 1)]
        level = float(np.median(edge))
        away = np.abs(values - level)
        scatter, largest = _SIGMA_PER_MAD * float(np.median(away[: len(edge)])), float(away.max(initial=0.0))
        moved = np.flatnonzero(away > QUIET * scatter + 1e-3 * largest)
        onsets += [int(moved[0])] if moved.size else []
        shown |= largest > STILL * scatter
    end = min(onsets, default=0) - round(margin_s * rate_hz)
    return slice(0, end) if shown and end > 0 else None
