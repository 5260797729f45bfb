"""Clocks of several loggers aligned: offset and drift, by common signals, by taps, or by a trigger, with intervals.

``run_alignment`` aligns the loggers of a stored run, ``common_signals`` chooses what two of them both recorded,
``offset_and_drift`` and ``event_alignment`` align by it, ``clock_map`` is the result; ``known_clocks`` gives
instants of one logger on the clock of another by what is recorded.
``event_alignment.METHODS`` lists them by name.
"""
