"""Clocks of several loggers aligned: offset and drift, by common signals, by taps, or by a trigger, with intervals.

``run_alignment`` aligns the loggers of a stored run, ``common_signals`` chooses what two of them both recorded,
``offset_and_drift`` and ``event_alignment`` align by it, ``clock_map`` is the result. METHODS lists them by name.
"""

from .event_alignment import by_taps, by_trigger
from .offset_and_drift import by_correlation
from .run_alignment import AlignmentMethod

METHODS: dict[str, AlignmentMethod] = {"correlation": by_correlation, "tap": by_taps, "trigger": by_trigger}
