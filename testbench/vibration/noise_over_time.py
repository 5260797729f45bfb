"""How the power of noise in motion goes over time, as what does not repeat shows it.

Squares of residuals are smoothed over time. How widely, the data tell: by the least estimated squared error, from which
what squares share with their neighbours by the correlation of the noise is taken off (as of intensities of events:
Diggle, Applied Statistics 34, 138, 1985). How wrong the course may be is told by a parametric bootstrap (Efron and
Tibshirani, An Introduction to the Bootstrap, 1993, ch. 6): courses estimated anew from squares that the estimated one
makes are to it, in bias and spread, as it is to the true one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from balance.arrays import Floats

from .noise_floor import random_numbers, squared_magnitudes

WIDTHS_S = (0.01, 0.014, 0.02, 0.028, 0.04, 0.056, 0.08, 0.16, 0.32)
"""Of the smoothing, standard deviations that are tried [s]."""
_CELL = 0.25
"""Of a width, in which courses are drawn."""
_LEAST = 0.05**2
"""Of the mean power in motion, below which none goes [-]."""
_ALIKE = 0.25
"""Share of the motion over which noise may be like itself."""


@dataclass(frozen=True, eq=False)
class NoiseOverTime:
    """Squares of what does not repeat, over the time of one record."""

    squares: Floats
    """(n,), 1 on average in motion [-]."""
    freedom: float
    """Degrees of freedom of each."""
    correlation: Floats
    """Square of that of the noise with itself by lag, (n,) [-]."""
    moving: slice
    """Samples from the first to the last motion."""
    rate_hz: float

    @classmethod
    def of(
        cls,
        residuals: Floats,
        freedom: float,
        known: slice,
        moving: slice,
        count: int,
        rate_hz: float,
        elsewhere: float = 1.0,
    ) -> "NoiseOverTime":
        """From residuals (k, m) [unit] in samples ``known`` of ``count``, of so many degrees of freedom a sample.

        ``elsewhere``: power where they show nothing, 1 on average in motion.
        """
        from scipy.fft import irfft, next_fast_len, rfft

        inside = slice(max(moving.start - known.start, 0), max(moving.stop - known.start, 0))
        power, shown = (residuals**2).sum(axis=0), residuals.shape[1]
        like, size = np.zeros(count), next_fast_len(2 * shown, real=True)
        like[:shown] = irfft(squared_magnitudes(rfft(residuals, size)).sum(axis=0), size)[:shown]
        near = np.maximum(1.0 - np.arange(count) / (_ALIKE * max(moving.stop - moving.start, 1)), 0.0)
        squares = np.full(count, elsewhere)
        squares[known] = power / max(float(power[inside].mean()), 1e-300)
        return cls(squares, freedom, near * (like / max(float(like[0]), 1e-300)) ** 2, moving, rate_hz)

    @classmethod
    def pooled(cls, some: "Sequence[tuple[NoiseOverTime, float]]", count: int, moving: slice) -> "NoiseOverTime":
        """In a record of ``count`` samples that shows each of some so many samples later."""
        freedom, first = sum(one.freedom for one, _ in some), some[0][0]
        squares = np.zeros(count)
        for one, lag in some:
            shown = np.interp(np.arange(count) - lag, np.arange(len(one.squares)), one.squares)
            squares += one.freedom / freedom * shown
        like = np.pad(first.correlation, (0, max(count - len(first.correlation), 0)))[:count]
        return cls(squares, freedom, like, moving, first.rate_hz)

    @cached_property
    def width(self) -> float:
        """Of the smoothing, as the data want it, standard deviation [samples]."""
        from scipy.fft import irfft, next_fast_len, rfft

        count, size = len(self.squares), next_fast_len(2 * len(self.squares), real=True)
        power = squared_magnitudes(rfft(self.squares, size))
        shared = irfft(power, size)[:count] / (1.0 + 2.0 * self.correlation / self.freedom)
        power[1:], shared[1:] = 2.0 * power[1:], 2.0 * shared[1:]
        cross = rfft(shared, size).real
        cross[1:] *= 2.0
        tried = np.array(WIDTHS_S) * self.rate_hz
        gains = _gains(size, self.rate_hz)
        return float(tried[int(np.argmin(gains**2 @ power - 2.0 * gains @ cross))])

    @cached_property
    def power(self) -> Floats:
        """Estimated, (n,), 1 on average in motion [-]."""
        return np.maximum(_smoothed(self.squares, self.width), _LEAST)

    def draws(self, number: int) -> Floats:
        """Standard deviations over time that the residuals allow, of mean square 1 in motion, (n, number) [-]."""
        count = len(self.squares)
        every = max(min(int(_CELL * self.width), count // 4), 1)
        starts = np.arange(0, count, every)
        cells = (np.add.reduceat(self.power, starts) / np.diff([*starts, count]))[:, None]
        freedom = self.freedom * every / max(2.0 * float(self.correlation.sum()) - 1.0, 1.0)
        rng = random_numbers(self.squares)
        again = _smoothed(cells * rng.chisquare(freedom, (len(cells), number)) / freedom, self.width / every)
        found = cells**2 / np.maximum(again, 1e-300)
        found /= found[self.moving.start // every : self.moving.stop // every + 1].mean(axis=0)
        levels = np.sqrt(np.maximum(found, _LEAST)).astype(np.float32)
        at = np.clip((np.arange(count) + 0.5) / every - 0.5, 0.0, len(cells) - 1.001)
        low, share = at.astype(int), (at % 1.0).astype(np.float32)[:, None]
        return np.asarray(levels[low] * (1.0 - share) + levels[low + 1] * share)


@lru_cache(maxsize=4)
def _gains(size: int, rate_hz: float) -> Floats:
    """Of the smoothing by each width at the frequencies of so many samples, (widths, size // 2 + 1) [-]."""
    tried = np.array(WIDTHS_S) * rate_hz
    return np.asarray(np.exp(-2.0 * (np.pi * np.outer(tried, np.fft.rfftfreq(size))) ** 2))


def _smoothed(values: Floats, width: float) -> Floats:
    """Values (n, ...) smoothed by a Gaussian of a standard deviation [samples]; beyond their ends they stay."""
    from scipy.signal import fftconvolve

    reach = int(4.0 * width + 0.5)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(width, 1e-300)) ** 2)
    kernel = (kernel / kernel.sum()).reshape(-1, *[1] * (values.ndim - 1))
    spread = np.pad(values, [(reach, reach), *[(0, 0)] * (values.ndim - 1)], "edge")
    return np.asarray(fftconvolve(spread, kernel, "valid", axes=0))
