"""Clocks that a header declares, if what it declares can be one."""

import math

from ..recording import UniformClock

_SMALLEST, _FASTEST = 1e-300, 1e300


def by_step(step_s: float, start_s: float) -> UniformClock | None:
    """The clock of a step [s] and a start [s]; None if they are no step and no time."""
    return by_rate(1.0 / step_s, start_s) if _SMALLEST < step_s < math.inf else None


def by_rate(rate_hz: float, start_s: float = 0.0) -> UniformClock | None:
    """The clock of a rate [Hz] and a start [s]; None if they are no rate and no time."""
    return UniformClock(rate_hz, start_s) if _SMALLEST < rate_hz < _FASTEST and math.isfinite(start_s) else None
