"""Intervals for what cannot be negative: one-sided where there is nothing, two-sided where there is something.

Feldman and Cousins, Phys. Rev. D 57, 3873 (1998), table X: a Gaussian reading of a mean that is zero or more. The ends
are chosen by likelihood ratio, so that the interval is never empty and covers as often as it says at every mean; an
interval cut off at zero, or one whose kind is chosen after the reading, does not.
"""

from functools import cache

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import normal_probability

CONFIDENCE = 0.95
"""Of all intervals."""
_TABLE = np.linspace(0.0, 2.0, 81)
"""Means for which the ends are solved [standard deviations]; beyond, the bound is not felt."""


def feldman_cousins_acceptance(mean: Floats) -> tuple[Floats, Floats]:
    """Lowest and highest reading less ``mean`` that speak for ``mean`` (n,), all in standard deviations."""
    mean = np.maximum(mean, 1e-6)
    high = np.interp(mean, _TABLE, _highest())
    return np.where(mean >= high, -high, -(mean**2 + high**2) / (2.0 * mean)), high


@cache
def _highest() -> Floats:
    """The upper ends at the means of the table, (81,).

    Equal likelihood ratios at both ends: with c the upper one, the lower is -c, or -(m^2 + c^2) / 2m where the reading
    there is negative; Phi(upper) - Phi(lower) = 0.95.
    """
    from scipy.optimize import brentq

    def excess(high: float, mean: float) -> float:
        low = -high if mean >= high else -(mean**2 + high**2) / (2.0 * mean)
        return normal_probability(high) - normal_probability(low) - CONFIDENCE

    return np.array([brentq(excess, 1.0, 3.0, args=(max(float(mean), 1e-6),)) for mean in _TABLE])
