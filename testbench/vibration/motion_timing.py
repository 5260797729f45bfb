"""When a run rests and moves, on the clock of its accelerometers: by command and encoders, else by what they feel.

The command, else the encoders, say when and for how long anything moves on their own logger's clock, and on that of the
accelerometers where an alignment is recorded or both loggers recorded a trigger. Elsewhere the motion begins where the
accelerometers cannot be predicted any more from what they showed before (an autoregression sees neither hum nor a mode
of the floor begin, but a motion, to some milliseconds), and not later than where the power that is felt matches the
power that is commanded. The former alone tells the rest where neither command nor encoders were logged.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.errors import CounterpoiseError
from balance.estimation.estimate import chi_square_tail

from ..errors import AnalysisError
from ..kinematics.smoothing_and_derivatives import ALMOST
from ..rig.sensors import Accelerometer, Encoder, Target
from ..runs.si_run import SIRun
from ..signal.filters import loaded_loops
from ..synchronization.known_clocks import on_clock_of

MARGIN_S = 0.006
"""Of a rest, before the motion."""
COARSE_S = 0.06
"""Half of the window about the coarse beginning of the motion in which its exact one is searched."""
FIRST_S = 0.04
"""Taken for rest to begin with."""
LEAST_REST_S = 0.03
LEAST_RATE_HZ = 200.0
"""At which the beginning of a motion is found."""
ORDER = 16
"""Of the autoregression, at most."""
_FITTED_S = 2.0
"""Of rest, to which the autoregression is fitted at most."""
_RATE_HZ = 1000.0
_WINDOW_S = 0.008
_CERTAIN = 1e-9
"""Probability that a window is no motion, from which it is one."""
RELATED_S = 0.003
"""To which another clock is to be known, half of a 95 % interval, for what its logger tells of the motion."""
_FADING_S = 0.08
"""In which the base forgets what it was shaken by, roughly."""
_CELL_S = 0.004
"""Resolution of the coarse lag."""
_FLICKER = 1.2
"""Steps of an encoder that are no motion yet: it may flicker by one, which rounding may make a little more."""
_LEAST_MATCH = 0.6
"""Correlation of powers from which a coarse lag counts."""
_Stated = tuple[str, Floats, Floats, tuple[float, float]]


@dataclass(frozen=True)
class MotionTiming:
    """Spans on a logger's clock, from its first sample [s]; None where they are not known."""

    rest: tuple[float, float] | None
    """Before the motion; None also where there is none."""
    moving: tuple[float, float] | None
    """From the first to the last motion."""
    unfelt: tuple[float, float] | None = None
    """The whole record, where a motion was commanded of which no accelerometer feels anything begin."""
    timed: bool = False
    """Whether command or encoders tell it on the same clock, or on one that is related to it."""
    clocks: str = ""
    """What relates another clock on which they tell it, or why nothing does; empty where it needs none, or has none."""

    @classmethod
    def of(cls, run: SIRun, group: str) -> "MotionTiming":
        """Of the accelerometers in a group of a run."""
        columns = [c for s in run.rig.of_kind(Accelerometer).values() for c in s.columns("") if run.holds(c, group)]
        rate, signals = run.rate(columns[0]), []
        for column in columns:
            with suppress(AnalysisError):
                signals.append(run.evenly(column, run.without_holes(column, run.as_recorded(column))))
        signals = [signal for signal in signals if np.isfinite(signal).all()]
        seconds = len(signals[0]) / rate if signals else 0.0
        stated = _stated_motion(run)
        if stated is None:
            begin = beginning(signals, rate)
            return cls(_rest(begin), None if begin is None else (begin, seconds))
        _, time, power, span = stated
        known, how = _on_clock(run, stated, group)
        if known is not None:
            first, last = (at - run.instants(columns[0])[0] for at in known)
            if not signals or (first < seconds and last > 0.0):
                return cls(_rest(first), (max(first, 0.0), min(last, seconds)), timed=True, clocks=how)
            how += ", by which nothing moves while the accelerometers record"
        if span[0] <= time[0]:  # quiet accelerometers are no rest then, but a slow beginning
            return cls(None, (0.0, seconds), clocks=how)
        first, lag = beginning(signals, rate), coarse_lag(signals, rate, time, power)
        if lag is not None and (first is None or first > span[0] + lag + COARSE_S):
            coarse = span[0] + lag
            found = beginning(signals, rate, (coarse - COARSE_S, coarse + COARSE_S))
            first = coarse - COARSE_S if found is None else found
        if first is None:
            return cls(None, None, (0.0, seconds) if rate >= LEAST_RATE_HZ else None, clocks=how)
        return cls(_rest(first), (max(first, 0.0), min(first + span[1] - span[0], seconds)), clocks=how)


def _rest(begin: float | None) -> tuple[float, float] | None:
    return None if begin is None or begin - MARGIN_S < LEAST_REST_S else (0.0, begin - MARGIN_S)


def known_beginning(run: SIRun, group: str) -> float | None:
    """When command or encoders begin to move, on the clock of a group [s]: not after it began to record, where they
    moved from their first sample on. None where they do not tell, or on a clock that is not related to it.
    """
    stated = _stated_motion(run)
    known = None if stated is None else _on_clock(run, stated, group)[0]
    return None if known is None else known[0]


def _on_clock(run: SIRun, stated: _Stated, group: str) -> tuple[tuple[float, float] | None, str]:
    """From when to when a stated motion lasts, on the clock of a group, which tells no rest if none was stated [s]; and
    what relates it to that clock, or why nothing does.
    """
    source, time, _, span = stated
    known, how = ((np.array(span), 0.0), "") if source == group else on_clock_of(run, np.array(span), source, group)
    if known is None:
        return None, how
    if known[1] > RELATED_S:
        return None, f"{how}, within {1e3 * known[1]:.2g} ms, where {1e3 * RELATED_S:g} ms are needed"
    first, last = map(float, known[0])
    return (first if span[0] > time[0] else min(first, float(run.time(group)[0])), last), how


def _stated_motion(run: SIRun) -> _Stated | None:
    """Group, instants [s], power of the acceleration (n,) and span of the motion, by the command, else the encoders."""
    for kind in (Target, Encoder):
        columns = [column for column in run.rig.columns_of(kind) if run.holds(column)]
        if not columns or len(run.groups_of(columns)) > 1:
            continue
        try:
            values, time = run.stacked(columns), run.instants(columns[0])
        except CounterpoiseError:
            continue
        if len(time) < 16 or not np.ptp(values, axis=0).any():
            continue
        if kind is Target:
            away = np.abs(values).max(axis=1)
            moved = np.flatnonzero(away > 1e-3 * away.max())
            span = (float(time[moved[0]]), float(time[moved[-1]])) if moved.size and moved[0] > 0 else None
            power = (values**2).sum(axis=1)
        else:
            span, power = _encoded_motion(values, time)
        if span is not None:
            return run.groups_of(columns)[0], time, power, span
    return None


def _encoded_motion(values: Floats, time: Floats) -> tuple[tuple[float, float] | None, Floats]:
    """From when to when encoders (n, k) [SI] move, None where they rest throughout, and the power of the acceleration
    (n,).
    """
    from scipy.ndimage import gaussian_filter1d

    reach, changes = np.ptp(values, axis=0), np.abs(np.diff(values, axis=0))
    step = np.where(changes > 0.0, changes, np.inf).min(axis=0)
    step[np.isinf(step)] = 0.0
    noise = 6.0 * np.std(np.diff(values[: _edge(values)], axis=0), axis=0)
    least = np.maximum(np.maximum(1e-3 * reach, noise), _FLICKER * step)
    begin, end = _begins(values, time, least, step), _begins(values[::-1], -time[::-1], least, step)
    last = float(time[-1])
    span = None if begin is None else (max(begin, float(time[0])), last if end is None else min(-end, last))
    rate = (len(time) - 1) / float(time[-1] - time[0])
    bent = gaussian_filter1d(values, 0.006 * rate, axis=0, order=2, mode="nearest")
    return span, ((bent / np.where(reach > 0.0, reach, np.inf)) ** 2).sum(axis=1)


def _edge(values: Floats) -> int:
    """Samples at an end of a record that are taken for rest."""
    return max(len(values) // 50, 4)


def _begins(values: Floats, time: Floats, least: Floats, step: Floats) -> float | None:
    """When values (n, k) begin to move, seen from ``least`` (k,) on, in steps (k,) [SI]; None where they never do.

    A motion that begins from rest with finite jerk goes with the cube of time: eight times as far in twice the time.
    So it began as long before it was seen as it took from there to eight times as far, or less, and not longer before
    than four times what it took to twice as far, for what an encoder jumps by once is no such motion. Where it is seen
    it may have gone a step more than is read.
    """
    away = np.abs(values - np.median(values[: _edge(values)], axis=0))
    away[0] = away[1]  # a value from before the first reading is no motion
    seen = []
    for by in (1.0, 2.0, 8.0):
        level = by * least + (by - 1.0) * step
        share = (away / np.where(level > 0.0, level, np.inf)).max(axis=1)
        if by == 1.0 and not share[0] <= 1.0 < share.max():
            return None if share.max() <= 1.0 else float(time[0])
        seen.append(float(time[np.argmax(share > min(1.0, 0.999 * share.max()))]))
    begin, twice, far = seen
    return begin - min(far - begin, 4.0 * (twice - begin + float(time[-1] - time[0]) / (len(time) - 1)))


def coarse_lag(signals: Sequence[Floats], rate_hz: float, time: Floats, power: Floats) -> float | None:
    """What to add to instants (m,) [s] at which so much ``power`` (m,) was commanded, for the time from the first
    sample of signals (n,) [any unit]; None where they do not match.
    """
    cell = max(round(_CELL_S * rate_hz), 1)
    count = len(signals[0]) // cell
    felt = np.zeros(count)
    for values in signals:
        changes = np.diff(values, prepend=values[0])
        changes = np.convolve(changes, np.ones(cell) / cell, "same")
        squares = (changes**2)[: count * cell].reshape(count, cell).mean(axis=1)
        felt += np.sqrt(squares / max(float(squares.mean()), 1e-300))
    step = cell / rate_hz
    instants = np.arange(time[0], time[-1], step)
    given = np.interp(instants, time, power)
    given = np.sqrt(np.convolve(given, np.exp(-np.arange(0.0, 4.0 * _FADING_S, step) / _FADING_S))[: len(given)])
    size = count + len(given)
    spectra = [np.fft.rfft(values, size) for values in (felt - felt.mean(), given, given**2, np.ones(count))]
    product, total, squares = (
        np.fft.irfft(np.fft.rfft(one, size) * np.conj(spectra[k]), size)
        for one, k in ((felt - felt.mean(), 1), (np.ones(count), 1), (np.ones(count), 2))
    )
    match = (
        product
        / np.sqrt(np.maximum(squares - total**2 / count, 1e-9 * squares.max()))
        / max(np.sqrt(count) * felt.std(), 1e-300)
    )
    match[squares < 0.3 * squares.max()] = 0.0
    best = int(np.argmax(match))
    if match[best] < _LEAST_MATCH:
        return None
    shift = best - size if best >= count else best
    return float(shift * step - instants[0])


def beginning(signals: Sequence[Floats], rate_hz: float, within: tuple[float, float] | None = None) -> float | None:
    """When signals (n,) [any unit] cease to be what an autoregression predicts from their past [s from the first
    sample].

    It is fitted to what was found to be rest so far, at first to FIRST_S of the record, or to all that is before
    ``within``, and then further by a third at a time. None where that is too short, or nothing unforeseen happens
    (``within``, where that is given).
    """
    every = max(int(rate_hz / ALMOST // _RATE_HZ), 1)
    rate, count = rate_hz / every, min(map(len, signals), default=0) // every
    means = (values[: count * every].reshape(count, every) @ np.full(every, 1.0 / every) for values in signals)
    rows = np.array([row for row in means if np.ptp(row) > 0.0])
    known = round(FIRST_S * rate) if within is None else round(within[0] * rate)
    last = count if within is None else min(round(within[1] * rate), count)
    window = max(round(_WINDOW_S * rate), 4)
    if not len(rows) or rate_hz < LEAST_RATE_HZ or known < 2 * window or known >= last:
        return None
    level = float(len(rows) * window)
    while chi_square_tail(level, len(rows) * window) > _CERTAIN:
        level *= 1.1
    while known < last:
        ahead = min(known + max(known // 3, 4 * window), last)
        first = max(known - round(_FITTED_S * rate), 0)
        surprise = _innovations(rows[:, first:ahead], known - first).sum(axis=0)
        felt = np.convolve(surprise, np.ones(window))[: ahead - first]
        crossed = np.flatnonzero(felt[known - first :] > 1.5 * level * (1.0 + 2.0 * ORDER / (known - first)))
        if crossed.size:
            return (known + int(crossed[0]) - window // 2) / rate
        known = ahead
    return None


def _innovations(rows: Floats, known: int) -> Floats:
    """Squares of what is not predicted of rows (k, n), in variances of their first ``known`` samples, (k, n) [-]."""
    order = int(np.clip(known // 5, 2, ORDER))
    centred, found = rows - rows[:, :known].mean(axis=1, keepdims=True), np.zeros(rows.shape)
    if loops := loaded_loops():
        products = np.empty((len(rows), order + 1, order + 1))
        loops.lagged_products(centred, known - order, products)
    else:
        past = np.ascontiguousarray(np.lib.stride_tricks.sliding_window_view(centred, order + 1, axis=1))
        products = past[:, : known - order].transpose(0, 2, 1) @ past[:, : known - order]
    flat = 1e-12 * np.mean(centred**2, axis=1) + np.finfo(float).tiny
    ridge = (1e-6 * products[:, order, order] + flat)[:, None, None] * np.eye(order)
    weights = np.linalg.solve(products[:, :order, :order] + ridge, products[:, :order, order:])
    if loops:
        foreseen = np.zeros((len(rows), rows.shape[1] - order))
        loops.predicted(centred, np.ascontiguousarray(weights[:, :, 0]), foreseen)
    else:
        foreseen = (past[:, :, :order] @ weights)[:, :, 0]
    squares = (centred[:, order:] - foreseen) ** 2
    variance = squares[:, : known - order].sum(axis=1, keepdims=True) / max(known - 2 * order, 2)
    found[:, order:] = squares / np.maximum(variance, 1e-300)
    return found
