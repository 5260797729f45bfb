"""Predictions without mechanics: what a model must pass to be worth anything."""

from collections.abc import Callable

import numpy as np

from balance.arrays import Floats

from .cases import Cases


def constant(known: Cases, asked: Cases) -> Floats:
    """The mean of all known reductions [%], (n,)."""
    return np.full(len(asked.printed), known.printed.mean())


def per_axis(known: Cases, asked: Cases) -> Floats:
    """The mean of the known reductions of the same axis [%], (n,)."""
    return np.array([known.printed[known.axis == axis].mean() for axis in asked.axis])


def nearest_acceleration(known: Cases, asked: Cases) -> Floats:
    """The known reduction of the same motion and axis at the nearest peak acceleration, by ratio [%], (n,).

    The mean of those that are equally near.
    """
    return np.array([
        _nearest(known.where((known.motion == motion) & (known.axis == axis)), acceleration)
        for motion, axis, acceleration in zip(asked.motion, asked.axis, asked.peak_acceleration, strict=True)
    ])  # fmt: skip


def _nearest(alike: Cases, acceleration: float) -> float:
    apart = np.abs(np.log(alike.peak_acceleration / acceleration))
    return float(alike.printed[np.isclose(apart, apart.min())].mean())


BASELINES: dict[str, Callable[[Cases, Cases], Floats]] = {
    "constant": constant,
    "per axis": per_axis,
    "nearest acceleration": nearest_acceleration,
}
