"""Where a function of the crank angle is largest over a turn."""

from collections.abc import Callable

import numpy as np

from ..arrays import Floats

_GRID = 3600


def largest(function: Callable[[Floats], Floats]) -> tuple[float, float]:
    """Largest value of ``function`` of crank angles (n,) [rad] over a turn, and where [rad]: ever finer grids."""
    theta, step = turn(_GRID), 2 * np.pi / _GRID
    best = float(theta[int(np.argmax(function(theta)))])
    for _ in range(9):
        theta = best + step * np.linspace(-1.0, 1.0, 21)
        best = float(theta[int(np.argmax(function(theta)))])
        step /= 10.0
    return float(function(np.array([best]))[0]), best


def turn(count: int) -> Floats:
    """``count`` crank angles over one turn [rad]."""
    return 2 * np.pi * np.arange(count) / count
