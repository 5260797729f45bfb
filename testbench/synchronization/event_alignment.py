"""Clocks aligned by events that both loggers recorded: taps (short shocks), or the rising edges of a trigger.

Events of both clocks are matched by the shift at which most of them lie on a line; the line is the clock map. Taps
match only roughly: they choose the samples by which the clocks are then fitted.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from balance.arrays import Floats, Indices, Mask
from balance.estimation.estimate import coverage_factor
from balance.results import first_of, instant_text

from ..errors import AnalysisError
from .clock_map import ASSUMED_DRIFT, MANY_DEGREES_OF_FREEDOM, PPM, ClockMap
from .offset_and_drift import LARGEST_DRIFT, AlignedClock, by_correlation, refine_clock
from .run_alignment import AlignmentMethod
from .signal_preparation import PreparedSignals, SharedSignals, prepare

MATCHING_DEVIATIONS = 5.0
"""Standard deviations within which events of both clocks match."""


@dataclass(frozen=True)
class Events:
    """Instants on one clock, with the standard deviation of each."""

    time: Floats
    """(n,) [s]"""
    error: float
    """[s]"""
    span: tuple[float, float]
    """Start and end of the record [s]."""

    def covers(self, time: Floats) -> Mask:
        """Which instants (n,) [s] lie within the record, (n,) [-]."""
        return (time > self.span[0]) & (time < self.span[1])

    def among(self, indices: Indices) -> "Events":
        """Events at indices (k,) [-]."""
        return Events(self.time[indices], self.error, self.span)


def match_events(name: str, reference: Events, own: Events, noun: str) -> tuple[Indices, Indices]:
    """Indices of the matching events of both, (k,) each [-]: those of the shift at which most lie on a line.

    Another shift fits as well where it leaves events over at the beginning or the end alone, which a logger may have
    missed: at even intervals, one interval off. ``noun`` is what an event is called.

    Raises AnalysisError if there are none, if several shifts fit, or if an event that both recorded has no counterpart.
    """
    if not len(reference.time) or not len(own.time):
        raise AnalysisError(f"{name}: no {noun} on one of the two: name channels that both hold it, --pair")
    if len(reference.time) == len(own.time) == 1:
        return np.array([0]), np.array([0])
    error = MATCHING_DEVIATIONS * float(np.hypot(reference.error, own.error))
    shifts: list[_Match] = []
    tried: set[tuple[int, int]] = set()
    for i, j in np.ndindex(len(reference.time), len(own.time)):
        if (i, j) not in tried:  # else at a shift that was looked at
            shifts.append(_matches_through(reference, own, i, j, error))
            tried.update(shifts[-1].pairs)
    kept: list[_Match] = []
    for one in sorted(shifts, key=lambda one: (-len(one.pairs), len(one.lone))):
        if all(set(one.pairs).isdisjoint(better.pairs) for better in kept):
            kept.append(one)
    best, *others = kept
    matching, several = len(best.pairs), min(len(reference.time), len(own.time)) > 1
    if matching == 1 and several:
        raise AnalysisError(
            f"{name}: no interval between {noun}s of the one clock is one of the other: the loggers did not record the "
            f"same, or not at one time (jitter); {_OTHER_SIGNALS}"
        )
    least = min(LEAST_COMMON * min(np.ptp(reference.span), np.ptp(own.span)), best.common)
    rivals = [r for r in others if 2 * len(r.pairs) >= matching and r.whole and r.common >= least]
    if several and best.lone and not any(len(r.pairs) > 1 for r in rivals):
        raise AnalysisError(f"{name}: {best.cause(reference, own, error, noun)}; {_OTHER_SIGNALS}")
    if rivals or not several:
        offsets = first_of([f"{one.offset:.4g} s" for one in (best, *(rivals or others))], 4)
        raise AnalysisError(
            f"{name}: ambiguous: {len(reference.time)} {noun}s on the one clock and {len(own.time)} on the other fit "
            f"at offsets of {offsets}, if a logger missed the first or the last; record one alone, or three or "
            f"more at uneven intervals; {_OTHER_SIGNALS}"
        )
    there, here = np.array(best.pairs).T
    return there, here


def clock_map_from_events(name: str, reference: Events, own: Events, drift: bool) -> ClockMap:
    """The map through matching events, of one without a drift. Raises AnalysisError where more do not determine it.

    Its interval holds every line that passes each event within the sampling steps of both: these errors are common to
    all events where the events keep their phase to the samples, and shrink where their phases vary.
    """
    count, error = len(own.time), float(np.hypot(reference.error, own.error))
    drift = drift and count > 1
    middle = float(own.time.mean())
    lever, difference = own.time - middle, reference.time - own.time
    possible = _lines_within(lever, difference, np.sqrt(3.0) * (reference.error + own.error), drift)
    degrees_of_freedom = MANY_DEGREES_OF_FREEDOM
    if possible is not None:
        offset, slope = map(float, possible.mean(axis=1))
        half = 0.5 * np.ptp(possible, axis=1)
        covariance = np.diag(half**2 / 3.0)
    else:  # more scatter than the sampling explains, beside what the sampling may have in common
        slope = float(lever @ difference / (lever @ lever)) if drift else 0.0
        offset = float(difference.mean())
        residual = difference - offset - slope * lever
        degrees_of_freedom = count - 1 - drift
        variance = float(residual @ residual / degrees_of_freedom)
        covariance = np.diag([variance / count + error**2, variance / (lever @ lever)])
    if not drift:
        slope = 0.0
        covariance[1, 1] = (ASSUMED_DRIFT / coverage_factor(degrees_of_freedom)) ** 2
    clock = ClockMap(
        middle,
        middle + offset,
        slope,
        covariance,
        degrees_of_freedom,
        (float(own.time[0]), float(own.time[-1])),
    )
    low, high = clock.drift_interval
    if drift and 0.5 * (high - low) > LARGEST_DRIFT:
        raise AnalysisError(
            f"{name}: too short for a drift: events over {clock.span[1] - clock.span[0]:.3g} s determine it to "
            f"{0.5 * (high - low) / PPM:.3g} ppm; align the offset alone"
        )
    return clock


def _lines_within(lever: Floats, difference: Floats, within: float, drift: bool) -> Floats | None:
    """Least and greatest offset [s] and slope [-] of the lines that pass every ``difference`` (n,) [s] at ``lever``
    (n,) [s] ``within`` [s], (2, 2); None where none does. Without ``drift`` the slope is that of an ordinary crystal.
    """
    unit = np.array([within, within / (float(np.max(np.abs(lever))) or 1.0)])
    rows = np.column_stack([np.ones_like(lever), lever]) * unit / within
    middle = float(difference.mean())
    scaled = (difference - middle) / within
    most = None if drift else ASSUMED_DRIFT / unit[1]
    ends = [
        linprog(
            sign * axis,
            np.concatenate([rows, -rows]),
            np.concatenate([scaled + 1.0, 1.0 - scaled]),
            bounds=[(None, None), (None if most is None else -most, most)],
        )
        for axis in np.eye(2)
        for sign in (1.0, -1.0)
    ]
    if any(one.status != 0 for one in ends):
        return None
    return np.array([one.x for one in ends]).reshape(2, 2, 2)[[0, 1], :, [0, 1]] * unit[:, None] + [[middle], [0.0]]


@dataclass(frozen=True)
class _Match:
    """What matches at one shift."""

    offset: float
    """Reference less own [s]."""
    pairs: tuple[tuple[int, int], ...]
    """Matching events of the reference and of the own clock."""
    lone: tuple[tuple[float, float], ...]
    """Events without a counterpart though the other side recorded then: instant, and distance to the nearest [s], on
    the reference's clock."""
    whole: bool
    """No event without a counterpart lies between those that match."""
    common: float
    """What both recorded at this shift [s]."""

    def cause(self, reference: Events, own: Events, error: float, noun: str) -> str:
        """Why events that both should hold do not match."""
        counts = f"{len(self.pairs)} of {len(reference.time)} and {len(own.time)} {noun}s match at {self.offset:.4g} s"
        intervals = np.concatenate([np.diff(reference.time), np.diff(own.time)])
        at, distance = max(self.lone, key=lambda one: one[1])
        if distance < NEAR_SHARE * float(intervals.min()):
            return (
                f"{counts}, others are up to {1e3 * distance:.3g} ms apart, where sampling explains "
                f"{1e3 * error:.2g} ms: the loggers did not record one {noun} at one time (jitter)"
            )
        missed = f"one at {instant_text(at)} s of the one clock has no counterpart"
        return f"{counts}, but {missed}: a logger missed it, or it is false"


LEAST_COMMON = 0.5
"""Share of the shorter record that both recorded at any shift that counts: loggers of a run record together."""
NEAR_SHARE = 0.25
"""Of the shortest interval, within which two events are meant to be one."""
_OTHER_SIGNALS = "else align by other common signals"


def _matches_through(reference: Events, own: Events, i: int, j: int, error: float) -> _Match:
    """Events on a line, of a clock's slope, through event i of the reference and j of the own clock."""
    offset = float(reference.time[i] - own.time[j])
    own_time = own.time + offset
    near, apart = _nearest(reference.time, own_time)
    matching = apart <= error + ASSUMED_DRIFT * np.abs(own_time - reference.time[i])
    pairs = tuple((int(near[k]), int(k)) for k in np.flatnonzero(matching))
    there = np.setdiff1d(np.flatnonzero(own.covers(reference.time - offset)), near[matching])
    here = np.flatnonzero(reference.covers(own_time) & ~matching)
    lone = np.concatenate([reference.time[there], own_time[here]])
    distances = np.concatenate([_nearest(own_time, reference.time[there])[1], apart[here]])
    first, last = own_time[matching][[0, -1]]
    common = min(reference.span[1], own.span[1] + offset) - max(reference.span[0], own.span[0] + offset)
    return _Match(
        offset,
        pairs,
        tuple(zip(lone.tolist(), distances.tolist(), strict=True)),
        not bool(np.any((lone > first) & (lone < last))),
        float(common),
    )


def _nearest(times: Floats, instants: Floats) -> tuple[Indices, Floats]:
    """Index of the nearest of ``times`` (n,) [s] to each of ``instants`` (m,) [s], and its distance, (m,) [s]."""
    after = np.searchsorted(times, instants).clip(1, max(len(times) - 1, 1))
    near = np.where(instants - times[after - 1] <= times[after % len(times)] - instants, after - 1, after % len(times))
    return near, np.abs(times[near] - instants)


LEAST_LOUDNESS = 0.3
"""Share of the loudest shock from which another one is a tap."""
LEAST_PROMINENCE = 10.0
"""Least ratio of a tap to the record's median."""
LEAST_SPACING_S = 0.25
"""Two shocks closer than this are one tap [s]."""
WINDOW_S = 0.1
"""Of the record that is compared, to either side of a tap [s]."""


def by_taps(shared: SharedSignals, drift: bool = True) -> AlignedClock:
    """Align by taps. Raises AnalysisError if a side shows none, or they match in several ways."""
    content = prepare(shared)
    reference = find_taps(content, content.reference.time, np.concatenate(content.reference_columns, axis=1))
    own = find_taps(content, content.own.time, content.own_signals)
    one, other = match_events(shared.name, reference, own, "tap")
    offset = float(np.mean(reference.time[one] - own.time[other]))
    tap_times = own.time[other]
    middle, half = 0.5 * (tap_times[0] + tap_times[-1]), 0.5 * (tap_times[-1] - tap_times[0]) + WINDOW_S
    near = np.min(np.abs(content.own.time[:, None] - tap_times[None, :]), axis=1) <= WINDOW_S
    clock, explained = refine_clock(content, offset, (middle - half, middle + half), drift, near)
    return AlignedClock(clock, "tap", f"{len(one)} taps, {shared.name}", explained, content.findings)


def find_taps(content: PreparedSignals, time: Floats, values: Floats) -> Events:
    """Instants of the largest of ``values`` (n, signals) [any unit] at ``time`` (n,) [s] in each tap.

    They are known to half a period of the highest frequency compared.
    """
    loud = np.sqrt(np.sum((values / np.maximum(values.std(axis=0), 1e-300)) ** 2, axis=1))
    if loud.max() < LEAST_PROMINENCE * np.median(loud):
        raise AnalysisError(
            f"{content.name}: no tap found: the loudest sample is {loud.max() / np.median(loud):.2g} times the median, "
            f"expected {LEAST_PROMINENCE:g}; tap harder, or name channels that recorded it"
        )
    found: list[int] = []
    for k in np.argsort(loud)[::-1]:
        if loud[k] < LEAST_LOUDNESS * loud.max() or len(found) > 100:
            break
        if all(abs(time[k] - time[j]) > LEAST_SPACING_S for j in found):
            found.append(int(k))
    return Events(np.sort(time[found]), 0.5 / content.cutoff, (float(time[0]), float(time[-1])))


LOW, HIGH = 0.25, 0.75
"""Shares of a signal's span below and above which it is off and on."""
MOST_EDGES = 500


def by_trigger(shared: SharedSignals, drift: bool = True) -> AlignedClock:
    """Align by rising edges. Raises AnalysisError if a side has none, or they match in several ways."""
    reference = trigger_edges(shared.name, shared.reference_time, shared.reference_columns[0][:, 0])
    own = trigger_edges(shared.name, shared.own_time, shared.own_signals[:, 0])
    one, other = match_events(shared.name, reference, own, "edge")
    clock = clock_map_from_events(shared.name, reference.among(one), own.among(other), drift)
    edges, findings = f"{len(one)} edge{'s' * (len(one) > 1)}, {shared.name}", list[str]()
    if len(one) == 1:
        edges += f"; drift unknown, within {ASSUMED_DRIFT / PPM:g} ppm: {1e3 * ASSUMED_DRIFT:g} ms a second from it"
        match = _matches_through(reference, own, int(one[0]), int(other[0]), 0.0)
        shorter = min(np.ptp(reference.span), np.ptp(own.span))
        if match.common < LEAST_COMMON * shorter:
            findings.append(
                f"one edge alone gives the offset, {match.offset:.4g} s, by which both recorded "
                f"{max(match.common, 0.0):.3g} s of the shorter record's {shorter:.3g} s: the edges may be of two "
                "events"
            )
    return AlignedClock(clock, "trigger", edges, None, tuple(findings))


SEPARATION = 2.5
"""Of two levels of a trigger, in the standard deviations of both together; the halves of noise are 1.3 apart."""


def trigger_edges(name: str, time: Floats, values: Floats) -> Events:
    """Instants at which ``values`` (n,) [any unit] at ``time`` (n,) [s] go from off to on.

    The middle between the last sample off and the first on; the edge is distributed evenly between them.
    """
    low, high = float(np.min(values)), float(np.max(values))
    if not high > low:
        raise AnalysisError(f"{name}: a channel that never changes holds no trigger: name another, --pair")
    off, on = (values[values <= 0.5 * (low + high)], values[values > 0.5 * (low + high)])
    if on.mean() - off.mean() < SEPARATION * (on.std() + off.std()):
        raise AnalysisError(f"{name}: holds no two levels, as noise does not: it is no trigger; name another, --pair")
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


METHODS: dict[str, AlignmentMethod] = {"correlation": by_correlation, "tap": by_taps, "trigger": by_trigger}
"""The ways to align two clocks, by name."""
