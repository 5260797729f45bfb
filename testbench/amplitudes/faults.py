"""What a record itself shows of a sensor that failed in it: one value only, a value held, flat tops below its range."""

import numpy as np

from balance.arrays import Floats

from ..checks.clipping import Clipping

HELD_S = 0.05
"""Shortest stretch of one value that counts as held [s]: half a period of 10 Hz."""
_LONGER = 10
"""How many times a held stretch is longer than any other, the rest at the beginning among them."""


def is_dead(values: Floats) -> bool:
    """Whether a record (n,) shows one value only."""
    return bool(np.ptp(values) == 0.0)


def held(values: Floats, rate_hz: float) -> str | None:
    """Where a record (n,) holds one value though it changes everywhere else, after it has moved; None if nowhere.

    A coarse channel holds a value whenever it rests: such stretches are many, or one lies at the beginning.
    """
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [len(values)]])
    lengths = np.diff(edges)
    at = int(np.argmax(lengths))
    longest, others = int(lengths[at]), np.delete(lengths, at)
    if at == 0 or longest < HELD_S * rate_hz or longest < _LONGER * int(others.max()):
        return None
    start, seconds = edges[at] / rate_hz, longest / rate_hz
    return (
        f"one value for {seconds:.3f} s from {start:.3f} s of the record on, elsewhere it changes: stuck or unplugged"
    )


def flat_tops(values: Floats, unit: str = "m/s2") -> str | None:
    """What looks like flat tops at the extremes of a record (n,), whatever range is stated; None if nothing does."""
    clipping = Clipping(None)
    clipping.update(np.asarray(values, dtype=np.float64))
    return clipping.message(unit)
