"""Residuals made white: an autoregression of what a fit leaves, so that what is quiet counts more than what is loud.

r_t = a_1 r_(t-1) + ... + a_p r_(t-p) + e_t by least squares; the filter (1, -a_1, ..., -a_p) makes e of r, and both
sides of the fit go through it (Cochrane and Orcutt, JASA 44, 1949). Steps of an encoder, differentiated twice, are the
case in point: loud at the highest frequencies, where motions say little.
"""

import numpy as np

from balance.arrays import Floats

from .shared import Flags

PERIODS = 4.0
"""Length of the filter, in periods of the highest frequency compared."""
FLOOR = 1e-2
"""Of the residual's power, as white noise added to it: keeps frequencies that hold nothing from being blown up."""
LEAST_ROWS = 8
"""Samples for each coefficient that is estimated."""
MOST_ROWS = 200_000
"""More samples are thinned out."""


def whitener(residual: Floats, used: Flags, longest: int) -> Floats:
    """The filter (p + 1,) that whitens the residual (n,) at ``used`` samples, of at most ``longest`` coefficients."""
    power = float(np.mean(residual[used] ** 2))
    order = min(longest, int(np.count_nonzero(used)) // LEAST_ROWS)
    rows = np.flatnonzero(with_history(used, order))
    if order < 1 or not power > 0.0 or len(rows) < LEAST_ROWS * order // 2:
        return np.ones(1)
    rows = rows[:: 1 + len(rows) // MOST_ROWS]
    past = residual[rows[:, None] - np.arange(1, order + 1)]
    normal = past.T @ past + FLOOR * power * len(rows) * np.eye(order)
    return np.r_[1.0, -np.linalg.solve(normal, past.T @ residual[rows])]


def filtered(values: Floats, taps: Floats) -> Floats:
    """Values (n, ...) behind the filter, along the first axis; the first p of a stretch lack history."""
    from scipy.signal import lfilter

    return np.asarray(lfilter(taps, [1.0], values, axis=0)) if len(taps) > 1 else values


def with_history(used: Flags, order: int) -> Flags:
    """Samples before which ``order`` others are used too, (n,)."""
    count = np.cumsum(np.r_[0, used])
    found = np.zeros(len(used), dtype=bool)
    found[order:] = count[order + 1 :] - count[: max(len(used) - order, 0)] == order + 1
    return found
