"""The amplitude of one channel in one run: what was read, and what would be read if it were another.

Noise is drawn anew with the spectrum of the rest stretch, at a power that is itself known from that stretch alone, and
added to the shape that the record shows: propagation of distributions (JCGM 101:2008), so that what noise does to a
largest value, or to a power, is in the reading and in the interval alike.
"""

import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats

from ..vibration import Measure
from .noise import Noise
from .statistic import Statistic

DRAWS = 500
"""Of noise: a quantile of 2.5 % is known to 0.7 %."""
_FINE = 6.0
"""Samples that are drawn per period of the band's upper edge."""
_BLOCK = 8_000_000
"""Most samples drawn at a time."""


@dataclass(frozen=True)
class Amplitude:
    """A channel in one run; ``noise`` is None where no rest stretch shows it."""

    values: Floats
    """As recorded, (n,) [unit]."""
    rate_hz: float
    measure: Measure
    noise: Noise | None
    bound: bool = False
    """Whether the sensor was at the end of its range: the amplitude is at least what was read."""

    @property
    def statistic(self) -> Statistic:
        """What is read."""
        return Statistic(self.measure.metric)

    @cached_property
    def reading(self) -> float:
        """What was read, noise included [unit, or its square]."""
        return float(self.statistic.of(np.array(self.measure.of(self.values, self.rate_hz))))

    @property
    def seconds(self) -> float:
        """Length of the record."""
        return len(self.values) / self.rate_hz

    @cached_property
    def floor(self) -> float | None:
        """What noise alone would read, middle value [unit, or its square]."""
        return None if self.noise is None else float(np.median(self.simulate(np.zeros(1), known=True)))

    def simulate(self, amplitudes: Floats, known: bool = False) -> Floats:
        """Readings in noise drawn anew, if the amplitude were one of ``amplitudes`` (k,): (draws, k).

        ``known`` draws noise of exactly the power estimated; otherwise of all powers that the stretch speaks for.
        """
        scale = np.ones(DRAWS, np.float32) if known else self._scales
        found, done = [], 0
        for noise in self._noises():
            block = noise * scale[done : done + len(noise), None]
            found.append(self.statistic.simulate(self._shape, amplitudes, block))
            done += len(noise)
        return np.concatenate(found).astype(float)

    @cached_property
    def _scales(self) -> Floats:
        """Amplitudes that the noise may have over that estimated: sqrt(freedom / chi squared), (DRAWS,)."""
        assert self.noise is not None
        freedom = self.noise.freedom(self.measure.band)
        drawn = self._generator().chisquare(freedom, DRAWS) if np.isfinite(freedom) else np.full(DRAWS, 1.0)
        return np.sqrt((freedom if np.isfinite(freedom) else 1.0) / drawn).astype(np.float32)

    def _generator(self) -> np.random.Generator:
        """The same record, the same draws."""
        return np.random.default_rng(zlib.crc32(np.ascontiguousarray(self.values).tobytes()))

    def _noises(self) -> Iterable[Floats]:
        """Noise drawn anew, in blocks (b, n) of DRAWS altogether; kept where it is little."""
        return [self._few] if DRAWS * self._count <= _BLOCK else self._blocks()

    @cached_property
    def _few(self) -> Floats:
        return np.concatenate(list(self._blocks()))

    def _blocks(self) -> Iterator[Floats]:
        rng, block = self._generator(), max(_BLOCK // self._count, 1)
        for start in range(0, DRAWS, block):
            yield self._draw(min(block, DRAWS - start), rng)

    @cached_property
    def _count(self) -> int:
        """Samples of a drawn record: as many as its band needs."""
        band = self.measure.band
        rate = min(_FINE * band.high_hz, self.rate_hz) if band else self.rate_hz
        return max(round(self.seconds * rate), 16)

    def _draw(self, count: int, rng: np.random.Generator) -> Floats:
        """Noise in the band, (count, n): cosines at multiples of half a period a record, sqrt(S / T) each.

        They are even about both ends of the record, as what the band's filter makes of noise there.
        """
        from scipy.fft import idct

        frequency = np.arange(self._count) / (2.0 * self.seconds)
        sizes = self._gain(frequency) * np.sqrt(self._density(frequency) / self.seconds)
        sizes[0] = 0.0  # the mean is taken off
        used = max(int(np.flatnonzero(sizes > 1e-4 * sizes.max())[-1]) + 1 if sizes.any() else 1, 1)
        cosines = rng.standard_normal((count, used), dtype=np.float32) * sizes[:used].astype(np.float32)
        return np.asarray(idct(cosines * np.float32((self._count / 2.0) ** 0.5), n=self._count, norm="ortho"))

    def _density(self, frequency: Floats) -> Floats:
        assert self.noise is not None
        return self.noise.at(frequency)

    def _gain(self, frequency: Floats) -> Floats:
        band = self.measure.band
        return band.gain(frequency, self.rate_hz) if band else np.ones_like(frequency)

    @cached_property
    def _shape(self) -> Floats:
        """The course of the vibration, of amplitude 1, as far as it stands out of the noise, (n,).

        Each frequency is kept by the share of its power that is not noise (Wiener); the power is that of a few
        neighbours together.
        """
        shaped = self.measure.shape(self.values, self.rate_hz)
        frequency = np.arange(self._count // 2 + 1) / self.seconds
        spectrum = np.fft.rfft(shaped)[: len(frequency)] * (self._count / len(shaped))
        spectrum = np.pad(spectrum, (0, len(frequency) - len(spectrum)))
        noise = self._count**2 * self._density(frequency) * self._gain(frequency) ** 2 / (2.0 * self.seconds)
        power = np.convolve(np.abs(spectrum) ** 2, np.full(5, 0.2), "same")
        share = np.clip(1.0 - noise / np.maximum(power, 1e-300), 0.0, 1.0)
        course = np.fft.irfft(spectrum * share if share.any() else spectrum, self._count)
        size = Measure(self.measure.metric, None).of(course, 1.0)
        return course / size if size > 0.0 else course
