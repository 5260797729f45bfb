"""The error type of drives."""

from ..errors import CounterpoiseError


class DriveError(CounterpoiseError):
    """A machine that does not start, has no steady rotation, or whose solution did not converge."""
