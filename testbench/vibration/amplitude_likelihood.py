"""By how many standard deviations of the noise a reading lies above what any amplitude would read, tabulated."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import normal_quantile

from .amplitude import Amplitude, MetricStatistic

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
    floor: float | None
    """What noise alone would read [unit, or its square]; None where no noise is known."""
    saturated: bool
    """Whether the sensor reached the end of its range."""
    quantization_share: float
    """Share of the noise's power that is the channel's quantization, at most 1 [-]."""
    amplitudes: Floats
    """Amplitudes around the reading, rising, (POINTS,) [unit]."""
    deviations: Floats
    """The reading less what each of ``amplitudes`` reads, falling, (POINTS,) [standard deviations of noise]."""
    rises: Floats
    """What each of ``amplitudes`` reads less what the first reads, (POINTS,) [standard deviations of noise]."""

    @classmethod
    def of(cls, run: Amplitude) -> "AmplitudeLikelihood":
        """From a run's record; in logarithms instead of standard deviations where no noise is known."""
        run = replace(run)  # the simulated noise that is cached for the table goes with this copy
        if run.noise is None:
            return cls(run.statistic, run.reading, None, run.saturated, 0.0, *_without_noise(run))
        tried = _amplitudes_near(run)
        draws = run.simulate(tried)
        table = np.minimum.accumulate([_score(column, run.reading) for column in draws.T])
        rising = np.array([_score(draws[:, 0], float(np.median(column))) for column in draws.T])
        return cls(run.statistic, run.reading, run.floor, run.saturated, _quantization_share(run), tried, table, rising)

    def deviation(self, amplitude: Floats) -> Floats:
        """The reading less what each amplitude (k,) [unit] would read, (k,) [standard deviations].

        Beyond the table it is linear in asinh(amplitude / noise scale): like the logarithm far above the noise, where
        runs differ by a share of their amplitude, and like the amplitude within the noise.
        """
        low, high = self._asinh_scaled(self.amplitudes[[0, -1]])
        at, slope = self._asinh_scaled(amplitude), (self.deviations[0] - self.deviations[-1]) / (high - low)
        beyond = np.maximum(low - at, 0.0) - np.maximum(at - high, 0.0)
        return np.interp(amplitude, self.amplitudes, self.deviations) + slope * beyond

    def distance(self, amplitude: Floats) -> Floats:
        """What each amplitude (k,) [unit] reads above an amplitude of zero, (k,) [standard deviations]."""
        if self.amplitudes[0] > 0.0:
            return self.deviation(np.zeros(1)) - self.deviation(amplitude)
        beyond = self.deviations[-1] - self.deviation(amplitude)
        return np.interp(amplitude, self.amplitudes, self.rises) + np.maximum(beyond, 0.0)

    def signal_to_noise(self, amplitude: float) -> float:
        """An amplitude [unit] over the standard deviation of noise [-]: the deviation's slope over the logarithm."""
        near = amplitude + 0.4 * self.noise_scale * np.array([-1.0, 1.0])
        low, high = np.maximum(near, 0.0)
        fallen = self.deviation(np.array([low, high]))
        return float(amplitude * (fallen[0] - fallen[1]) / (high - low))

    @cached_property
    def noise_scale(self) -> float:
        """Amplitude below which noise dominates [unit]; next to nothing where no noise is known."""
        if self.floor is None:
            return _DIGITS * float(self.amplitudes[0])
        return float(_WITHIN * (self.amplitudes[-1] - self.amplitudes[0]) / (self.deviations[0] - self.deviations[-1]))

    def _asinh_scaled(self, amplitude: Floats) -> Floats:
        return np.arcsinh(amplitude / self.noise_scale)


def _amplitudes_near(run: Amplitude) -> Floats:
    """Amplitudes around the reading, rising, (POINTS,) [unit]."""
    statistic, floor = run.statistic, run.floor or 0.0
    net, extra = run.reading - floor, 0.0 if statistic.squared else floor
    reach = _REACH * float(run.simulate(np.array([statistic.amplitude(max(net, 0.0))])).std())
    reach += 20.0 * _DIGITS * abs(net)
    low, high = (statistic.amplitude(max(v, 0.0)) for v in (net - reach, max(net, 0.0) + extra + reach))
    return np.linspace(low, high, POINTS)


def _without_noise(run: Amplitude) -> tuple[Floats, Floats, Floats]:
    away = np.linspace(-_DIGITS, _DIGITS, POINTS)
    tried = run.statistic.amplitude(run.reading) * np.exp(away)
    return tried, -away, away + _DIGITS


def _quantization_share(run: Amplitude) -> float:
    """Share of the noise's power in the band that the steps of the channel have, at most 1 [-]."""
    noise, band = run.noise, run.measure.band
    if noise is None or noise.step == 0.0:
        return 0.0
    return min(type(noise).of(np.zeros(64), run.rate_hz, noise.step).power(band) / noise.power(band), 1.0)


def _score(draws: Floats, reading: float) -> float:
    """Rank of a reading among draws (d,) as a standard normal deviate; extrapolated linearly beyond them."""
    ranked, scores = np.sort(draws), _scores(len(draws))
    spread = max(float(ranked.std()), _DIGITS * abs(float(ranked[-1])), 1e-300)
    if reading > ranked[-1]:
        return float(scores[-1] + (reading - ranked[-1]) / spread)
    if reading < ranked[0]:
        return float(scores[0] + (reading - ranked[0]) / spread)
    return float(np.interp(reading, ranked, scores))


@lru_cache(maxsize=4)
def _scores(count: int) -> Floats:
    """Normal deviates of that many ranked draws, (count,) [-]."""
    return normal_quantile((np.arange(count) + 0.5) / count)
