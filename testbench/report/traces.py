"""Channels as they are looked at, longer than memory as well, and the difference of a channel between two runs.

Of each block of BLOCK samples the least and the largest value are found once, and drawn where many samples lie in a
pixel; a range of few samples is read itself. So no peak is lost, and no more is in memory than what is drawn.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor, effective_degrees_of_freedom
from balance.report.plotted import PlottedChannel, plotted

from ..errors import AnalysisError
from ..rig import Column
from ..runs.joined_channels import interpolated
from ..runs.si_run import SIRun
from ..signal.filters import CorrelationPeak, correlation_peaks, without_mean
from ..synchronization.known_clocks import on_clock_of
from ..vibration.amplitude import SAME_RATE
from ..vibration.motion_timing import MARGIN_S, beginning, known_beginning
from ..vibration.run_amplitudes import observed_resolution
from .page_contents import BASE, TRIGGER

if TYPE_CHECKING:
    from ..store.run import Run, StoredGroup

BLOCK = 64
"""Samples of which the least and the largest are kept."""
AT_ONCE = 1 << 20
"""Samples that are read in one go; a whole number of blocks."""
LOOKED_AT = 1 << 20
"""First samples of a run by which it is aligned and its noise is known."""
TAPS = 16
"""Samples to either side of an instant that a value there is interpolated from: a sine of 0.4 of the rate to 1e-3."""
_KAISER = 8.0
"""Of their window."""
SMOOTH = 0.25
"""Radians of a signal, the standard deviation of the window in which the slope is found that its lag is told by."""
STEPS = 12
"""In which a lag is refined, at most."""
LEAST_STEP = 1e-5
"""Of them [samples]."""
LEAST_FREEDOM = 1.0
"""Degrees of freedom of a lag's deviation, from which it is known."""
RIVALS = 24
"""Peaks of a correlation that are looked at."""
BEGINNING = "the beginning of the motion"
PERIODIC = "of a signal that is like itself a period later"
DOUBTFUL = 10.0
"""Logarithm of the ratio of likelihoods by which one lag is to be likelier than any other."""
SWITCHING = 4
"""Samples that a line of two values takes at most to go from one to the other."""
LEVELS_APART = 10.0
"""Of a line of two values, in the standard deviations of both together."""
FOLLOWS = 0.9
"""Correlation from which two runs show the same and are aligned by it; of runs of two conditions it is no sign."""

_RELATE = "log an encoder on its logger, or one trigger on the loggers of both, which the rig names"
"""What tells when a run moves."""


@dataclass(frozen=True, eq=False)
class Trace:
    """One channel of one run, or a difference of two."""

    kind: str
    """What it is listed under."""
    name: str
    unit: str
    samples: int
    read: Callable[[int, int], tuple[Floats, Floats]] = field(repr=False)
    """Instants [s] and values [unit] of the samples from one to another, (n,) each; NaN where there is none."""
    group: str = ""
    """Of its logger."""
    run: SIRun | None = None
    """Bound to its rig, where that names the channel."""
    resolution: float = 0.0
    """That the rig states [unit]; zero where it states none."""
    logged: str = ""
    """Its name in the log."""

    @cached_property
    def blocks(self) -> tuple[Floats, Floats]:
        """Beginning of each block, and of the last its end, (k + 1,) [s]; least and largest value of each, (k, 2)."""
        begins, extremes = [], []
        for begin in range(0, self.samples, AT_ONCE):
            time, values = self.read(begin, min(begin + AT_ONCE, self.samples))
            values = np.where(np.isfinite(values), values, np.nan)
            first = np.arange(0, len(values), BLOCK)
            begins.append(time[first])
            extremes.append(np.column_stack([pick.reduceat(values, first) for pick in (np.fmin, np.fmax)]))
        return np.concatenate([*begins, time[-1:]]), np.concatenate(extremes)

    def between(self, first: float, last: float, spans: int) -> PlottedChannel:
        """What is drawn from ``first`` to ``last`` [s] in about so many spans."""
        edges, extremes = self.blocks
        begin = max(int(np.searchsorted(edges[:-1], first, "right")) - 1, 0)
        end = max(int(np.searchsorted(edges[:-1], last, "right")), begin + 1)
        count = min(end * BLOCK, self.samples) - begin * BLOCK
        if count <= 2 * BLOCK * spans:
            time, values = self.read(begin * BLOCK, begin * BLOCK + count)
            values = np.where(np.isfinite(values), values, np.nan)
            inside = slice(max(int(np.searchsorted(time, first)) - 1, 0), int(np.searchsorted(time, last)) + 1)
            time, values, count = time[inside], values[inside], len(values[inside])
        else:
            at = edges[begin : end + 1]
            time = np.column_stack([at[:-1], at[:-1] + 0.5 * np.diff(at)]).ravel()
            values = extremes[begin:end].ravel()
        return replace(plotted(self.kind, self.name, self.unit, time, values, spans), samples=count)

    def within(self, first: float, last: float) -> tuple[Floats, Floats]:
        """Instants [s] and values [unit] from the sample before ``first`` to that after ``last``, (n,) each."""
        edges, _ = self.blocks
        begin = max(int(np.searchsorted(edges[:-1], first, "left")) - 1, 0)
        end = int(np.searchsorted(edges[:-1], last, "right")) + 1
        return self.read(begin * BLOCK, min(end * BLOCK, self.samples))

    @property
    def beginning(self) -> tuple[float, float, Floats]:
        """First instant and rate [s, Hz], and values (n,) [unit], up to LOOKED_AT samples of them."""
        time, values = self.read(0, min(self.samples, LOOKED_AT))
        if len(time) < 2 or not time[-1] > time[0]:
            raise AnalysisError(f"{self.name}: has no two samples, or its time does not run")
        return float(time[0]), (len(time) - 1) / float(time[-1] - time[0]), values

    @cached_property
    def switched(self) -> bool:
        """Whether it is a line of two values, off and on, with noise or not: a trigger, a limit switch, a pulse."""
        if self.kind == TRIGGER:
            return True
        _, _, values = self.beginning
        values = values[np.isfinite(values)]
        if not values.size or not np.ptp(values) > 0.0:
            return False
        share = (values - values.min()) / np.ptp(values)
        off, on = share[share < 0.25], share[share > 0.75]
        switches = np.count_nonzero(np.diff(share[(share < 0.25) | (share > 0.75)] > 0.5))
        clear = on.mean() - off.mean() > LEVELS_APART * (on.std() + off.std())
        return bool(clear and len(values) - len(off) - len(on) <= SWITCHING * switches)

    def noise(self, moves: float | None) -> tuple[float, float] | None:
        """Variance at rest before its logger ``moves`` [s], at least that of the resolution, and degrees of freedom.

        [unit2] and [-]; None where there is no rest.
        """
        start, rate, values = self.beginning
        count = 0 if moves is None or not np.isfinite(values).all() else int((moves - start - MARGIN_S) * rate)
        if count < 8:
            return None
        resting = values[:count] - values[:count].mean()
        power = np.abs(np.fft.rfft(resting))[1:] ** 2  # two degrees of freedom each: the mean square counts twice
        freedom = np.clip(4.0 * power.sum() ** 2 / max(float(power @ power), 1e-300) - 3.0, 1.0, count - 1.0)
        shown, steps = float(resting.var(ddof=1)), max(observed_resolution(values), self.resolution) ** 2 / 12.0
        return (shown, float(freedom)) if shown > steps else (steps, np.inf)


def channel_trace(run: SIRun, kind: str, name: str, unit: str, column: Column) -> Trace:
    """A channel as its sensor gives it, on its logger's clock."""
    group, _ = run.recorded.find(column.channel)
    needed = [one for one in column.siblings or (column,) if run.holds(one)]

    def read(begin: int, end: int) -> tuple[Floats, Floats]:
        time = run.recorded.time(group.name, begin, end) - column.delay
        return time, run.preloaded(needed, begin, end).readings(column)

    return Trace(kind, name, unit, group.samples, read, group.name, run, column.resolution, column.channel)


def recorded_trace(run: "Run", group: "StoredGroup", index: int) -> Trace:
    """A channel as recorded, in the unit of its log, on its logger's clock."""

    def read(begin: int, end: int) -> tuple[Floats, Floats]:
        return run.time(group.name, begin, end), run.channels_at([(group, index)], begin, end)[0]

    channel = group.channels[index]
    return Trace("As recorded", channel.name, channel.unit or "no unit", group.samples, read, group.name)


@dataclass(frozen=True)
class Lag:
    """How much later a run shows the same as another, on the clocks of the loggers of one channel."""

    seconds: float
    deviation: float | None
    """Standard uncertainty [s]; None where it is not known."""
    by: str


Pairs = Sequence[tuple[Trace, Trace]]


def motion_lag(shared: Pairs, commands: Pairs, encoders: Pairs) -> Lag | None:
    """By the ``commands`` of both runs, else their ``encoders``, where the logger of the ``shared`` channels recorded
    them or its clock is related to theirs, by a recorded alignment or a trigger; None where none tells it.
    """
    return _by_related(shared, commands, "the command") or _by_related(shared, encoders, "the encoder")


def shown_lag(shared: Pairs, telling: Pairs) -> Lag:
    """By the first of ``telling``, channels that differ by noise alone, else by that of them which shows the same most
    exactly; else by where all of the ``shared`` ones begin to move. A line of two values tells when it was switched,
    not when anything moved: it counts for nothing.
    """
    same = []
    for pair in telling:
        if any(one.switched for one in pair) or (found := _correlated(*pair)) is None:
            continue
        if pair is telling[0] and found.deviation is not None:
            return found
        same.append(found)
    if sure := [one for one in same if one.deviation is not None]:
        return min(sure, key=lambda one: one.deviation or 0.0)
    if same:
        return same[0]
    begins = [motion_begins([pair[i] for pair in shared]) for i in range(2)]
    if begins[0] is not None and begins[1] is not None:
        return Lag(begins[1] - begins[0], None, BEGINNING)
    return Lag(shared[0][1].beginning[0] - shared[0][0].beginning[0], None, "the first sample")


def _by_related(shared: Pairs, pairs: Pairs, what: str) -> Lag | None:
    """By that channel of any logger whose clock is related to that of the ``shared`` ones which tells it most exactly,
    in the middle of its record, where a drift is known best; None where none does.
    """
    told = []
    for pair in pairs:
        found = _correlated(*pair)
        if found is None or found.deviation is None:
            continue
        middle = float(np.mean([pair[0].read(k, k + 1)[0][0] for k in (0, pair[0].samples - 1)]))
        ends = [_on_clock_of(shown, given, at) for shown, given, at in
                zip(shared[0], pair, (middle, middle + found.seconds), strict=True)]  # fmt: skip
        if ends[0] is not None and ends[1] is not None:
            deviation = float(np.linalg.norm([found.deviation, ends[0][1], ends[1][1]]))
            told.append((deviation, Lag(ends[1][0] - ends[0][0], deviation, f"{what}, {pair[0].name}")))
    return min(told, key=lambda one: one[0])[1] if told else None


def motion_begins(traces: Sequence[Trace]) -> float | None:
    """When channels of one logger cease to be at rest [s], by command or encoders of a clock that is related to its,
    else by what they show, but for lines of two values; None where it is not seen.
    """
    bound = next((trace for trace in traces if trace.run is not None), None)
    if bound and bound.run and (known := known_beginning(bound.run, bound.group)) is not None:
        return known
    seen = [trace.beginning for trace in traces if not trace.switched]
    found = beginning([values for _, _, values in seen if np.isfinite(values).all()], seen[0][1]) if seen else None
    return None if found is None else seen[0][0] + found


def _on_clock_of(shown: Trace, given: Trace, at: float) -> tuple[float, float] | None:
    """An instant of one channel's clock on that of another, and its standard uncertainty [s]; None: not related."""
    if shown.group == given.group:
        return at, 0.0
    found, _ = on_clock_of(shown.run, np.array([at]), given.group, shown.group) if shown.run else (None, "")
    return None if found is None else (float(found[0][0]), found[1] / coverage_factor(np.inf))


def _correlated(first: Trace, second: Trace) -> Lag | None:
    """By the correlation of one channel; None where both do not show the same, or not at one rate.

    The peak of the correlation is refined by least squares, with its deviation: see :func:`_refined`.
    Deviation None where another peak is as likely: one that is periodic matches itself a period later; or where none
    is, since the slope is constant. Likelihoods count as many independent values as the signal has zeros, and no more
    than what differs has, by the deviation.
    """
    (start, rate, values), (other_start, other_rate, others) = first.beginning, second.beginning
    if abs(rate - other_rate) > SAME_RATE * rate or not (np.isfinite(values).all() and np.isfinite(others).all()):
        return None
    found = correlation_peaks(others, values, RIVALS)
    if not found:
        return None
    best = found[0]
    resolutions = [max(one.resolution, observed_resolution(v)) for one, v in ((first, values), (second, others))]
    rounding = sum(step**2 for step in resolutions) / 12.0
    exact, deviation = _refined(values, others, best, resolutions) or (None, 0.0)
    same = exact or best
    if same.correlation < FOLLOWS:
        return None
    shown = f"the correlation of {first.name} ({same.correlation:.4f})"
    late = same.lag / rate + other_start - start
    apart, free = 1.0 - best.correlation**2 + rounding / float(np.var(values)), same.turn * same.common / np.pi
    if deviation > 0.0:
        free = min(free, apart / (same.turn * deviation) ** 2)
    for other in found[1:]:
        if (
            abs(other.lag - same.lag) * same.turn > 1.0
            and free * np.log1p((best.correlation**2 - other.correlation**2) / apart) < 2.0 * DOUBTFUL
        ):
            away = 1e3 * abs(other.lag - best.lag) / rate
            return Lag(late, None, f"{shown}, {PERIODIC} ({other.correlation:.4f} a further {away:.3g} ms away)")
    return Lag(late, None if exact is None else deviation / rate, shown)


def _refined(
    early: Floats, late: Floats, peak: CorrelationPeak, resolutions: Sequence[float]
) -> tuple[CorrelationPeak, float] | None:
    """The lag by which ``late`` (n,) differs least from ``early`` (m,) [any unit], offset and size being free, and its
    standard deviation [samples].

    Newton's steps from a ``peak``, over the samples that both show then; ``turn`` is of what is neither offset nor
    size. None where they lead nowhere, further away than the signal turns by a radian, or a few samples tell it all.
    The slope is smoothed: that of an encoder is of single steps. What differs is no white noise, and is most where it
    moves: the deviation is by leaving out one block after the other (jackknife), each three times as long as the signal
    is between two zeros, and half as long while so few tell too little: what goes from rest to rest has one zero. It is
    for Student's t, as wide as 95 % of a normal distribution are to be. Rounding to ``resolutions`` [unit] adds to it:
    it is the same while a value is held, so that of a rest is in the offset and size of what moves.
    """
    from scipy.signal import oaconvolve

    taps = np.arange(1.0 - TAPS, TAPS)
    order = np.where(taps, taps, 1.0)
    slope = np.where(taps, (-1.0) ** taps / order, 0.0) * _window(taps) / np.i0(_KAISER)
    edge = max(TAPS, min(int(4.0 * SMOOTH / peak.turn), len(early) // 4))
    smooth = np.exp(-0.5 * (np.arange(-edge, edge + 1.0) * peak.turn / SMOOTH) ** 2)
    slopes = oaconvolve(
        np.pad(early, edge, "reflect", reflect_type="odd"), np.convolve(smooth / smooth.sum(), slope, "same"), "valid"
    )
    lag = peak.lag
    for _ in range(STEPS):
        whole = int(np.floor(lag))
        first, last = max(TAPS, TAPS - whole), min(len(early), len(late) - whole) - TAPS
        if last - first < 2 * TAPS:
            return None
        away = lag - whole - np.arange(1 - TAPS, TAPS + 1)
        weights = np.sinc(away) * _window(away)
        shown = np.correlate(late[first + whole + 1 - TAPS : last + whole + TAPS], weights / weights.sum(), "valid")
        one, other = without_mean(early[first:last]), without_mean(shown)
        turned = slopes[first:last] - slopes[first:last].mean()
        turned -= (turned @ one) / max(float(one @ one), 1e-300) * one
        power = float(turned[TAPS - 1 : 1 - TAPS] @ np.convolve(other, slope, "valid"))
        like = float(one @ other)
        if not (power > 0.0 and like > 0.0):
            return None
        turn, step = float(np.sqrt(power / like)), -float(turned @ other) / power
        lag += step
        if abs(lag - peak.lag) * turn > 1.0:
            return None
        if abs(step) < LEAST_STEP:
            break
    else:
        return None
    same = min(like / float(np.sqrt((one @ one) * (other @ other))), 1.0)
    residual = other - like / float(one @ one) * one
    block, freedom = 6.0 * np.pi / turn, 0.0
    while freedom < LEAST_FREEDOM:
        if (block := 0.5 * block) < 1.0:
            return None
        begins = np.arange(0, last - first, round(block))
        scores, shares = (np.add.reduceat(v, begins) for v in (turned * residual, turned**2 / float(turned @ turned)))
        freedom = 1.0 / float(shares @ shares) - 1.0
    wide = coverage_factor(freedom) / coverage_factor(np.inf)
    variance = wide**2 * float(np.sum((scores / (1.0 - shares)) ** 2))
    for shown, step in zip((early[first:last], late[first + whole : last + whole]), resolutions, strict=True):
        held = np.flatnonzero(np.diff(shown, prepend=np.nan))
        variance += step**2 / 12.0 * float(np.sum(np.add.reduceat(turned, held) ** 2))
    deviation = float(np.sqrt(variance)) / power
    return CorrelationPeak(round(lag, 6), same, turn, last - first), deviation


def _window(away: Floats) -> Floats:
    """Kaiser's window of the interpolation (n,) [-] at distances (n,) [samples], TAPS at most."""
    return np.asarray(np.i0(_KAISER * np.sqrt(np.maximum(1.0 - (away / TAPS) ** 2, 0.0))))


def between_samples(time: Floats, values: Floats, at: Floats) -> Floats:
    """Values (n,) [any unit] at ``time`` (n,) [s] interpolated at other instants (m,) [s], (m,).

    Band-limited, by TAPS samples to either side (sinc, Kaiser's window); next to ends and gaps linearly, NaN in them.
    """
    found = interpolated(time, values, at)
    if len(time) <= 2 * TAPS or not at.size:
        return found
    place = np.interp(at, time, np.arange(len(time), dtype=float))
    below = np.floor(place).astype(int)
    total, weights = np.zeros((2, len(at)))
    for tap in range(1 - TAPS, TAPS + 1):
        away = place - (below + tap)
        weight = np.sinc(away) * _window(away)
        total += weight * values[np.clip(below + tap, 0, len(values) - 1)]
        weights += weight
    step = float(np.median(np.diff(time)))
    first, last = np.clip(below + 1 - TAPS, 0, len(time) - 1), np.clip(below + TAPS, 0, len(time) - 1)
    even = (last - first == 2 * TAPS - 1) & (time[last] - time[first] < (2 * TAPS - 0.5) * step)
    return np.where(even & (place > below) & np.isfinite(total) & np.isfinite(found), total / weights, found)


@dataclass(frozen=True)
class Difference:
    """A channel of a second run less that of a first, and how far that is known."""

    trace: Trace
    half_width: Trace | None
    """Of the 95 % interval of each value [unit]; None where it is not known."""
    text: str
    """What the interval is of, or why there is none."""


def _advice(late: Lag, shown: Trace) -> str:
    """What a lag that is not known leaves open, and what would tell it."""
    if PERIODIC in late.by:
        return "; log a trigger, or a motion that does not repeat itself"
    meant = ""
    if late.by == BEGINNING:
        _, rate, values = shown.beginning
        line = int(np.argmax(np.abs(np.fft.rfft(np.nan_to_num(values - np.nanmean(values))))))
        error = len(values) / rate / max(line, 1) / 2.0**0.5
        meant = (
            f", ± {1e3 * error:.0f} ms, as each may show it half a period late: differences of vibration mean nothing"
        )
    return f"{meant}; {_RELATE}{', or try testbench align' * (shown.kind not in (BASE, 'As recorded'))}"


def _unknown_noise(moves: float | None) -> str:
    """Why nothing shows the noise of a run, and what would."""
    if moves is None:
        return f"nothing tells until when a run rests, which shows the noise; {_RELATE}"
    return "a run has no complete record of rest before its motion, which shows the noise; record half a second of it"


def difference(first: Trace, second: Trace, late: Lag, moves: Sequence[float | None]) -> Difference:
    """The second less the first at the first's instants, shifted by the lag; its interval by noise at rest, and by the
    most that the second changes by within the 95 % interval of the lag.

    ``moves``: when the logger of each ceases to be at rest [s].
    """
    reach = coverage_factor(np.inf) * (late.deviation or 0.0) * second.beginning[1]

    def near(at: Floats) -> tuple[Floats, Floats]:
        step = float(second.blocks[0][-1] - second.blocks[0][0]) / max(second.samples, 1)
        margin = (2.0 * TAPS + np.ceil(reach)) * step
        return second.within(float(at[0]) - margin, float(at[-1]) + margin)

    def read(begin: int, end: int) -> tuple[Floats, Floats]:
        time, values = first.read(begin, end)
        return time, between_samples(*near(time + late.seconds), time + late.seconds) - values

    def shifted(values: Floats) -> Floats:
        at, moved = np.arange(len(values)), reach * np.linspace(-1.0, 1.0, 9)
        return np.asarray(np.max([np.abs(np.interp(at + by, at, values) - values) for by in moved], axis=0))

    def half_widths(begin: int, end: int) -> tuple[Floats, Floats]:
        time, _ = first.read(begin, end)
        there, values = near(time + late.seconds)
        return time, np.hypot(rest, interpolated(there, shifted(values), time + late.seconds))

    trace = Trace(first.kind, first.name, first.unit, first.samples, read)
    noises = first.noise(moves[0]), second.noise(moves[1])
    if late.deviation is None:
        return Difference(trace, None, f"no interval: aligned by {late.by} alone{_advice(late, first)}")
    if noises[0] is None or noises[1] is None:
        return Difference(trace, None, f"no interval: {_unknown_noise(moves[noises[0] is not None])}")
    variances, freedoms = np.array(noises).T
    rest = coverage_factor(effective_degrees_of_freedom(variances, freedoms)) * float(np.sqrt(variances.sum()))
    most = float(np.hypot(rest, np.nanmax(shifted(second.beginning[2]))))
    what = "interval of 95 % of each value by the noise of both runs at rest and by their alignment; offsets of the "
    what += "sensors are in the difference"
    sizes = " to ".join(dict.fromkeys(f"{size:.3g}" for size in (rest, most)))
    return Difference(trace, replace(trace, read=half_widths), f"± {sizes} {first.unit}, {what}")
