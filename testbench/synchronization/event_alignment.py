"""Clocks aligned by events that both saw at known instants: which belongs to which, then a line through them.

Clocks aligned by taps: short shocks that both loggers felt, whatever else they recorded between them.

Clocks aligned by the rising edges of a trigger that both loggers recorded.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats, Indices

from ..errors import AnalysisError
from .clock_map import ASSUMED_DRIFT, KNOWN, PPM, ClockMap
from .coarse_lag import CoarseLag
from .offset_and_drift import LARGEST_DRIFT, Aligned, refine_clock
from .signal_preparation import Prepared, Shared, prepare

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


def match_events(name: str, reference: Events, own: Events) -> tuple[Indices, Indices]:
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


def clock_map_from_events(name: str, reference: Events, own: Events, drift: bool) -> ClockMap:
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


LOUD = 0.3
"""Share of the loudest shock from which another one counts as a tap."""
STANDS_OUT = 10.0
"""By how much a tap is louder than the record's median."""
APART_S = 0.25
"""Two shocks closer than this are one tap [s]."""
WINDOW_S = 0.1
"""Of the record that is compared, to either side of a tap [s]."""


def by_taps(shared: Shared, drift: bool = True) -> Aligned:
    """Align by taps. Raises AnalysisError if a side shows none, or they do not tell which belongs to which."""
    content = prepare(shared)
    reference = find_taps(content, content.reference.time, np.concatenate(content.columns, axis=1))
    own = find_taps(content, content.own.time, content.seen)
    one, other = match_events(shared.name, reference, own)
    offset = float(np.mean(reference.time[one] - own.time[other]))
    heard = own.time[other]
    middle, half = 0.5 * (heard[0] + heard[-1]), 0.5 * (heard[-1] - heard[0]) + WINDOW_S
    near = np.min(np.abs(content.own.time[:, None] - heard[None, :]), axis=1) <= WINDOW_S
    found = refine_clock(content, CoarseLag(offset, 0.0, (middle - half, middle + half)), drift, near)
    return Aligned(found.clock, "tap", f"{len(one)} taps, {shared.name}", 1.0 - found.left, content.findings)


def find_taps(content: Prepared, time: Floats, values: Floats) -> Events:
    """Instants of the loudest samples (n, signals) of each tap, known to about a period of the highest frequency."""
    loud = np.sqrt(np.sum((values / np.maximum(values.std(axis=0), 1e-300)) ** 2, axis=1))
    if loud.max() < STANDS_OUT * np.median(loud):
        raise AnalysisError(
            f"{content.name}: no tap stands out: the loudest is {loud.max() / np.median(loud):.2g} times the median"
        )
    found: list[int] = []
    for k in np.argsort(loud)[::-1]:
        if loud[k] < LOUD * loud.max() or len(found) > 100:
            break
        if all(abs(time[k] - time[j]) > APART_S for j in found):
            found.append(int(k))
    return Events(np.sort(time[found]), 0.5 / content.cutoff, (float(time[0]), float(time[-1])))


LOW, HIGH = 0.25, 0.75
"""Shares of the swing below and above which a signal is clearly off and on."""
MOST_EDGES = 500


def by_trigger(shared: Shared, drift: bool = True) -> Aligned:
    """Align by edges. Raises AnalysisError if a side has none, or they do not tell which belongs to which."""
    reference = trigger_edges(shared.name, shared.reference_time, shared.columns[0][:, 0])
    own = trigger_edges(shared.name, shared.own_time, shared.seen[:, 0])
    one, other = match_events(shared.name, reference, own)
    clock = clock_map_from_events(shared.name, reference.among(one), own.among(other), drift)
    return Aligned(clock, "trigger", f"{len(one)} edges, {shared.name}", None)


def trigger_edges(name: str, time: Floats, values: Floats) -> Events:
    """Instants at which a signal goes from off to on: the middle between its last sample off and its first on.

    The edge lies anywhere between: its standard deviation is that of a uniform distribution.
    """
    low, high = float(np.min(values)), float(np.max(values))
    if not high > low:
        raise AnalysisError(f"{name}: a channel that never changes holds no trigger")
    level = np.where(values >= low + HIGH * (high - low), 1, np.where(values <= low + LOW * (high - low), -1, 0))
    clear = np.flatnonzero(level)
    rises = np.flatnonzero(np.diff(level[clear]) > 0)
    if not 0 < len(rises) <= MOST_EDGES:
        raise AnalysisError(
            f"{name}: {len(rises)} rising edges: expected 1 to {MOST_EDGES}; name the channel that holds the trigger"
        )
    before, after = clear[rises], clear[rises + 1]
    step = float(np.median(np.diff(time)))
    widest = float(np.max(time[after] - time[before]))
    return Events(
        0.5 * (time[before] + time[after]), max(step, widest) / np.sqrt(12.0), (float(time[0]), float(time[-1]))
    )
