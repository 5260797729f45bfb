"""Recorded positions -> position, velocity and acceleration on an even grid, with a stated bandwidth.

Recorded instants are not even: samples are interpolated by a cubic spline through all of them. The low-pass is a
Butterworth filter of fourth order run forwards and backwards (zero phase, half of the amplitude at the cut-off).
Derivatives are those of a spline of fifth degree through the smoothed samples; differences would be a per cent too
small at a tenth of the sampling rate.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError

ORDER = 4
"""Of the low-pass, each way."""
LARGEST_STEP = 5.0
"""Longest step between samples, in median steps, that a spline may bridge."""
FEWEST_INSTANTS = 6
"""Of a clock on which something is interpolated: the highest spline is of degree five."""
_EVEN = 1e-6
"""Share of the longest step by which steps of an even clock may differ: its step is then their mean."""
HIGHEST_CUTOFF = 0.4
"""Of a low-pass, as a part of the sampling rate."""
REST_PART, REST_SPEED = 0.05, 0.1
"""Of a joint's top speed, below which it rests; the largest for what turns [rad/s]."""
DRY_PART = 0.05
"""Of the speed below which a joint rests, over which dry friction turns: as good as its sign."""
READING_SIGMA, STEP_SPEED = 6.0, 2.5
"""Deviations of a reading's noise that count as a step; what a low-passed step is slower than, in cut-offs (2.04)."""
ALMOST = 1.0 - 1e-9
"""Factor on what is compared with a rate, so that the rounding of a clock's steps does not decide."""


@dataclass(frozen=True)
class Grid:
    """Even instants: sample i at ``start + i step`` [s]."""

    start: float
    step: float
    count: int

    @property
    def time(self) -> Floats:
        """The instants, (count,) [s]."""
        return self.start + self.step * np.arange(self.count)

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return 1.0 / self.step


@dataclass(frozen=True)
class Rates:
    """Smoothed positions and their first and second derivatives, (n, joints) each [rad, rad/s, rad/s2, or m, ...]."""

    q: Floats
    v: Floats
    a: Floats


def grid_of(time: Floats, what: str, bridged: bool = False) -> Grid:
    """The even grid over recorded instants (n,) [s], of their median step; ``what`` names them in messages.

    Raises AnalysisError for fewer than FEWEST_INSTANTS, where time does not increase, or has a gap that the caller does
    not mask (``bridged``).
    """
    steps = np.diff(time)
    least, most = float(steps.min(initial=np.inf)), float(steps.max(initial=-np.inf))
    expected = f"expected a clock of {FEWEST_INSTANTS} or more; export the log again, or repeat the run"
    if not np.isfinite(most - least):
        raise AnalysisError(f"{what}: {len(time)} instants, or some that are not numbers: {expected}")
    if not least > 0.0:
        worst = int(np.argmin(steps)) + 1
        raise AnalysisError(f"{what}: time does not increase at sample {worst} ({time[worst]:.9g} s)")
    even = most - least < _EVEN * most
    median = float(time[-1] - time[0]) / len(steps) if even else float(np.median(steps))
    if most > LARGEST_STEP * median and not bridged:
        raise AnalysisError(
            f"{what}: a gap of {most:.6g} s after {time[np.argmax(steps)]:.9g} s, where steps are {median:.6g} s: "
            "nothing is interpolated there; cut the log into two runs"
        )
    if len(time) < FEWEST_INSTANTS:
        raise AnalysisError(f"{what}: {len(time)} instants: {expected}")
    return Grid(float(time[0]), median, int((time[-1] - time[0]) / median + 1e-6) + 1)


def on_grid(time: Floats, values: Floats, grid: Grid) -> Floats:
    """``values`` (n, k) [any unit] at recorded instants (n,) [s], interpolated by a cubic spline, (count, k).

    The values themselves where the instants are those of the grid, to a millionth of its step.
    """
    if len(time) == grid.count and np.abs(time - grid.time).max() < 1e-6 * grid.step:
        return values
    from scipy.interpolate import make_interp_spline

    return np.asarray(make_interp_spline(time, values, 3)(grid.time))


def bridge_gaps(time: Floats, values: Floats, step: float) -> tuple[Floats, Floats]:
    """Instants (n,) [s] and values (n, k) [any unit] with straight lines, of points ``step`` [s] apart, across gaps."""
    wide = np.flatnonzero(np.diff(time) > LARGEST_STEP * step)
    if not wide.size:
        return time, values
    added = [np.arange(time[i] + step, time[i + 1] - 0.5 * step, step) for i in wide]
    whole = np.sort(np.concatenate([time, *added]))
    return whole, np.column_stack([np.interp(whole, time, v) for v in values.T])


def block_means(values: Floats, every: int) -> Floats:
    """Means of ``every`` samples of ``values`` (..., n) [any unit] after one another, (..., n // every)."""
    count = values.shape[-1] // every
    blocks = values[..., : count * every].reshape(*values.shape[:-1], count, every)
    return np.asarray(blocks @ np.full(every, 1.0 / every))


def low_pass(values: Floats, cutoff: float, rate: float) -> Floats:
    """``values`` (n, ...) [any unit] smoothed along the first axis with zero phase; ``cutoff`` and ``rate`` in Hz."""
    from ..signal.filters import both_ways

    if not 0.0 < ALMOST * cutoff <= HIGHEST_CUTOFF * rate:
        raise AnalysisError(
            f"a low-pass at {cutoff:g} Hz cannot be run at {rate:g} samples per second: "
            f"expected at most {HIGHEST_CUTOFF * rate:g} Hz"
        )
    padding = min(len(values) - 1, int(3.0 * rate / cutoff))
    return np.moveaxis(both_ways(_sections(cutoff, rate), np.moveaxis(values, 0, -1), padding, odd=True), -1, 0)


@cache
def _sections(cutoff: float, rate: float) -> Floats:
    from scipy.signal import butter

    return np.asarray(butter(ORDER, cutoff, fs=rate, output="sos"))


def smoothed_derivatives(position: Floats, cutoff: float, rate: float) -> Rates:
    """Smooth positions (n, joints) [rad, m] on a grid of ``rate`` [Hz] at ``cutoff`` [Hz], and differentiate them."""
    from scipy.interpolate import make_interp_spline

    smooth, instants = low_pass(position, cutoff, rate), np.arange(len(position)) / rate
    spline = make_interp_spline(instants, smooth, 5)
    return Rates(smooth, np.asarray(spline.derivative(1)(instants)), np.asarray(spline.derivative(2)(instants)))


def reading_steps(readings: Floats) -> Floats:
    """Least step between values of each of several channels (n, k) [any unit], (k,) [the same]; 0 of one value only."""
    found = np.zeros(readings.shape[1])
    for k, values in enumerate(readings.T):
        steps = np.diff(np.unique(values))
        found[k] = steps[steps > 1e-9 * np.ptp(values)].min(initial=np.inf) if len(steps) else 0.0
    return found


def rest_speeds(records: Sequence[tuple[Floats, Floats]], bandwidth: float, turning: Sequence[bool]) -> Floats:
    """Speeds below which joints rest, where dry friction may balance any torque, (joints,) [rad/s, m/s].

    A part of a joint's top speed, at least what steps and noise of its readings make; of what turns REST_SPEED at most.
    ``records`` are readings and speeds (n, joints) each, the positions smoothed below a ``bandwidth`` [Hz].
    """
    found = np.full(len(turning), 1e-12)
    for readings, speeds in records:
        noise = READING_SIGMA * np.sqrt(np.mean(np.diff(readings, 3, axis=0) ** 2, axis=0) / 20.0)
        for k, step in enumerate(reading_steps(readings)):
            found[k] = max(
                found[k], REST_PART * np.abs(speeds[:, k]).max(), STEP_SPEED * bandwidth * max(step, noise[k])
            )
    return np.minimum(found, np.where(turning, REST_SPEED, np.inf))


def noise_gain(cutoff: float, rate: float) -> float:
    """Standard deviation of :func:`smoothed_derivatives`' acceleration of white noise of unit deviation [1/s2].

    sigma_a^2 = 2 / rate int_0^(rate/2) (2 pi f)^4 |H|^4 df, the low-pass H run forwards and backwards.
    """
    from scipy.signal import sosfreqz

    frequency = np.linspace(0.0, rate / 2.0, 20_001)
    response = np.abs(sosfreqz(_sections(cutoff, rate), frequency, fs=rate)[1])
    return float(np.sqrt(2.0 / rate * np.trapezoid((2.0 * np.pi * frequency) ** 4 * response**4, frequency)))
