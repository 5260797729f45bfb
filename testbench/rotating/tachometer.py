"""The turns of a rotor by a tachometer: instants of the pulses of one mark, and whether the speed is steady.

A pulse that rises within one sampling step is only known to lie between two samples. Where the positions within a step
are spread evenly, these errors average out; where the sampling is synchronous with the rotor, all pulses are early or
late by the same time. That common error and its interval are estimated by the profile likelihood of a smooth motion
with normal scatter, observed in steps.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import LEVEL, coverage_factor, log_normal_probability

from ..errors import AnalysisError
from .encoder_edges import Gap, lost_edges, spurious_edges

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.interpolate import BSpline

DITHERED = 0.6
"""Scatter of instants [steps] above which errors are independent: two neighbouring samples explain at most 0.5."""
_DEGREE = 3
_MOST_PULSES = 400
_SHARPNESS = (0.2, 100.0)
"""Range of one over the scatter of single pulses [1/steps]."""
_LIKELY = coverage_factor() ** 2
"""Twice the drop of the log-likelihood to the ends of a 95 % interval (chi squared, one degree of freedom)."""
_PLACES = np.linspace(-1.0, 1.0, 81)
_ROUNDS, _HALVINGS, _ENOUGH = 40, 6, 1e-3


def common_timing_error(before: Floats, after: Floats, found: Floats) -> tuple[float, float]:
    """Time by which all pulses ``found`` (n,) [s] are too early, and half its 95 % interval [s].

    ``before`` and ``after`` (n,) [s] are the instants of the samples around each pulse. The scatter of single pulses
    about a smooth motion is not in the interval. Both are zero where that scatter exceeds the steps.
    """
    step = float(np.median(after - before))
    if len(found) > _MOST_PULSES:
        chosen = np.linspace(0, len(found) - 1, _MOST_PULSES).astype(int)
        before, after, found = before[chosen], after[chosen], found[chosen]
    number = np.linspace(-1.0, 1.0, len(found))
    motion = np.polynomial.Polynomial.fit(number, found, _DEGREE)(number)
    scatter = float(np.std(found - motion)) / step
    if scatter > DITHERED:
        return 0.0, 0.0
    off = motion - motion.mean() + found.mean()
    # Polynomials of the motion with mean zero, (n, degree) [-].
    shapes = np.polynomial.legendre.legvander(number, _DEGREE)[:, 1:]
    low, high = _likely(shapes - shapes.mean(axis=0), (before - off) / step, (after - off) / step)
    own = coverage_factor() * scatter / np.sqrt(len(found))
    half = float(np.sqrt(max(0.0, (0.5 * (high - low)) ** 2 - own**2)))
    return 0.5 * (low + high) * step, half * step


def _likely(shapes: Floats, low: Floats, high: Floats) -> tuple[float, float]:
    """Ends of the likely common error [steps]."""
    profile = _profile(_PLACES[:, None], shapes, low, high)
    likely = _PLACES[profile >= profile.max() - 0.5 * _LIKELY]
    half = 0.5 * (_PLACES[1] - _PLACES[0])
    return float(likely[0]) - half, float(likely[-1]) + half


def _profile(place: Floats, shapes: Floats, low: Floats, high: Floats) -> Floats:
    """Profile log-likelihood at each common error (places, 1) [steps], by Newton's method.

    It is concave in the shape over the scatter and in one over the scatter.
    """
    columns = [np.stack([np.broadcast_to(-shape, (len(place), len(low))) for shape in shapes.T], axis=2)] * 2
    ends = [np.concatenate([c, (end - place)[..., None]], axis=2) for c, end in zip(columns, (low, high), strict=True)]
    x = np.tile(np.r_[np.zeros(shapes.shape[1]), 4.0], (len(place), 1))
    best = _log_between(*(_times(end, x) for end in ends))[0].sum(axis=1)
    for _ in range(_ROUNDS):
        step = _newton(x, ends)
        moved = np.zeros(len(place), dtype=bool)
        for share in 0.5 ** np.arange(_HALVINGS):
            tried = x + share * step
            tried[:, -1] = tried[:, -1].clip(*_SHARPNESS)
            value = _log_between(*(_times(end, tried) for end in ends))[0].sum(axis=1)
            better = (value > best + _ENOUGH) & ~moved
            x[better], best[better] = tried[better], value[better]
            moved |= better
        if not moved.any():
            break
    return best


def _times(end: Floats, x: Floats) -> Floats:
    return np.einsum("pnk,pk->pn", end, x)


def _newton(x: Floats, ends: list[Floats]) -> Floats:
    """Newton's step, (places, parameters); the sharpness stays where it would leave its bounds."""
    at = [_times(end, x) for end in ends]
    slopes = _log_between(*at)[1]
    gradient = sum(np.einsum("pn,pnk->pk", s, end) for s, end in zip(slopes, ends, strict=True))
    curve = np.zeros((*x.shape, x.shape[1]))
    for i in (0, 1):
        for j in (0, 1):
            second = -slopes[i] * slopes[j] - (at[i] * slopes[i] if i == j else 0.0)
            curve += np.einsum("pn,pnk,pnl->pkl", second, ends[i], ends[j])
    sharp = x[:, -1]
    rests = ((sharp <= _SHARPNESS[0]) & (gradient[:, -1] < 0)) | ((sharp >= _SHARPNESS[1]) & (gradient[:, -1] > 0))
    gradient[rests, -1] = 0.0
    curve[rests, -1, :] = curve[rests, :, -1] = 0.0
    ridge = 1e-9 * (1.0 + np.abs(curve).max(axis=(1, 2)))[:, None, None] * np.eye(x.shape[1])
    curve[rests, -1, -1] = -1.0
    return np.linalg.solve(ridge - curve, gradient[..., None])[..., 0]


def _log_between(low: Floats, high: Floats) -> tuple[Floats, tuple[Floats, Floats]]:
    """log(Phi(high) - Phi(low)) of the normal distribution, and its derivatives by low and high."""
    flip = low + high > 0.0  # the lower tail is the one that floating point resolves
    a, b = log_normal_probability(np.where(flip, -high, low)), log_normal_probability(np.where(flip, -low, high))
    log = b + np.log1p(-np.exp(np.minimum(a - b, -1e-12)))
    slopes = [np.exp(-0.5 * end**2 - 0.5 * np.log(2.0 * np.pi) - log) for end in (low, high)]
    return log, (-slopes[0], slopes[1])


LEAST_TURNS = 10
"""Least number of turns."""
STEADY_WITHIN = 0.01
"""Largest change of speed in a record, of its mean, that counts as steady."""
_REARM = 0.2
"""Share of the swing by which the signal must fall below the level before the next pulse counts."""
_BLOCKS = 8
_UNIFORM = coverage_factor() / (LEVEL * np.sqrt(3.0))
"""Twice the deviation of a uniform error, of the half width that holds 95 % of it."""
_IN_STEP = 0.1
"""Common timing error of steep pulses [samples] above which the sampling counts as synchronous."""
_OFFSETS, _A_TURN = 16, 20
"""Places of the samples within a step, for which pulses are rounded anew, and samples that suffice of a turn."""
_SMOOTH = 5
"""Degree of the pieces of the smooth motion: its speed has as many derivatives as powers of it are fitted."""
_TURNS_A_PIECE = 2
"""Least turns of a piece of the smooth motion."""
_STEPS_A_TURN = 16
"""At which the speed of the smooth motion is given."""
_ROUNDED = 0.31
"""Scatter of instants about a smooth motion [steps] that steps alone explain: 12^-0.5, and a little."""
_EXACT = 1e-3
"""The same where pulses are interpolated between samples."""
_REDRAWN = 12
"""Times that the pulses are drawn anew."""
_ODD = 3
"""Increments of an encoder at either end that may be of lost samples."""
_ALIKE = 1e-6
"""Share by which increments of one value may differ, by rounding."""
_STEEP = 0.3
"""Share of the swing within one sample above which the crossing cannot be interpolated."""
MOST_MARKS = 12
"""Marks a turn that are looked for where one is expected."""
_UNEQUAL = 0.005
"""Difference of pitches, of their mean, from which they repeat."""
_RANGE_SEEN = 6.0
"""Range of up to 12 means over their standard deviation that noise exceeds once in 1000."""
_AS_WELL = 1.5
"""Scatter about a repetition over the least one up to which it explains the pitches as well."""
_ODD_MARK = 0.05
"""Share of an even pitch by which the widest exceeds the others where its mark can be told from them."""


@dataclass(frozen=True)
class Turns:
    """Whole turns between pulses."""

    pulses: Floats
    """Instants of the pulses, (turns + 1,) [s]."""
    resolution: float
    """Step of the samples that the pulses were timed with [s]."""
    timing: float = 0.0
    """Half the 95 % interval of a timing error common to all pulses [s]."""
    steep: bool = False
    """Whether pulses rise within a sample, so that their instants between two samples are unknown."""
    is_synchronous: bool = False
    """Whether the sampling is synchronous with the rotor, so that timing errors do not average out."""
    marks: int = 1
    """Marks a turn, of which one is timed."""
    is_same_mark: bool = True
    """Whether that one is the same in each record: that after the widest pitch, or the only one."""
    repeats: int = 1
    """Number of turns, counted so, after which their durations repeat: 1, or perhaps the marks of a turn."""

    @property
    def timing_normal_within(self) -> float:
        """Half the 95 % interval of a normal error of the same standard deviation, for sums of errors [s]."""
        return self.timing * (_UNIFORM if self.steep else 1.0)

    @property
    def count(self) -> int:
        """Number of whole turns."""
        return len(self.pulses) - 1

    @property
    def speed(self) -> float:
        """Mean speed [turns/s]."""
        return self.count / float(self.pulses[-1] - self.pulses[0])

    @property
    def change(self) -> float:
        """Largest less smallest speed over the mean [-], of blocks of turns and of single turns.

        A pulse is timed to a sample, so up to two samples of a single turn's duration are no change.
        """
        edges = np.linspace(0, self.count, min(_BLOCKS, self.count // 2) + 1).astype(int)
        blocks = np.diff(edges) / np.diff(self.pulses[edges])
        blur = 2.0 * self.resolution * self.speed
        return float(max(np.ptp(blocks), np.ptp(1.0 / np.diff(self.pulses)) - blur * self.speed) / self.speed)

    @property
    def rounding(self) -> float:
        """Standard deviation of a pulse's instant by the steps of the samples, apart from the common error [s]."""
        return self.resolution / 12.0**0.5 if self.steep and not self.is_synchronous else 0.0

    def shrinking(self, order: int) -> tuple[float, float]:
        """Factor on an order's vector by the rounding of steep pulses to samples [-], and its standard deviation, for
        the place of the samples within a step is not known.

        At a steady speed the errors of the pulses are a sawtooth, whose frequency is what is left of the samples a turn
        over whole ones: the spline hands a slow one on, and less of one that nearly alternates. So the pulses of a
        smooth motion are rounded anew, and what that does to the order is seen.
        """
        from scipy.interpolate import CubicSpline

        if not self.rounding or self.speeds is not None:
            return 1.0, 0.0
        motion, scatter = self._motion
        number = np.arange(len(self.pulses))
        exact = (motion(number) - motion(0.0)) / self.resolution
        most = max(0.5 * float(np.diff(exact).min()) - 0.75, 0.0)  # pulses stay in their order
        own = min((3.0 * max(scatter**2 - _ROUNDED**2, 0.0)) ** 0.5, most)
        exact = exact + np.random.default_rng(0).uniform(-own, own, len(exact))
        found = np.zeros(_OFFSETS, dtype=complex)
        every = max(1, int(exact[-1] / self.count / _A_TURN))
        for k in range(_OFFSETS):
            true = exact + 1.0 + (k + 0.5) / _OFFSETS
            seen = np.floor(true) + 0.5
            sample = np.arange(np.ceil(seen[0]), seen[-1], every)
            error = CubicSpline(seen, number)(sample) - CubicSpline(true, number)(sample)
            window = np.sin(np.pi * (np.arange(len(sample)) + 0.5) / len(sample)) ** 2
            found[k] = window @ np.exp(2j * np.pi * order * error) / window.sum()
        return float(np.abs(found).mean()), float(np.abs(found).std())

    @cached_property
    def _motion(self) -> "tuple[BSpline, float]":
        """Instants of the pulses of a smooth motion [s] over their number, and what is left [steps]: a steady one if
        steps explain what that leaves, else in as many pieces as predict pulses best (generalised cross-validation).
        """
        from scipy.interpolate import make_lsq_spline

        number, found, most = np.arange(len(self.pulses), dtype=float), [], max(1, self.count // _TURNS_A_PIECE)
        for degree, pieces in [(1, 1), *((_SMOOTH, most >> k) for k in reversed(range(most.bit_length())))]:
            inner = np.linspace(0.0, self.count, pieces + 1)
            knots = np.r_[[0.0] * degree, inner, [self.count] * degree]
            # the default, "qr", takes time by turns times pieces
            spline = make_lsq_spline(number, self.pulses, knots, degree, method="norm-eq")
            free = 1.0 - (degree + pieces) / len(number)
            scatter = float(np.std(self.pulses - spline(number))) / self.resolution / free**0.5
            found.append((scatter / free**0.5, scatter, spline))
            if scatter < (_ROUNDED if self.steep and degree == 1 else _EXACT):
                return spline, scatter
        _, scatter, spline = min(found, key=lambda one: one[0])
        return spline, scatter

    @property
    def unfollowed(self) -> float:
        """Change of speed from turn to turn, of its mean [-], that neither the smooth motion nor steps explain."""
        _, scatter = self._motion
        left = max(0.0, scatter**2 - (_ROUNDED**2 if self.steep else 0.0)) ** 0.5
        return 4.0 * left * self.resolution * self.speed  # a sine's range, of turns between independent instants

    @cached_property
    def speeds(self) -> Floats | None:
        """Speed of the smooth motion on even steps of the angle, (n,) [turns/s]; None where it is steady."""
        motion, _ = self._motion
        if motion.k == 1:
            return None
        found: Floats = 1.0 / motion.derivative()(np.linspace(0.0, self.count, _STEPS_A_TURN * self.count + 1))
        return found

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed of the smooth motion [turns/s]."""
        found = self.speeds
        return (self.speed, self.speed) if found is None else (float(found.min()), float(found.max()))

    def off_range(self, speed: float) -> tuple[float, float]:
        """The speed of the record that is nearest to ``speed`` [turns/s], and how far that is from it, as a share."""
        at = min(max(speed, self.speed_range[0]), self.speed_range[1])
        return at, abs(speed / at - 1.0)

    def contain(self, time: Floats) -> "NDArray[np.bool_]":
        """Which of ``time`` (n,) [s] are within the turns, (n,)."""
        return (time >= self.pulses[0]) & (time < self.pulses[-1])

    def angle(self, time: Floats) -> Floats:
        """Angle of the rotor since the first pulse at ``time`` (n,) [s], (n,) [turns]: that of the smooth motion where
        the speed changes, for errors of single pulses would move the vector with it; else a cubic spline.

        The spline hands on the pulses' slow timing errors alike up to 0.3 periods a turn (97 % of their power, a line
        between pulses 60 %), so that the lines near an order show what they do to its phase.
        """
        from scipy.interpolate import CubicSpline

        motion, number, pulses = self._motion[0], np.arange(len(self.pulses), dtype=float), self.pulses
        if motion.k > 1:
            number = np.linspace(0.0, self.count, _STEPS_A_TURN * self.count + 1)
            pulses = motion(number)
        found: Floats = CubicSpline(pulses, number)(time)
        return found

    @property
    def is_coarse(self) -> bool:
        """Whether the smooth motion leaves errors of the pulses."""
        return self._motion[1] > _EXACT

    @cached_property
    def redrawn(self) -> "tuple[Turns, ...]":
        """The smooth motion with new errors of its pulses, of the size of those that it leaves."""
        motion, scatter = self._motion
        late = np.random.default_rng(0).normal(0.0, scatter * self.resolution, (_REDRAWN, len(self.pulses)))
        return tuple(replace(self, pulses=motion(np.arange(len(self.pulses), dtype=float)) + one) for one in late)


@dataclass(frozen=True)
class Mark:
    """Where a turn begins in the signal of a tachometer."""

    level: float | None = None
    """Level of a pulse [unit of the signal]; None for half its swing."""
    falling: bool = False
    doubt: float = 0.0
    """Standard deviation of the angle of the rotor at the mark [rad], beside what the record shows."""
    in_step: bool = False
    """Whether an encoder is sampled in step with the rotor, so that its counts are not seen."""


def encoder_mark(angle: Floats) -> tuple[Floats, Mark]:
    """An encoder's ``angle`` (n,) [rad], counting on or back at zero, as signal (n,) of a tachometer: its sine.

    A count reads its lower end in either sense, so the angle is half a count more in the mean; that half is in doubt.
    Increments of one value are those of sampling in step: a count is at most the increment, and all of it is in doubt,
    for readings may be off alike by any part of it.
    """
    turned = np.unwrap(angle)
    sense = 1.0 if turned[-1] > turned[0] else -1.0
    steps = np.sort(np.diff(turned))[_ODD:-_ODD]
    in_step = len(steps) > 0 and float(np.ptp(steps)) < _ALIKE * abs(float(steps[0]))
    # increments differ by whole counts
    count = abs(float(steps[0])) if in_step else float(np.diff(steps).max(initial=0.0))
    return np.sin(sense * (turned + 0.5 * count)), Mark(
        0.0, doubt=count / (3.0 if in_step else 12.0) ** 0.5, in_step=in_step
    )


def tacho_pulses(time: Floats, signal: Floats, level: float | None = None, falling: bool = False) -> Floats:
    """Instants (pulses,) [s] at which ``signal`` (n,) at ``time`` (n,) [s] rises (falls) through ``level`` [unit].

    The default level is half the swing.
    """
    level = half_swing(time, signal, falling)[0] if level is None else level
    return _crossings(time, signal, level, falling)


def half_swing(time: Floats, signal: Floats, falling: bool = False) -> tuple[float, float]:
    """Mean over the turns of the middle between a turn's extremes, and its standard error [unit].

    ``signal`` (n,) [unit] at ``time`` (n,) [s]. The extremes of the whole record would depend on noise; without turns
    they give the middle, with error zero.
    """
    middle = 0.5 * float(signal.min() + signal.max())
    begins = np.searchsorted(time, _crossings(time, signal, middle, falling))
    if len(begins) < 3:
        return middle, 0.0
    inside, starts = signal[begins[0] : begins[-1]], begins[:-1] - begins[0]
    each = 0.5 * (np.maximum.reduceat(inside, starts) + np.minimum.reduceat(inside, starts))
    return float(each.mean()), float(each.std(ddof=1) / np.sqrt(len(each)))


def _crossings(time: Floats, signal: Floats, level: float, falling: bool) -> Floats:
    rising = level - signal if falling else signal - level
    above, below = rising > 0.0, rising < -_REARM * float(np.ptp(signal))
    known = above | below
    last = np.maximum.accumulate(np.where(known, np.arange(len(signal)), 0))
    state = above[last]
    at = np.flatnonzero(state[1:] & ~state[:-1])
    share = rising[at] / (rising[at] - rising[at + 1])
    return time[at] + share * (time[at + 1] - time[at])


def repeating_pitch(pulses: Floats, resolution: float) -> int:
    """Number of ``pulses`` (n,) [s], timed to ``resolution`` [s], after which unequal intervals repeat; 1 for none."""
    log, found = np.log(np.diff(pulses)), []
    least = max(_UNEQUAL, 2.0 * resolution / float(np.median(np.diff(pulses))))
    for n in range(2, min(MOST_MARKS, len(log) // LEAST_TURNS) + 1):
        window = np.ones(n | 1)
        window[[0, -1]] -= 0.5 * (1 - n % 2)
        course = log[n // 2 : len(log) - n // 2] - np.convolve(log, window / n, "valid")  # less what changes slowly
        rows = course[: len(course) // n * n].reshape(-1, n)
        pitch, scatter = rows.mean(axis=0), float(rows.std())
        seen = float(np.ptp(pitch)) > max(least, _RANGE_SEEN * scatter / len(rows) ** 0.5)
        found.append((float((rows - pitch).std()), n, seen))
    close = _AS_WELL * min((scatter for scatter, *_ in found), default=0.0) + 1e-9
    return next((n for scatter, n, seen in found if seen and scatter <= close), 1)


def _one_mark(pulses: Floats, marks: int, resolution: float) -> tuple[Floats, bool]:
    """The pulses (n,) [s] of one of the marks, and whether it can be told: that after the widest pitch."""
    turns = (len(pulses) - 1) // marks
    begins = pulses[: turns * marks + 1 : marks]
    pitch = np.mean(np.diff(pulses[: turns * marks + 1]).reshape(turns, marks) / np.diff(begins)[:, None], axis=0)
    order, blur = np.argsort(pitch), 2.0 * resolution * turns / float(begins[-1] - begins[0])
    is_same_mark = marks == 1 or float(pitch[order[-1]] - pitch[order[-2]]) > max(_ODD_MARK / marks, blur)
    return pulses[(int(order[-1]) + 1) % marks if is_same_mark else 0 :: marks], is_same_mark


def steady_turns(
    name: str,
    time: Floats,
    signal: Floats,
    level: float | None,
    falling: bool,
    within: float,
    doubt: float = 0.0,
    in_step: bool = False,
    marks: int = 1,
) -> Turns:
    """Turns of a record at steady speed: ``signal`` (n,) [unit of ``level``] at ``time`` (n,) [s].

    ``doubt`` is the standard deviation of the angle at the mark [rad], ``in_step`` whether an encoder is sampled so;
    ``marks`` are those of a turn.

    Raises AnalysisError for a signal without pulses, too few turns, lost or spurious pulses, a speed that changes by
    more than ``within`` of its mean.
    """
    guessed, found = level is None, tacho_pulses(time, signal, level, falling)
    if len(found) < (LEAST_TURNS + 1) * marks:
        raise AnalysisError(
            f"{name}: {len(found)} pulses in {time[-1] - time[0]:.3g} s, values {signal.min():g} to {signal.max():g}: "
            f"expected at least {(LEAST_TURNS + 1) * marks}, {marks} a turn; try another channel, --level, or a longer "
            "record; an encoder is taken where its channel is an angle, by its unit (rad, deg) or the rig: ingest it so"
        )
    step = float(np.median(np.diff(time)))
    repeats = repeating_pitch(found, step) if marks == 1 else 1
    several = f"; or, as intervals repeat every {repeats} pulses, {give_marks(repeats)}" if repeats > 1 else ""
    a_turn = marks if marks > 1 else len(found)  # of one mark no odd interval is a slot's, which comes again
    if gaps := lost_edges(found, a_turn):
        places = "; ".join(gap.text().replace("edge", "pulse") for gap in gaps[:8])
        raise AnalysisError(
            f"{name}: {_count(gaps)} lost: {places}. Turns counted through a gap would be "
            f"wrong: check --level and the distance of the sensor, or cut the record{several}"
        )
    if extra := spurious_edges(found, a_turn):
        places = ", ".join(f"{found[k]:.6f} s" for k in extra[:8])
        raise AnalysisError(
            f"{name}: {len(extra)} pulse{'s' * (len(extra) > 1)} too many, at {places}: expected {marks} a turn; "
            f"check --level{several}"
        )
    found, is_same_mark = _one_mark(found, marks, step)
    turns = _timed(time, signal, found, half_swing(time, signal, falling)[1] if guessed else 0.0)
    turns = replace(
        turns,
        timing=float(np.hypot(turns.timing, coverage_factor() * doubt / (2.0 * np.pi * turns.speed))),
        is_synchronous=turns.is_synchronous or in_step,
        marks=marks,
        is_same_mark=is_same_mark,
        repeats=repeats,
    )
    if turns.change > within:
        raise AnalysisError(
            f"{name}: the speed changes by {100 * turns.change:.2g} % of its mean {60 * turns.speed:.5g} rpm; expected "
            f"at most {100 * within:g} %: cut out a steady part by begin and end (--from, --to), or give steady_within "
            "(--steady-within): vectors are then fitted over the speed and given at one, speed (--speed), with how far "
            f"they move over its range{several}"
        )
    return turns


def _timed(time: Floats, signal: Floats, found: Floats, level_error: float) -> Turns:
    """Turns with the common timing error: of slow pulses by the level's error, of steep ones by the samples."""
    step = float(np.median(np.diff(time)))
    after = np.searchsorted(time, found, side="right").clip(1, len(time) - 1)
    rise = float(np.median(np.abs(signal[after] - signal[after - 1])))
    if rise <= _STEEP * float(np.ptp(signal)):
        return Turns(found, step, coverage_factor() * level_error / rise * step)
    later, within = common_timing_error(time[after - 1], time[after], found)
    return Turns(found + later, step, within, steep=True, is_synchronous=within > _IN_STEP * step)


def give_marks(count: int) -> str:
    """A question for people."""
    return f"{count} mark{'s' * (count > 1)} a turn? pulses={count} (--pulses {count})"


def _count(gaps: list[Gap]) -> str:
    missing = sum(gap.missing for gap in gaps)
    return f"{missing} pulse{'s' * (missing > 1)}"
