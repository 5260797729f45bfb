"""Where in a record something moves."""

import numpy as np

from balance.arrays import Floats

QUIET = 8.0
"""How many robust standard deviations a signal must leave its resting level by to count as moving."""
_SIGMA_PER_MAD = 1.4826


def moving(values: Floats, rate_hz: float, margin_s: float = 0.05) -> slice:
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
