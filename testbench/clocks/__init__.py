"""Clocks of several loggers aligned: offset and drift, by what both saw, by taps, or by a trigger, with intervals.

Downwards: ``run`` aligns the loggers of a stored run, ``pairs`` chooses what they both saw, ``correlation``, ``taps``
and ``trigger`` are the ways to align, ``refine`` and ``search`` the mathematics, ``mapping`` the result.
"""
