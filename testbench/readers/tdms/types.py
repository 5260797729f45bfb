"""Types of values in TDMS."""

from functools import cache
from typing import Any

import numpy as np

from ...recording import Samples

STRING, BOOLEAN, TIME, DAQMX = 0x20, 0x21, 0x44, 0xFFFFFFFF
_NUMBERS = {
    1: "i1", 2: "i2", 3: "i4", 4: "i8", 5: "u1", 6: "u2", 7: "u4", 8: "u8", 9: "f4", 10: "f8",
    0x19: "f4", 0x1A: "f8", BOOLEAN: "u1", 0x08000C: "c8", 0x10000D: "c16",
}  # fmt: skip
_DAQMX_NUMBERS = {0: "u1", 1: "i1", 2: "u2", 3: "i2", 4: "u4", 5: "i4"}
EPOCH_1904 = -2082844800
"""1904-01-01, from which TDMS counts, in seconds since 1970."""
_PER_MICROSECOND = 2**64 / 1_000_000
_LATEST = 1 << 42
Stamps = np.ndarray[Any, Any]


@cache
def number(kind: int, order: str) -> np.dtype[Any] | None:
    """The form of a number or timestamp in the file; None for anything else."""
    if kind == TIME:
        parts = [("fraction", f"{order}u8"), ("second", f"{order}i8")]
        return np.dtype(parts if order == "<" else parts[::-1])
    return np.dtype(order + _NUMBERS[kind]) if kind in _NUMBERS else None


def daqmx_number(kind: int, order: str) -> np.dtype[Any] | None:
    """The form of a number that a DAQmx device wrote."""
    return np.dtype(order + _DAQMX_NUMBERS[kind]) if kind in _DAQMX_NUMBERS else None


def seconds(stamps: Stamps, to_microseconds: bool = True) -> Samples:
    """Seconds since 1970: to the whole microsecond, as NI's software shows them, or the nearest float64."""
    whole = stamps["second"].astype(np.int64) + EPOCH_1904
    fraction = stamps["fraction"].astype(np.float64)  # of 2**-64 s
    if to_microseconds and (np.abs(whole) < _LATEST).all():
        return np.asarray((whole * 1_000_000 + (fraction / _PER_MICROSECOND).astype(np.int64)) / 1e6)
    return np.asarray(whole.astype(np.float64) + fraction * 2.0**-64)


def remainder(stamps: Stamps, given: Samples) -> Samples:
    """How much later the timestamps are than the seconds ``given``, which are near them, exactly [s].

    Both are multiples of 2**-64 s; their difference is so small that float64 holds it to the last bit.
    """
    fraction = ((given - np.floor(given)) * 2.0**64).astype(np.uint64)
    return np.asarray((stamps["fraction"].astype(np.uint64) - fraction).astype(np.int64) * 2.0**-64)
