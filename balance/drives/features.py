"""Where periodic functions have their extremes."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from ..arrays import Floats
from .reduced import Reduced

_GRID = 2881
"""Angles of a turn at which the slope's sign is looked at."""


def stationary(slope: Callable[[Floats], Floats]) -> list[float]:
    """Angles from 0 to 2 pi where a slope of period 2 pi changes its sign, increasing, (k,) [rad]."""
    u = (np.arange(_GRID + 1) - 0.5) * 2.0 * np.pi / _GRID
    values = slope(u)
    found = []
    for k in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0):
        root = brentq(lambda x: float(slope(np.array([x]))[0]), u[k], u[k + 1], xtol=1e-13)
        found.append(float(np.mod(root, 2.0 * np.pi)))
    return sorted(found)


def inertia_extremes(reduced: Reduced) -> list[tuple[float, float, str]]:
    """Travel [rad], reduced inertia [kg m2] and ``maximum`` or ``minimum``, for each extreme of I(u)."""
    bend = reduced.slopes.slope()
    return [
        (u, float(reduced.inertia(u)), "maximum" if bend(u)[0] < 0.0 else "minimum")
        for u in stationary(reduced.inertia_slope)
    ]
