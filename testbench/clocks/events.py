"""Clocks aligned by events that both saw at known instants: which belongs to which, then a line through them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats, Indices

from ..errors import AnalysisError
from .mapping import ASSUMED_DRIFT, KNOWN, PPM, ClockMap
from .refine import LARGEST_DRIFT

CLOSE = 5.0
"""Standard deviations within which events of both clocks belong together."""


@dataclass(frozen=True)
class Events:
    """Instants on one clock, with the standard deviation of each."""

    time: Floats
    """(n,) [s]"""
    error: float
    """[s]"""
    span: tuple[float, float]
    """Of the record [s]."""

    def covers(self, time: Floats) -> NDArray[np.bool_]:
        """Which instants (n,) the record holds."""
        return (time > self.span[0]) & (time < self.span[1])

    def among(self, indices: Indices) -> "Events":
        """Some of the events."""
        return Events(self.time[indices], self.error, self.span)


def match(name: str, reference: Events, own: Events) -> tuple[Indices, Indices]:
    """Indices of the events of both that belong together: the shift at which most of them lie on a line.

    Raises AnalysisError if there are none, or several shifts fit as many: a periodic series.
    """
    if not len(reference.time) or not len(own.time):
        raise AnalysisError(f"{name}: no event on one of the two")
    if len(reference.time) == len(own.time) == 1:
        return np.array([0]), np.array([0])
    error = CLOSE * float(np.hypot(reference.error, own.error))
    found: dict[int, _Together] = {}
    for i in range(len(reference.time)):
        for j in range(len(own.time)):
            one = _together(reference, own, i, j, error)
            if i - j not in found or len(one.own) > len(found[i - j].own):
                found[i - j] = one
    best = min(found.values(), key=lambda one: (one.alone, -len(one.own)))
    rivals = [r for r in found.values() if r is not best and r.alone <= best.alone and 2 * len(r.own) >= len(best.own)]
    if len(best.own) < 2 or any(len(r.own) >= 2 for r in rivals):
        raise AnalysisError(
            f"{name}: ambiguous: {len(reference.time)} events on the one clock and {len(own.time)} on the other can "
            "belong together in several ways; give events at uneven intervals, or one alone"
        )
    return np.array(best.reference), np.array(best.own)


def line(name: str, reference: Events, own: Events, drift: bool) -> ClockMap:
    """The map through events that belong together, (n,) each. Raises AnalysisError where a drift is not determined."""
    count, error = len(own.time), float(np.hypot(reference.error, own.error))
    middle = float(own.time.mean())
    lever = own.time - middle
    turning = drift and count > 1
    if drift and not turning:
        raise AnalysisError(
            f"{name}: one event tells an offset and no drift; align the offset alone, which takes the drift to be "
            f"within {ASSUMED_DRIFT / PPM:g} ppm"
        )
    ahead = reference.time - own.time
    slope = float(lever @ ahead / (lever @ lever)) if turning else 0.0
    left = ahead - ahead.mean() - slope * lever
    freedom = count - 1 - turning
    variance, known = error**2, KNOWN
    if freedom >= 2 and left @ left / freedom > variance:  # more scatter than the sampling explains
        variance, known = float(left @ left / freedom), freedom
    covariance = np.diag([variance / count, variance / (lever @ lever) if turning else (0.5 * ASSUMED_DRIFT) ** 2])
    clock = ClockMap(
        middle, middle + float(ahead.mean()), slope, covariance, known, (float(own.time[0]), float(own.time[-1]))
    )
    low, high = clock.drift_interval
    if turning and 0.5 * (high - low) > LARGEST_DRIFT:
        raise AnalysisError(
            f"{name}: too short for a drift: events over {clock.span[1] - clock.span[0]:.3g} s tell it to "
            f"{0.5 * (high - low) / PPM:.3g} ppm; align the offset alone"
        )
    return clock


@dataclass(frozen=True)
class _Together:
    """Events that would belong together, and how many are alone though the other side recorded then."""

    reference: list[int]
    own: list[int]
    alone: int


def _together(reference: Events, own: Events, i: int, j: int, error: float) -> _Together:
    """Events that lie on a line, of a clock's slope, through event i of the one and j of the other."""
    ahead = float(reference.time[i] - own.time[j])
    one, other = [], []
    for k, time in enumerate(own.time + ahead):
        near = int(np.argmin(np.abs(reference.time - time)))
        if abs(reference.time[near] - time) <= error + ASSUMED_DRIFT * abs(time - reference.time[i]):
            one.append(near)
            other.append(k)
    expected = np.count_nonzero(reference.covers(own.time + ahead)) + np.count_nonzero(
        own.covers(reference.time - ahead)
    )
    return _Together(one, other, int(expected) - 2 * len(one))
