"""Clocks of several loggers aligned: offset and drift, by what both saw, by taps, or by a trigger, with intervals.

Downwards: ``run`` aligns the loggers of a stored run, ``pairs`` chooses what they both saw, ``correlation``, ``taps``
and ``trigger`` are the ways to align, ``refine`` and ``search`` the mathematics, ``mapping`` the result.
"""

from .correlation import Aligned, by_correlation
from .mapping import ClockMap
from .shared import Shared

__all__ = ["Aligned", "ClockMap", "Shared", "by_correlation"]
