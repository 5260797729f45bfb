"""The ways to align two clocks, by name."""

from .correlation import by_correlation
from .run import Way
from .taps import by_taps
from .trigger import by_trigger

WAYS: dict[str, Way] = {"correlation": by_correlation, "tap": by_taps, "trigger": by_trigger}
