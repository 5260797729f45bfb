"""By how many standard deviations of the noise a reading lies above what any amplitude would read, tabulated.

An amplitude is too large if the largest value that was read is too low for it, with as few swings as are certain: each
more would raise what it reads. It is too small if all that exceeds it, squared and summed, is too much, with as many
swings as there may be: the largest value alone could be noise where that is loud, all swings cannot.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import normal_quantile

from .amplitude import Amplitude, MetricStatistic
from .noise_floor import Noise, NoiseRecords

POINTS = 16
"""Amplitudes in the table."""
_REACH = 5.0
"""How far from the reading the table goes [standard deviations]."""
_DIGITS = 1e-6
"""Relative accuracy of simulated noise; no reading is taken to be more accurate."""
_WITHIN = 4.0
"""Standard deviations of noise below which an amplitude counts as within the noise."""


@dataclass(frozen=True)
class AmplitudeLikelihood:
    """A table of few amplitudes, extrapolated beyond them; it does not keep the record."""

    statistic: MetricStatistic
    reading: float
    """What was read, noise included [unit, or its square]."""
    floor: float
    """What noise alone would read [unit, or its square]."""
    saturated: bool
    """Whether the sensor reached the end of its range."""
    common: float
    """Share of the variance that repeats have in common: the noise's power is one for all [-]."""
    amplitudes: Floats
    """Amplitudes around the reading, rising, (POINTS,) [unit]."""
    deviations: Floats
    """The reading less what each of ``amplitudes`` reads, falling, (POINTS,) [standard deviations of noise]; where that
    is above zero, what exceeds the amplitude less what of noise does.
    """
    rises: Floats
    """What each of ``amplitudes`` reads less what the first reads, (POINTS,) [standard deviations of noise]."""
    rounded: float = 0.0
    """Share of the variance that a step adds, which repeats have in common if the zero of the converter is one [-]."""

    @classmethod
    def of(cls, run: Amplitude, noise: Noise) -> "AmplitudeLikelihood":
        """From a run's record in noise."""
        statistic, (peaks, every), noises = run.statistic, run.peaks(noise), run.noises(noise)
        floor = float(np.median(statistic.of_noise(noises)))
        net, extra = run.reading - floor, 0.0 if statistic.squared else floor
        spread = statistic.readings(peaks, np.array([statistic.amplitude(max(net, 0.0))]), noises).std()
        reach = _REACH * float(spread) + 20.0 * _DIGITS * abs(run.reading)
        low, high = (statistic.amplitude(max(v, 0.0)) for v in (net - reach, max(net, 0.0) + extra + reach))
        tried = np.linspace(low, high, POINTS)
        draws = statistic.readings(peaks, tried, noises)
        ranked, spread = np.sort(draws.T), draws.std(axis=0)
        scores = _scores(ranked, spread, np.full(POINTS, run.reading))
        above = np.flatnonzero(scores > 0.0)
        if above.size and not statistic.squared:
            drawn, shown = (np.sqrt(one) for one in statistic.excess(every, tried[above], noises, run.as_read))
            scores[above] = np.maximum(_scores(np.sort(drawn.T), drawn.std(axis=0), shown), 0.0)
        table = np.minimum.accumulate(scores) - _DIGITS * np.arange(POINTS)
        middle = ranked[:, [(len(draws) - 1) // 2, len(draws) // 2]].mean(axis=1)
        rising = _scores(ranked[:1], spread[:1], middle)
        common, rounded = _shares(draws[:, int(np.argmin(np.abs(table)))], noises)
        return cls(statistic, run.reading, floor, run.saturated, common, tried, table, rising, rounded)

    @property
    def amplitude(self) -> float:
        """The likeliest one: it reads what was read; zero where noise alone does [unit]."""
        return float(np.interp(0.0, self.deviations[::-1], self.amplitudes[::-1]))

    def deviation(self, amplitude: Floats) -> Floats:
        """The reading less what each amplitude (k,) [unit] would read, (k,) [standard deviations].

        Beyond the table it is linear in asinh(amplitude / noise scale): like the logarithm far above the noise, where
        runs differ by a share of their amplitude, and like the amplitude within the noise.
        """
        return np.interp(amplitude, self.amplitudes, self.deviations) + self._beyond(amplitude)

    def distance(self, amplitude: Floats) -> Floats:
        """What each amplitude (k,) [unit] reads above an amplitude of zero, (k,) [standard deviations]."""
        if self.amplitudes[0] > 0.0:
            return self._at_zero - self.deviation(amplitude)
        beyond = self.deviations[-1] - self.deviation(amplitude)
        return np.interp(amplitude, self.amplitudes, self.rises) + np.maximum(beyond, 0.0)

    def signal_to_noise(self, amplitude: float) -> float:
        """An amplitude [unit] over the standard deviation of noise [-]: the deviation's slope over the logarithm."""
        near = amplitude + 0.4 * self.noise_scale * np.array([-1.0, 1.0])
        low, high = np.maximum(near, 0.0)
        fallen = self.deviation(np.array([low, high]))
        return float(amplitude * (fallen[0] - fallen[1]) / (high - low))

    @cached_property
    def _at_zero(self) -> float:
        """The deviation of an amplitude of zero."""
        return float(self.deviation(np.zeros(1))[0])

    @cached_property
    def noise_scale(self) -> float:
        """Amplitude below which noise dominates [unit]."""
        return float(_WITHIN * (self.amplitudes[-1] - self.amplitudes[0]) / (self.deviations[0] - self.deviations[-1]))

    @cached_property
    def _ends(self) -> tuple[Floats, float]:
        """asinh of the ends of the table over the noise scale, and the slope of the deviations between them."""
        ends = np.arcsinh(self.amplitudes[[0, -1]] / self.noise_scale)
        return ends, float((self.deviations[0] - self.deviations[-1]) / (ends[1] - ends[0]))

    def _beyond(self, amplitude: Floats) -> Floats:
        """What deviations are extrapolated by, (k,)."""
        (low, high), slope = self._ends
        at = np.arcsinh(amplitude / self.noise_scale)
        return np.asarray(slope * (np.minimum(np.maximum(at, low), high) - at))


def _shares(draws: Floats, noises: NoiseRecords) -> tuple[float, float]:
    """Shares of the variance of readings (d,) that the noise's power explains, and beyond it what a step adds."""
    basis = np.column_stack([np.ones_like(noises.powers), np.sqrt(noises.powers), noises.rounding])
    each = (basis[:, :2], basis) if noises.rounding.any() else (basis[:, :2],)
    left = [(draws - some @ np.linalg.lstsq(some, draws, rcond=None)[0]).var() for some in each]
    by_power, both = 1.0 - np.clip(np.array([left[0], left[-1]]) / max(float(draws.var()), 1e-300), 0.0, 1.0)
    return float(by_power), float(both - by_power)


def _scores(ranked: Floats, spread: Floats, readings: Floats) -> Floats:
    """Ranks of readings (k,), each among draws (k, d) or (1, d), rising, as standard normal deviates, (k,); beyond the
    draws linear in their standard deviations (k,).
    """
    deviates, count = _deviates(ranked.shape[1]), ranked.shape[1]
    after = np.clip((ranked <= readings[:, None]).sum(axis=1), 1, count - 1)
    row = np.arange(len(readings)) % len(ranked)
    low, high = ranked[row, after - 1], ranked[row, after]
    share = np.clip((readings - low) / np.maximum(high - low, 1e-300), 0.0, 1.0)
    beyond = readings - np.minimum(np.maximum(readings, ranked[:, 0]), ranked[:, -1])
    found = deviates[after - 1] + share * (deviates[after] - deviates[after - 1])
    return np.asarray(found + beyond / np.maximum(np.maximum(spread, _DIGITS * np.abs(ranked[:, -1])), 1e-300))


@lru_cache(maxsize=4)
def _deviates(count: int) -> Floats:
    """Normal deviates of that many ranked draws, (count,) [-]."""
    return normal_quantile((np.arange(count) + 0.5) / count)
