"""A motion from rest to rest through way-points, or of recorded samples; and its samples at instants."""

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

import numpy as np

from ..arrays import Floats
from ..datasets import FileDigest
from ..errors import CoarseSamples, DataError
from ..mechanism.mechanism import Mechanism
from .driven_coordinates import Drive

_SAMPLES_IN_RAMP = 2.0
_SAME_RATE, _EVEN = 1e-3, 0.2
"""How far the mean interval of samples, and each, may be from that of a rate that is theirs, in such intervals."""
_MAX_SAMPLES = 50_000_000
_LEAST_STEP = 1e-9
"""Share of a range below which a common step is not told from rounding of binary numbers."""
_MOST_OF_STEPS = 4.0
"""Acceleration, in steps a squared interval, below which steps make it."""
_MADE_BY_STEPS = 1.4
"""RMS acceleration, in the same, that rounding alone makes."""
_GAP = 10.0
"""Step of time, in the median step, from which something is missing."""
_FALSE = 0.03
"""RMS share of an acceleration that noise or a clock may make before it is said: of a peak it makes four times that."""
_BY = 5
"""Order of differences of accelerations in which noise is told: a motion of ten samples a period is not in them."""
_OF_NOISE = 940.0
"""Upper quartile of their squares over the mean square of the accelerations, both of white noise of positions.

Jumps of a true acceleration are in fewer of them, and about one their sum is up to 330 squared peaks; about one wrong
value that makes the peak it is 1100 or more.
"""
_ROUNDED = 256.0 * float(np.finfo(float).eps)
"""Share of a position by which it may change from sample to sample: rounding of a curve through it."""
_LEAST_ROUGH = 1e-6
"""Share of a step's speed by which it may change: rounding of numbers."""
_AROUND = 12
"""Samples to either side that one wrong value reaches."""
_MOSTLY = 0.9
"""Share of all roughness that is around one wrong value."""
_FEWEST, _PART = 12, 60
"""Samples from which faults are told, and of a part in which noise is told: a fast move is not as long."""
_JUMPS, _OF_CHANGES = 0.45, 1.8
"""Quantile of changes of second differences, and RMS acceleration over it, both of white noise of positions.

A jump of a true acceleration is in three of these changes at most: six samples apart, they leave half of them zero.
"""
_ROUGH = 0.5
"""Correlation of what changes from sample to sample, above which a clock that errs makes it."""
_EFFECT = (
    ": what this acceleration makes of forces, moments and torques is wrong by about {share:.2g} % of its RMS value "
    "from sample to sample, which adds {more:.2g} % to that RMS value; "
)
"""Of an error that is uncorrelated with the motion: squares add."""
_SAID = {
    "clock": "{name}: the instants of the samples are wrong by about {away:.2g} s, which makes {made:.3g} {unit}/s2 of "
    "the acceleration's {size:.3g} {unit}/s2 RMS"
    + _EFFECT
    + "write the time with more digits, of evenly spaced samples evenly, or the motion as [[moves]]",
    "steps": "{name}: the samples go in steps of {step:.3g} {unit}, each of which makes {made:.3g} {unit}/s2 "
    "(step / dt2, dt = {dt:.3g} s) of the acceleration's {size:.3g} {unit}/s2 RMS"
    + _EFFECT
    + "write more digits, or the motion as [[moves]]",
    "gap": "{name}: no sample between {begin:.6g} s and {end:.6g} s: a smooth curve is laid through, and forces there "
    "are those of the curve; record the motion without a gap",
    "noise": "{name}: the samples are rough{where}: {made:.3g} {unit}/s2 of the acceleration's {size:.3g} {unit}/s2 "
    "RMS, and some four times as much of its peak, change from sample to sample as noise does"
    + _EFFECT
    + "smooth the samples, or write the motion as [[moves]]",
    "value": "{name}: one value does not fit, about {instant:.6g} s: it makes an acceleration of {peak:.3g} {unit}/s2, "
    "and forces and torques there are its own; correct it, or leave its row out",
    "values": "{name}: several values do not fit{where}: they make an acceleration of {peak:.3g} {unit}/s2, and forces "
    "and torques there are their own; correct them, or leave their rows out",
}
"""What is said of each fault of samples."""
DEFAULT_RATE_HZ = 10_000.0
"""Sampling of a motion where none is asked for [Hz]: 15 samples in the shortest ramp of the test motions."""
RECORDED_SHARE = 0.02
"""Share by which a stated peak acceleration may differ from that of recorded samples: it was rounded."""


@dataclass(frozen=True)
class Samples:
    """A motion of the driven coordinates at instants."""

    time: Floats
    """Time, (n,) [s]."""
    position: Floats
    """Driven coordinates, (n, d) [m or rad]."""
    velocity: Floats
    """Their rates, (n, d) [m/s or rad/s]."""
    acceleration: Floats
    """Their second rates, (n, d) [m/s2 or rad/s2]."""
    joints: tuple[str, ...] = ()
    """Driven joints; empty where a point is driven."""
    point: str | None = None
    """Driven body (its own centre of mass) or site; None for the mechanism's payload body, or its only ``platform``."""
    axes: tuple[str, ...] = ("x", "y")
    """Axes of the base along which the point is driven."""
    sliding: tuple[bool, ...] = ()
    """Whether each driven joint is given in lengths, not angles; empty where the motion does not state it."""

    def check(self) -> None:
        """Raise DataError for a motion without samples, of unequal shapes, or with values that are not finite."""
        count = len(self.time)
        if not count:
            raise DataError("the motion holds no sample")
        for name in ("position", "velocity", "acceleration"):
            values = getattr(self, name)
            if values.ndim != 2 or len(values) != count:
                raise DataError(f"{name} of the motion has the shape {values.shape}: expected {count} rows, as time")
            if not np.isfinite(values).all():
                at = int(np.argmax(~np.isfinite(values).all(axis=1)))
                raise DataError(f"{name} of the motion is not finite at t = {self.time[at]:.6g} s")

    @cached_property
    def coarse(self) -> list[str]:
        """What is said of each driven coordinate whose acceleration is that of a fault: the first of ``_SAID``."""
        said = list[str]()
        for i, name in enumerate(self.joints or self.axes):
            unit = "rad" if self.joints and not any(self.sliding[i : i + 1]) else "m"
            for kind, of in islice(self._faults(i), 1):
                made = float(of.get("made", 0.0)) * (_MADE_BY_STEPS if kind == "steps" else 1.0)
                share = min(made / float(of.get("size", 1.0)), 1.0)
                effect = {"share": 100.0 * share, "more": 100.0 * (1.0 - math.sqrt(1.0 - share**2))}
                said.append(_SAID[kind].format(name=name, unit=unit, **of, **effect))
        return said

    def _faults(self, i: int) -> Iterator[tuple[str, dict[str, float | str]]]:
        """Faults of one coordinate's samples, in the order of ``_SAID``, each with the numbers of what is said."""
        a, between = self.acceleration[:, i], np.diff(self.time)
        if len(a) < _FEWEST:
            return
        dt, size, peak = float(np.median(between)), float(np.sqrt(np.mean(a**2))), float(np.abs(a).max())
        fastest, farthest = (float(np.abs(x[:, i]).max()) for x in (self.velocity, self.position))
        least = max(_FALSE * size, _LEAST_ROUGH * fastest / dt, _ROUNDED * farthest / dt**2)
        if (made := self._made_by_clock(i, dt)) > least:
            away = float(np.sqrt(np.mean(np.diff(between) ** 2) / 6.0))
            yield "clock", {"away": away, "made": made, "size": size}
        step = _common_step(self.position[:, i])
        made = step / dt**2
        if 1e-3 < size / (made or np.inf) < _MOST_OF_STEPS and np.mean(np.diff(a, 2) ** 2) > size**2:
            yield "steps", {"step": step, "made": made, "dt": dt, "size": size}
        at = int(np.argmax(between))
        if between[at] > _GAP * dt:
            yield "gap", {"begin": self.time[at], "end": self.time[at + 1]}
        rough, pace = np.diff(a, _BY) ** 2, np.diff(self.position[:, i]) / between
        changes = np.abs(np.diff(np.diff(pace) / (0.5 * (between[1:] + between[:-1]))))[1:-1]
        noise = _by_noise(rough, changes)
        noisy = np.flatnonzero(noise > least)
        made = float(np.sqrt(np.mean(noise[noisy] ** 2))) if len(noisy) else 0.0
        if len(noisy) == len(noise):
            yield "noise", {"made": made, "size": size, "where": ""}
        at, whole = int(np.argmax(rough)), np.cumsum(rough)
        near = float(np.sum(rough[max(at - _AROUND, 0) : at + _AROUND]))
        unlike = near > _OF_NOISE * max(peak, least) ** 2
        if unlike and near > _MOSTLY * whole[-1]:
            yield "value", {"instant": self.time[at + _BY // 2], "peak": peak}
        elif len(noisy):
            begin, end = (k * len(rough) // len(noise) + _BY // 2 for k in (noisy[0], noisy[-1] + 1))
            parts = f" in {len(noisy)} of {len(noise)} parts," if np.ptp(noisy) >= len(noisy) else ""
            where = f"{parts} between {self.time[begin]:.6g} s and {self.time[end]:.6g} s"
            yield "noise", {"made": made, "size": size, "where": where}
        elif unlike:
            begin, end = np.searchsorted(whole, (0.01 * whole[-1], 0.99 * whole[-1])) + _BY // 2
            yield "values", {"peak": peak, "where": f" between {self.time[begin]:.6g} s and {self.time[end]:.6g} s"}

    def _made_by_clock(self, i: int, dt: float) -> float:
        """RMS acceleration that errors of the instants make [m/s2 or rad/s2]; zero where they make none.

        Samples at instants that are e late seem accelerated by - v e'' more. Where the clock is even but for e, that is
        known from the instants; it is there if the acceleration changes from sample to sample as it does.
        """
        expected = self.velocity[1:-1, i] * np.diff(self.time, 2) / dt**2
        changes, seen = np.diff(expected, 3), np.diff(self.acceleration[1:-1, i], 3)
        sizes = np.linalg.norm(changes) * np.linalg.norm(seen)
        if not sizes or -(changes @ seen) < _ROUGH * sizes:
            return 0.0
        return float(-(changes @ seen) / (changes @ changes) * np.sqrt(np.mean(expected**2)))

    def drive(self, mechanism: Mechanism) -> Drive:
        """The driven coordinates as functions of a mechanism's joints. Raises ModelError for an unknown name."""
        if self.joints:
            return Drive.of_joints(mechanism, self.joints, self.sliding)
        place = self.point or next(iter(mechanism.payload_bodies), "platform")
        return Drive.of_point(mechanism, place, self.axes)


def _by_noise(rough: Floats, changes: Floats) -> Floats:
    """RMS acceleration that noise of positions makes in each of equal parts, (parts,); 0 of jumps alone.

    By squares of differences and changes, (n,); each part has ``_PART`` of them at least, or all. The last ends with
    them: parts overlap by what is over.
    """
    count = max(len(rough) // _PART, 1)
    size = -(-len(rough) // count)
    parts = np.linspace(0, len(rough) - size, count).astype(int)[:, None] + np.arange(size)
    by_squares = np.sqrt(np.quantile(rough[parts], 0.75, axis=1) / _OF_NOISE)
    return np.asarray(np.minimum(by_squares, _OF_CHANGES * np.quantile(changes[parts], _JUMPS, axis=1)))


def _common_step(values: Floats) -> float:
    """The largest step of which all differences are whole multiples, as of few digits or counts; 0 where none is seen.

    By Euclid's algorithm, down to a share of the range at which differences of numbers are rounding.
    """
    step, least, gaps = 0.0, _LEAST_STEP * float(np.ptp(values)), np.unique(np.abs(np.diff(values)))
    for gap in gaps[gaps > least].tolist():
        while gap > least:
            step, gap = gap, abs(math.remainder(step, gap))
        if step < 2.0 * least:
            return 0.0
    return step


@dataclass(frozen=True)
class Motion:
    """A motion from rest to rest through way-points on straight lines, or samples of a file.

    Each leg is one pulse of acceleration and one of deceleration, both trapezoids whose ramps take the share ``ramp``
    of the pulse each: jerk is limited. A leg of length d and peak acceleration a takes two pulses of
    T = sqrt(d / (a (1 - ramp))).
    """

    waypoints: Floats
    """Start and ends of the legs, (k, d) [m or rad]."""
    peak_acceleration: Floats
    """Along each leg, (k - 1,) [m/s2 or rad/s2]; not a number where the file leaves it to each run."""
    ramp: float
    """Share of each acceleration pulse spent in each of its two ramps, 0 to 0.5."""
    rest: float
    """Rest before the first leg and after each [s]."""
    joints: tuple[str, ...] = ()
    point: str | None = None
    axes: tuple[str, ...] = ("x", "y")
    recorded: Samples | None = None
    """Samples of a file, in place of legs."""
    sliding: tuple[bool, ...] = ()
    """Whether each driven joint is given in lengths, not angles; empty where a point is driven."""
    source: str = "motion"
    """What messages call it."""
    files: tuple[FileDigest, ...] = ()
    """Those that it was read from."""

    def with_peak_acceleration(self, acceleration: float) -> "Motion":
        """The same path with another peak acceleration [m/s2 or rad/s2]; recorded samples are as they are.

        Raises DataError for one that is not that of recorded samples: along the leg, or the largest of one coordinate.
        """
        if not acceleration > 0:
            raise DataError(f"peak acceleration is {acceleration:g}: expected a positive one")
        if len(set(self.sliding)) > 1:
            raise DataError("the motion drives joints that turn and joints that slide: one acceleration cannot be both")
        if self.recorded is not None:
            sizes = np.abs(self.recorded.acceleration)
            own = sorted({float(np.linalg.norm(sizes, axis=1).max()), float(sizes.max())})
            if any(abs(acceleration / peak - 1.0) <= RECORDED_SHARE for peak in own if peak):
                return self
            unit = "m/s2" if not self.recorded.joints or any(self.recorded.sliding) else "rad/s2"
            peaks = " (one coordinate) and ".join(f"{peak:.4g} {unit}" for peak in own)
            raise DataError(
                f"peak acceleration is stated as {acceleration:.4g} {unit}, that of the recorded samples is {peaks}"
                f"{' (along the leg)' * (len(own) > 1)}: leave it out, or correct it, or give a motion with moves"
            )
        return replace(self, peak_acceleration=np.full(len(self.waypoints) - 1, acceleration))

    @property
    def duration(self) -> float:
        """From the first to the last instant [s]."""
        if self.recorded is not None:
            return float(self.recorded.time[-1] - self.recorded.time[0])
        return float(self._phases()[0][-1])

    def sample_as_asked(self, rate_hz: float | None, otherwise: float = DEFAULT_RATE_HZ) -> Samples:
        """Sample at the rate that was asked for, if one was. Raises DataError for another than samples of a file have.

        Warns (CoarseSamples) of samples whose acceleration is that of a fault.
        """
        if rate_hz is not None and self.recorded is not None:
            off = rate_hz * np.diff(self.recorded.time) - 1.0
            if not (len(off) and abs(off.mean()) <= _SAME_RATE and np.abs(off).max() <= _EVEN):
                raise DataError(
                    f"{self.source}: a rate of {rate_hz:g} Hz is not that of its samples, which come at their own "
                    "instants: leave the rate out, or write the motion as [[moves]]"
                )
        for said in self.recorded.coarse if self.recorded else ():
            warnings.warn(said, CoarseSamples, stacklevel=3)
        return self.sample(otherwise if rate_hz is None else rate_hz)

    def sample(self, rate_hz: float) -> Samples:
        """Sample the motion at a uniform rate; samples of a file come as they are, whatever the rate."""
        if self.recorded is not None:
            return self.recorded
        if not 0 < rate_hz * self.duration < _MAX_SAMPLES:
            raise DataError(f"{rate_hz:g} Hz for {self.duration:g} s: expected fewer than {_MAX_SAMPLES} samples")
        legs = np.linalg.norm(np.diff(self.waypoints, axis=0), axis=1)
        pulse = float(np.sqrt((legs / self.peak_acceleration).min() / (1.0 - self.ramp)))
        shortest = pulse * (self.ramp or 1.0)
        if rate_hz * shortest < _SAMPLES_IN_RAMP:
            raise DataError(
                f"{rate_hz:g} Hz is too slow for this motion, whose acceleration changes within {shortest:.3g} s: "
                f"expected at least {_SAMPLES_IN_RAMP / shortest:.3g} Hz"
            )
        time = np.arange(int(np.ceil(self.duration * rate_hz)) + 1) / rate_hz
        return Samples(time, *self._at(time), self.joints, self.point, self.axes, self.sliding)

    def _at(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Position, velocity, acceleration: p = p0 + v0 t + a0 t2/2 + j t3/6 within each phase of constant jerk."""
        ends, p0, v0, a0, jerk = self._phases()
        phase = np.searchsorted(ends[:-1], time, side="right") - 1
        t = (np.minimum(time, ends[-1]) - ends[phase])[:, None]
        p, v, a, j = p0[phase], v0[phase], a0[phase], jerk[phase]
        return p + t * (v + t * (a / 2 + t * j / 6)), v + t * (a + t * j / 2), a + t * j

    def _phases(self) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Bounds of the phases of constant jerk (k + 1,) and the state at the start of each, (k, d)."""
        if np.isnan(self.peak_acceleration).any():
            raise DataError(
                f"{self.source}: peak_acceleration: missing: add it, or state that of each run in the run table or plan"
            )
        duration, jerk = [self.rest], [np.zeros(self.waypoints.shape[1])]
        for start, end, peak in zip(self.waypoints, self.waypoints[1:], self.peak_acceleration, strict=False):
            for seconds, share in self._leg(float(np.linalg.norm(end - start)), float(peak)):
                duration.append(seconds)
                jerk.append(share * (end - start) / np.linalg.norm(end - start))
            duration.append(self.rest)
            jerk.append(np.zeros_like(start))
        ends = np.concatenate([[0.0], np.cumsum(duration)])
        p, v, a = [self.waypoints[0]], [np.zeros_like(jerk[0])], [np.zeros_like(jerk[0])]
        for t, j in zip(duration, jerk, strict=True):
            p.append(p[-1] + t * (v[-1] + t * (a[-1] / 2 + t * j / 6)))
            v.append(v[-1] + t * (a[-1] + t * j / 2))
            a.append(a[-1] + t * j)
        return ends, np.array(p[:-1]), np.array(v[:-1]), np.array(a[:-1]), np.array(jerk)

    def _leg(self, length: float, peak: float) -> list[tuple[float, float]]:
        """Durations [s] and jerks of a leg of ``length``, the acceleration being a step where ``ramp`` is zero."""
        pulse = np.sqrt(length / (peak * (1.0 - self.ramp)))
        ramp, flat = max(self.ramp, 1e-9) * pulse, (1.0 - 2.0 * max(self.ramp, 1e-9)) * pulse
        jerk = peak / ramp
        return [(ramp, jerk), (flat, 0.0), (ramp, -jerk), (ramp, -jerk), (flat, 0.0), (ramp, jerk)]
