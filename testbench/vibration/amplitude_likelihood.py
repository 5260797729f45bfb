"""One run, judged: by how many standard deviations of its noise the reading lies above that of any amplitude."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import normal_quantile

from .amplitude import Amplitude, MetricStatistic

POINTS = 16
"""Amplitudes that are tried."""
_REACH = 5.0
"""How far from what was read amplitudes are tried [standard deviations]."""
_DIGITS = 1e-6
"""Relative accuracy to which noise is drawn; no reading is taken to be surer."""
_WITHIN = 4.0
"""Standard deviations of noise below which an amplitude counts as within the noise."""


@dataclass(frozen=True)
class AmplitudeLikelihood:
    """A table of few amplitudes, straight beyond them; the record itself is let go."""

    statistic: MetricStatistic
    reading: float
    """What was read, noise included [unit, or its square]."""
    floor: float | None
    """What noise alone would read [unit, or its square]; None where no noise is known."""
    bound: bool
    """Whether the sensor was at the end of its range."""
    steps: float
    """Share of the noise's power that the channel's steps have."""
    tried: Floats
    """Amplitudes around what was read, rising, (POINTS,) [unit]."""
    table: Floats
    """The reading above what each of ``tried`` reads, falling, (POINTS,) [standard deviations of noise]."""
    rising: Floats
    """What each of ``tried`` reads above the first, (POINTS,) [standard deviations of noise]."""

    @classmethod
    def of(cls, run: Amplitude) -> "AmplitudeLikelihood":
        """Of a run's record; in logarithms instead of standard deviations where no noise is known."""
        run = replace(run)  # what is drawn for the tables is let go with this one
        if run.noise is None:
            return cls(run.statistic, run.reading, None, run.bound, 0.0, *_logarithms(run))
        tried = _around(run)
        draws = run.simulate(tried)
        table = np.minimum.accumulate([_score(column, run.reading) for column in draws.T])
        rising = np.array([_score(draws[:, 0], float(np.median(column))) for column in draws.T])
        return cls(run.statistic, run.reading, run.floor, run.bound, _steps(run), tried, table, rising)

    def deviation(self, amplitude: Floats) -> Floats:
        """By how many standard deviations the reading lies above what each amplitude (k,) would read.

        Beyond the table it is straight in asinh(amplitude / scale): runs differ by a share of their amplitude, noise by
        the same amount everywhere.
        """
        low, high = self._bent(self.tried[[0, -1]])
        at, slope = self._bent(amplitude), (self.table[0] - self.table[-1]) / (high - low)
        beyond = np.maximum(low - at, 0.0) - np.maximum(at - high, 0.0)
        return np.interp(amplitude, self.tried, self.table) + slope * beyond

    def distance(self, amplitude: Floats) -> Floats:
        """How many standard deviations each amplitude (k,) reads above none."""
        if self.tried[0] > 0.0:
            return self.deviation(np.zeros(1)) - self.deviation(amplitude)
        beyond = self.table[-1] - self.deviation(amplitude)
        return np.interp(amplitude, self.tried, self.rising) + np.maximum(beyond, 0.0)

    def clearness(self, amplitude: float) -> float:
        """An amplitude in standard deviations of noise: how fast the deviation falls with the amplitude's logarithm."""
        near = amplitude + 0.4 * self.scale * np.array([-1.0, 1.0])
        low, high = np.maximum(near, 0.0)
        fallen = self.deviation(np.array([low, high]))
        return float(amplitude * (fallen[0] - fallen[1]) / (high - low))

    @cached_property
    def scale(self) -> float:
        """What counts as within the noise [unit]; next to nothing where none is known."""
        if self.floor is None:
            return _DIGITS * float(self.tried[0])
        return float(_WITHIN * (self.tried[-1] - self.tried[0]) / (self.table[0] - self.table[-1]))

    def _bent(self, amplitude: Floats) -> Floats:
        return np.arcsinh(amplitude / self.scale)


def _around(run: Amplitude) -> Floats:
    """Amplitudes around what was read, rising, (POINTS,)."""
    statistic, floor = run.statistic, run.floor or 0.0
    net, extra = run.reading - floor, 0.0 if statistic.squared else floor
    reach = _REACH * float(run.simulate(np.array([statistic.amplitude(max(net, 0.0))])).std())
    reach += 20.0 * _DIGITS * abs(net)
    low, high = (statistic.amplitude(max(v, 0.0)) for v in (net - reach, max(net, 0.0) + extra + reach))
    return np.linspace(low, high, POINTS)


def _logarithms(run: Amplitude) -> tuple[Floats, Floats, Floats]:
    away = np.linspace(-_DIGITS, _DIGITS, POINTS)
    tried = run.statistic.amplitude(run.reading) * np.exp(away)
    return tried, -away, away + _DIGITS


def _steps(run: Amplitude) -> float:
    """Share of the noise's power in the band that steps of the channel have, at most 1."""
    noise, band = run.noise, run.measure.band
    if noise is None or noise.step == 0.0:
        return 0.0
    return min(type(noise).of(np.zeros(64), run.rate_hz, noise.step).power(band) / noise.power(band), 1.0)


def _score(draws: Floats, reading: float) -> float:
    """Where a reading stands among draws, as a standard normal deviate; straight on beyond them."""
    ranked, scores = np.sort(draws), _scores(len(draws))
    spread = max(float(ranked.std()), _DIGITS * abs(float(ranked[-1])), 1e-300)
    if reading > ranked[-1]:
        return float(scores[-1] + (reading - ranked[-1]) / spread)
    if reading < ranked[0]:
        return float(scores[0] + (reading - ranked[0]) / spread)
    return float(np.interp(reading, ranked, scores))


@lru_cache(maxsize=4)
def _scores(count: int) -> Floats:
    """Normal deviates of so many draws in order, (count,)."""
    return normal_quantile((np.arange(count) + 0.5) / count)
