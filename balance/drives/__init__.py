"""Drives: one-degree-of-freedom machines whose crank a motor turns; start-up, steady state, fluctuation of speed."""

from ..errors import CounterpoiseError


class DriveError(CounterpoiseError):
    """A machine that does not start, has no steady rotation, or whose solution did not converge."""
