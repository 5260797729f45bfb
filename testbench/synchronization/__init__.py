"""Clocks of several loggers aligned: offset and drift, by what both saw, by taps, or by a trigger, with intervals.

Downwards: ``run`` aligns the loggers of a stored run, ``pairs`` chooses what they both saw, ``correlation``, ``taps``
and ``trigger`` are the ways to align, ``refine`` and ``search`` the mathematics, ``mapping`` the result.

The ways to align two clocks, by name.
"""

from .event_alignment import by_taps, by_trigger
from .offset_and_drift import by_correlation
from .run_alignment import AlignmentMethod

METHODS: dict[str, AlignmentMethod] = {"correlation": by_correlation, "tap": by_taps, "trigger": by_trigger}
