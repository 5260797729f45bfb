"""Least squares: the parameters that fit printed numbers best, from several starts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError
from .cases import Cases
from .model import NAMES, PARAMETERS, reductions

STARTS = 12
_SEED = 20191120
_SAME = 1e-3
"""Share of the smallest sum of squares by which other starts may end above it and count as ended alike."""


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
    best = min(ended, key=lambda end: float(end.cost))
    alike = np.array([end.x for end in ended if end.cost <= best.cost * (1.0 + _SAME)])
    ranges = low[:, None] + np.stack([alike.min(axis=0), alike.max(axis=0)], axis=1) * (high - low)[:, None]
    return Fit(order, low + best.x * (high - low), residuals(best.x), starts, len(alike), ranges)
