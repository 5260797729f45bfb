"""Where in a record something moves, by how far a signal leaves its level at rest."""

from collections.abc import Sequence

import numpy as np

from balance.arrays import Floats

MOVING_DEVIATIONS = 8.0
"""Robust standard deviations by which a moving signal leaves its level at rest."""
CLEAR_DEVIATIONS = 30.0
"""Robust standard deviations by which a signal leaves its level where it shows that it rested before."""
_SIGMA_PER_MAD = 1.4826


def moving_interval(values: Floats, rate_hz: float, margin_s: float = 0.05) -> slice:
    """Samples of a signal (n,) [any unit] from its first to its last movement, with a margin; all if it never moves.

    Level and scatter at rest are those of the first and the last twentieth of the record.
    """
    edge = max(len(values) // 20, 1)
    resting = np.concatenate([values[:edge], values[-edge:]])
    level = float(np.median(resting))
    scatter = _SIGMA_PER_MAD * float(np.median(np.abs(resting - level)))
    away = np.abs(values - level)
    moved = np.flatnonzero(away > MOVING_DEVIATIONS * scatter + 1e-3 * float(away.max(initial=0.0)))
    if not moved.size:
        return slice(0, len(values))
    margin = round(margin_s * rate_hz)
    return slice(max(int(moved[0]) - margin, 0), min(int(moved[-1]) + margin + 1, len(values)))


def rest_before(signals: Sequence[Floats], rate_hz: float, margin_s: float = 0.02) -> slice | None:
    """Samples before the first movement in any signal, (n,) each [any unit], of one clock; None if not determined.

    Level and scatter at rest are those of the first twentieth. A record that starts in motion scatters there as it does
    later: at least one signal must move clearly after the rest.
    """
    onsets, shown = [], False
    for values in signals:
        edge = values[: max(len(values) // 20, 1)]
        level = float(np.median(edge))
        away = np.abs(values - level)
        scatter, largest = _SIGMA_PER_MAD * float(np.median(away[: len(edge)])), float(away.max(initial=0.0))
        moved = np.flatnonzero(away > MOVING_DEVIATIONS * scatter + 1e-3 * largest)
        onsets += [int(moved[0])] if moved.size else []
        shown |= largest > CLEAR_DEVIATIONS * scatter
    end = min(onsets, default=0) - round(margin_s * rate_hz)
    return slice(0, end) if shown and end > 0 else None
