"""The amplitude of a condition, with or without counter-masses, from one run or from repeats."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats

from .amplitude import Amplitude
from .statistic import Statistic

POINTS = 16
"""Amplitudes that are tried."""
_REACH = 5.0
"""How far from what was read amplitudes are tried [standard deviations]."""
_DIGITS = 1e-6
"""Relative accuracy to which noise is drawn; no reading is taken to be surer."""
_STEEP = 25.0
"""Most logarithms that amplitudes of repeats are tried above and below what was read."""
FAR = 10.0
"""Distance from zero at which the bound is not felt [standard deviations]."""


@dataclass(frozen=True)
class Side:
    """One run, or repeats of it. ``repeated``: their own scatter says how sure the mean is, and not the noise."""

    runs: tuple[Amplitude, ...]
    repeated: bool

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the scatter."""
        return len(self.runs) - 1.0 if self.repeated else np.inf

    @property
    def bound(self) -> bool:
        """Whether a sensor was at the end of its range."""
        return any(run.bound for run in self.runs)

    @cached_property
    def floor(self) -> float | None:
        """What the metric would show of noise alone [unit]; None where a run shows no noise."""
        floors = [run.floor for run in self.runs]
        known = [floor for floor in floors if floor is not None]
        return self.statistic.amplitude(float(np.mean(known))) if len(known) == len(floors) else None

    @cached_property
    def amplitude(self) -> float:
        """The amplitude that reads as was read, middle value; zero where noise alone reads as much [unit]."""
        return float(np.interp(0.0, self._deviations[::-1], self.tried[::-1]))

    def deviation(self, amplitude: Floats) -> Floats:
        """By how many standard deviations the reading lies above what each amplitude (k,) would read."""
        return _extended(amplitude, self.tried, self._deviations)

    def distance(self, amplitude: Floats) -> Floats:
        """How many standard deviations each amplitude (k,) reads above none, at most FAR."""
        return np.clip(_extended(amplitude, self.tried, self._distances), 0.0, FAR)

    @property
    def statistic(self) -> Statistic:
        """What is read of each run."""
        return self.runs[0].statistic

    @cached_property
    def readings(self) -> Floats:
        """Of each run, less what its noise alone reads, (n,)."""
        return np.array([run.reading - (run.floor or 0.0) for run in self.runs])

    @cached_property
    def tried(self) -> Floats:
        """Amplitudes around what was read, rising, (POINTS,)."""
        extra = 0.0 if self.statistic.squared else float(np.mean([run.floor or 0.0 for run in self.runs]))
        if self.repeated:
            from scipy.stats import t

            middle = float(self._bent(self.readings).mean())
            reach = min(1.5 * float(t.ppf(0.9975, self.freedom)) * self._error, _STEEP) + 20.0 * _DIGITS
            ends = self._scale * np.sinh(np.linspace(max(middle - reach, 0.0), max(middle, 0.0) + reach, POINTS))
            return np.array([self.statistic.amplitude(end) for end in ends + np.linspace(0.0, extra, POINTS)])
        net = float(self.readings.mean())
        around = self._simulated(np.array([self.statistic.amplitude(max(net, 0.0))]))
        reach = _REACH * float(around.std()) + 20.0 * _DIGITS * abs(net)
        low, high = (self.statistic.amplitude(max(v, 0.0)) for v in (net - reach, max(net, 0.0) + extra + reach))
        return np.linspace(low, high, POINTS)

    def _bent(self, readings: Floats) -> Floats:
        """Readings of repeats, less noise: as they are within the noise, as their logarithms far above it.

        Runs differ by a share of their amplitude, noise by the same amount everywhere.
        """
        return np.arcsinh(readings / self._scale)

    @cached_property
    def _scale(self) -> float:
        """What counts as within the noise: four standard deviations of what it reads alone."""
        alone = [0.0 if run.noise is None else float(run.simulate(np.zeros(1), known=True).std()) for run in self.runs]
        return 4.0 * float(np.mean(alone)) + 1e-6 * float(np.abs(self.readings).mean())

    @cached_property
    def _error(self) -> float:
        """Standard error of the bent mean of repeats: of their scatter, and no less than the channel's steps allow."""
        slope = 1.0 / np.hypot(self.readings, self._scale)
        steps = float(np.mean(slope * [_of_steps(run) for run in self.runs]))
        return max(float(self._bent(self.readings).std(ddof=1)), steps, _DIGITS) / len(self.runs) ** 0.5

    @cached_property
    def _deviations(self) -> Floats:
        """Falling with the amplitude, (POINTS,)."""
        if self.repeated:
            expected = self._bent(self._expected(self.tried))
            return np.minimum.accumulate((self._bent(self.readings).mean() - expected) / self._error)
        draws, read = self._draws, float(np.mean([run.reading for run in self.runs]))
        return np.minimum.accumulate([_score(column, read) for column in draws.T])

    @cached_property
    def _distances(self) -> Floats:
        """Rising with the amplitude, (POINTS,)."""
        if self.tried[0] > 0.0:
            return np.full(POINTS, FAR)
        if self.repeated:
            expected = self._bent(self._expected(self.tried))
            return (expected - expected[0]) / self._error
        draws = self._draws
        return np.array([_score(draws[:, 0], float(np.median(column))) for column in draws.T])

    def _expected(self, amplitudes: Floats) -> Floats:
        """Mean reading of repeats at each amplitude, less what noise alone reads, (k,)."""
        return np.mean([_middle(run, amplitudes) - (run.floor or 0.0) for run in self.runs], axis=0)

    @cached_property
    def _draws(self) -> Floats:
        return self._simulated(self.tried)

    def _simulated(self, amplitudes: Floats) -> Floats:
        """Mean readings of the runs in noise drawn anew, (draws, k)."""
        return np.mean([run.simulate(amplitudes) for run in self.runs], axis=0)


def _middle(run: Amplitude, amplitudes: Floats) -> Floats:
    if run.noise is None:
        return run.statistic.of(amplitudes)
    return np.median(run.simulate(amplitudes, known=True), axis=0)


def _of_steps(run: Amplitude) -> float:
    """Standard deviation of a reading from the steps of the channel alone."""
    if run.noise is None or run.noise.step == 0.0:
        return 0.0
    white = type(run.noise).of(np.zeros(64), run.rate_hz, run.noise.step)
    one = white.power(run.measure.band) ** 0.5
    if not run.statistic.squared:
        return one
    return 2.0 * one * run.reading**0.5 / white.freedom(run.measure.band, run.seconds) ** 0.5


def _score(draws: Floats, reading: float) -> float:
    """Where a reading stands among draws, as a standard normal deviate; straight on beyond them."""
    from scipy.stats import norm

    ranked = np.sort(draws)
    scores = norm.ppf((np.arange(len(ranked)) + 0.5) / len(ranked))
    spread = max(float(ranked.std()), _DIGITS * abs(float(ranked[-1])), 1e-300)
    if reading > ranked[-1]:
        return float(scores[-1] + (reading - ranked[-1]) / spread)
    if reading < ranked[0]:
        return float(scores[0] + (reading - ranked[0]) / spread)
    return float(np.interp(reading, ranked, scores))


def _extended(at: Floats, x: Sequence[float] | Floats, y: Sequence[float] | Floats) -> Floats:
    """Linear between the points (x, y), and straight on beyond them."""
    x, y = np.asarray(x), np.asarray(y)
    found = np.interp(at, x, y)
    found = np.where(at < x[0], y[0] + (at - x[0]) * (y[1] - y[0]) / (x[1] - x[0]), found)
    return np.asarray(np.where(at > x[-1], y[-1] + (at - x[-1]) * (y[-1] - y[-2]) / (x[-1] - x[-2]), found))
