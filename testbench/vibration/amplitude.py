"""The amplitude of one channel in one run: what was read, and what would be read if it were another.

Noise is drawn anew with the spectrum of the rest stretch, at a power that is itself known from that stretch alone, and
added to the course that the record shows: propagation of distributions (JCGM 101:2008), so that what noise does to a
largest value, or to a power, is in the reading and in the interval alike. Of a power the distribution is known without
drawing records: that of the course, twice their product, which is Gaussian, and that of the noise, chi squared.

The swings of a course of vibration, and what they would be if its largest value were another.

Several swings may be of nearly like height; in noise any of them may be read as the largest. Under the hypothesis that
the largest is h, the likeliest heights of all are: as estimated where that is less than h, h where it is more, and h
for the highest (maximum likelihood under the constraint max = h; Silvapulle and Sen, "Constrained Statistical
Inference", 2005). Noise added to the course as estimated would be too sure: what noise made the
largest would count as larger.

What is read of a record to judge an amplitude: near the amplitude itself for peaks, its square for the RMS.

The amplitudes of a stored run: each axis of each accelerometer on the base, with the noise of its own rest.
"""

import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError
from ..kinematics.motion_onset import rest_before
from ..quality.clipping import flat_tops, stuck_value
from .metrics import Measure, Metric, base_accelerations
from .noise_floor import ENOUGH, Noise

if TYPE_CHECKING:
    from ..runs.si_run import SIRun


@dataclass(frozen=True)
class ConstrainedPeaks:
    """A course (n,) [unit], in swings from one local minimum of its size to the next."""

    course: Floats

    def of_peak(self, peak: float) -> Floats:
        """The likeliest course whose largest absolute value is ``peak``, (n,)."""
        return self._held(peak, self._heights)

    def of_peak_to_peak(self, span: float) -> Floats:
        """The likeliest course whose largest value less smallest is ``span``, (n,).

        What the span is more or less than estimated is shared alike by both ends, neither of them passing zero.
        """
        up, down = self._signed
        top, bottom = float(up.max()), float(down.max())
        shared = float(np.clip(top + 0.5 * (span - top - bottom), 0.0, span))
        high = shared if top > 0.0 and bottom > 0.0 else span * (top > 0.0)
        return self._held(high, up) + self._held(span - high, down)

    @cached_property
    def highest(self) -> "ConstrainedPeaks":
        """The highest swing alone."""
        only = np.arange(len(self._heights)) == int(np.argmax(self._heights))
        return ConstrainedPeaks(self.course * np.repeat(only, self._lengths))

    def _held(self, peak: float, heights: Floats) -> Floats:
        """The swings of ``heights`` (m,), none higher than ``peak`` and the highest just so high; the others away."""
        if not heights.any():
            return np.zeros_like(self.course)
        wanted = np.minimum(heights, peak)
        wanted[np.argmax(heights)] = peak
        factors = np.divide(wanted, heights, out=np.zeros_like(heights), where=heights > 0.0)
        return self.course * np.repeat(factors, self._lengths)

    @cached_property
    def _starts(self) -> np.ndarray:
        """Where a swing begins: where the sign changes, and at local minima of the size."""
        size = np.abs(self.course)
        low = (size[1:-1] <= size[:-2]) & (size[1:-1] < size[2:])
        turned = np.signbit(self.course[1:]) != np.signbit(self.course[:-1])
        return np.unique(np.concatenate([[0], np.flatnonzero(low) + 1, np.flatnonzero(turned) + 1]))

    @cached_property
    def _lengths(self) -> np.ndarray:
        return np.diff(np.append(self._starts, len(self.course)))

    @cached_property
    def _heights(self) -> Floats:
        return np.maximum.reduceat(np.abs(self.course), self._starts)

    @cached_property
    def _signed(self) -> tuple[Floats, Floats]:
        """Heights of the swings above zero, and depths of those below; zero for the others."""
        above = np.maximum.reduceat(self.course, self._starts)
        below = -np.minimum.reduceat(self.course, self._starts)
        return np.maximum(above, 0.0), np.maximum(below, 0.0)


@dataclass(frozen=True)
class MetricStatistic:
    """The law of a metric: the RMS is judged by its square, to which noise adds its own power."""

    metric: Metric

    @property
    def squared(self) -> bool:
        """Whether the square is read."""
        return self.metric == "rms"

    def of(self, amplitude: Floats) -> Floats:
        """What an amplitude reads without noise."""
        return amplitude**2 if self.squared else amplitude

    def amplitude(self, reading: float) -> float:
        """The amplitude that a reading would be without noise."""
        return max(reading, 0.0) ** 0.5 if self.squared else reading

    def extremes(self, lobes: ConstrainedPeaks, amplitudes: Floats, noise: Floats) -> Floats:
        """Peaks, or peaks to peaks, of a course at each amplitude (k,), in noise (b, n): (b, k)."""
        at = lobes.of_peak if self.metric == "peak" else lobes.of_peak_to_peak
        return np.stack([self._extreme(at(float(a)).astype(noise.dtype), noise) for a in amplitudes], axis=1)

    def _extreme(self, signal: Floats, noise: Floats) -> Floats:
        """Only samples that noise may make the extreme one need be looked at."""
        reach = 12.0 * float(noise[:8].std())
        if self.metric == "peak":
            near = np.abs(signal) >= np.abs(signal).max() - reach
            return np.abs(signal[near] + noise[:, near]).max(axis=1)
        high, low = signal >= signal.max() - reach, signal <= signal.min() + reach
        return (signal[high] + noise[:, high]).max(axis=1) - (signal[low] + noise[:, low]).min(axis=1)


DRAWS = 500
"""Of records of noise: a quantile of 2.5 % is known to 0.7 %."""
POWERS = 4000
"""Draws of a power."""
_FINE = 6.0
"""Samples that are drawn per period of the band's upper edge."""
_NEIGHBOURS = 15
"""Frequencies whose power is taken together: 30 degrees of freedom."""
_CLEARLY = 1.5
"""Of noise, what power stands out of it; noise alone has more once in 25."""
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
    rested: bool = True
    """Whether the noise is that of this record's own rest, and not of another's."""
    stated: Noise | None = None
    """What the rig states of the channel's noise, for where no rest shows it."""
    faults: tuple[tuple[str, str], ...] = ()
    """What the record itself shows of a sensor that failed: code and message."""

    @property
    def statistic(self) -> MetricStatistic:
        """What is read."""
        return MetricStatistic(self.measure.metric)

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
        if self.statistic.squared:
            return self._powers(amplitudes, known)
        scale = np.ones(DRAWS, np.float32) if known else self._scales
        found, done = [], 0
        for noise in self._noises():
            block = noise * scale[done : done + len(noise), None]
            found.append(self.statistic.extremes(self._lobes, amplitudes, block))
            done += len(noise)
        return np.concatenate(found).astype(float)

    def _powers(self, amplitudes: Floats, known: bool) -> Floats:
        """Mean squares a^2 + 2 a c + p: c the mean product of noise and a course of amplitude 1, p the noise's power.

        Of the record only the part after its rest is noise of another power than estimated, by F of both freedoms;
        c is Student's t, since its variance is that of the noise where the course has its frequencies.
        """
        assert self.noise is not None
        rng, band, power = self._generator(), self.measure.band, self.noise.power(self.measure.band)
        share = min(self.noise.seconds / self.seconds, 1.0) if self.rested and not known else 0.0
        variance, freedom = self._product
        if known:
            own, cross = _chi_squared(rng, self.noise.freedom(band, self.seconds)), rng.standard_normal(POWERS)
        else:
            later = _chi_squared(rng, self.noise.freedom(band, (1.0 - share) * self.seconds))
            own = share + (1.0 - share) * later / _chi_squared(rng, self.noise.freedom(band))
            cross = rng.standard_normal(POWERS) / np.sqrt(_chi_squared(rng, freedom))
        return amplitudes**2 + 2.0 * np.outer(variance**0.5 * cross, amplitudes) + (power * own)[:, None]

    @cached_property
    def _product(self) -> tuple[float, float]:
        """Variance of the mean product of noise and the course at RMS 1, and its degrees of freedom.

        sum |course|^2 S / 2 T over both signs of frequency, course and noise as the band leaves them.
        """
        assert self.noise is not None
        course = self._course
        frequency = np.arange(len(course) // 2 + 1) / self.seconds
        power = 2.0 * np.abs(np.fft.rfft(course)) ** 2 / max(float(np.sum(course**2)) * len(course), 1e-300)
        weights = power * self._gain(frequency) ** 2
        variance = float(weights @ self._density(frequency)) / (2.0 * self.seconds)
        return variance, self.noise.freedom_at(frequency, weights)

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
    def _lobes(self) -> ConstrainedPeaks:
        """Swings of the course; of one that does not stand out of the noise, no more than the highest is taken on."""
        lobes = ConstrainedPeaks(self._course)
        return lobes if self._seen.any() else lobes.highest

    @cached_property
    def _course(self) -> Floats:
        """The course of the vibration as far as it stands out of the noise, (n,) [unit]; all of the record if nowhere.

        Kept as they are, since a share of them would make the heights too small, are the frequencies that stand out.
        """
        spectrum = self._spectrum
        return np.fft.irfft(spectrum * self._seen if self._seen.any() else spectrum, self._count)

    @cached_property
    def _seen(self) -> np.ndarray:
        """Which frequencies have, with their neighbours, clearly more power than the noise, (m,)."""
        frequency = np.arange(self._count // 2 + 1) / self.seconds
        noise = self._count**2 * self._density(frequency) * self._gain(frequency) ** 2 / (2.0 * self.seconds)
        power = np.convolve(np.abs(self._spectrum) ** 2, np.full(_NEIGHBOURS, 1.0 / _NEIGHBOURS), "same")
        return power > _CLEARLY * noise

    @cached_property
    def _spectrum(self) -> np.ndarray:
        """Of the record in its band, at as many samples as noise is drawn at, (m,)."""
        shaped = self.measure.shape(self.values, self.rate_hz)
        count = self._count // 2 + 1
        spectrum = np.fft.rfft(shaped)[:count] * (self._count / len(shaped))
        return np.pad(spectrum, (0, count - len(spectrum)))


def _chi_squared(rng: np.random.Generator, freedom: float) -> Floats:
    """Draws of chi squared over its degrees of freedom, (POWERS,)."""
    return rng.chisquare(freedom, POWERS) / freedom if np.isfinite(freedom) else np.ones(POWERS)


Place = tuple[str, str]
"""Sensor and axis."""
_CLIPPED = ("clipping", "clipping_suspected")


def amplitudes(run: "SIRun", measure: Measure) -> dict[Place, Amplitude]:
    """Amplitude of the base's vibration by (sensor, axis), in m/s2; without noise where no rest stretch shows it."""
    clipped = {f.channel for f in run.doubts(run.rig.base_columns) if f.code in _CLIPPED}
    columns = {(c.sensor, c.component): c for c in run.rig.base_columns}
    rests: dict[str, slice | None] = {}
    found = {}
    for place, (values, rate) in base_accelerations(run).items():
        group, index = run.recorded.find(columns[place].channel)
        if group.name not in rests:
            rests[group.name] = _rest(run, group.name, rate)
        column = columns[place]
        noise = _noise(values, rate, rests[group.name], column.resolution, measure)
        stated = Noise.stated(column.noise, rate, column.resolution)
        said = group.channels[index].name in clipped
        faults = _faults(values, rate, said)
        bound = said or any(code in _CLIPPED for code, _ in faults)
        found[place] = Amplitude(values, rate, measure, noise, bound, stated=stated, faults=faults)
    return found


def _faults(values: Floats, rate_hz: float, said: bool) -> tuple[tuple[str, str], ...]:
    """What a record shows of a sensor that failed; ``said``: ingest found already that it clipped."""
    shown = {"held_value": stuck_value(values, rate_hz), "clipping_suspected": None if said else flat_tops(values)}
    return tuple((code, message) for code, message in shown.items() if message)


def _noise(values: Floats, rate_hz: float, still: slice | None, step: float, measure: Measure) -> Noise | None:
    if still is None:
        return None
    try:
        noise = Noise.of(values[still], rate_hz, step or smallest_step(values))
    except AnalysisError:
        return None
    return noise if noise.freedom(measure.band) >= ENOUGH else None


def _rest(run: "SIRun", group: str, rate_hz: float) -> slice | None:
    """The stretch before anything moves that the logger of ``group`` records."""
    signals = [run.recorded.channel(c.channel, group) for c in run.rig.columns() if run.holds(c, group)]
    return rest_before([s for s in signals if np.isfinite(s).all()], rate_hz)


def smallest_step(values: Floats) -> float:
    """The smallest step between values that a channel took: its resolution, where the rig states none."""
    steps = np.diff(np.unique(values))
    real = steps[steps > 1e-9 * max(float(np.abs(values).max(initial=0.0)), 1e-300)]
    return float(real.min()) if real.size else 0.0
