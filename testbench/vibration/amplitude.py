"""The amplitude of one channel in one run: what was read, and what would be read if the amplitude were another.

Noise with the spectrum of the run's rest is simulated and added to the signal that the record shows (propagation of
distributions, JCGM 101:2008): the reading and its interval then contain the same effect of the noise. The power of the
noise is itself uncertain, since it is estimated from the rest alone. For the RMS no records need be simulated: its
square is the power of the signal, plus twice the product of signal and noise (Gaussian), plus the power of the noise
(chi squared).

Peaks need a model of the signal. Several swings may be of nearly equal height, and noise may make any of them the
largest. If the largest is h, the likeliest heights are: as estimated where that is below h, h where it is above, and h
for the highest (maximum likelihood under the constraint max = h; Silvapulle and Sen, "Constrained Statistical
Inference", 2005). With the signal as estimated the interval would be too narrow: a swing that noise made the largest
would count as larger in truth.
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
from ..signal import Metric
from .metrics import Measure, base_accelerations
from .noise_floor import ENOUGH, Noise

if TYPE_CHECKING:
    from ..runs.si_run import SIRun

Place = tuple[str, str]
"""Sensor and axis."""
DRAWS = 500
"""Simulated records of noise: a quantile of 2.5 % is known to 0.7 %."""
POWERS = 4000
"""Simulated powers."""
_SAMPLES_PER_PERIOD = 6.0
"""Simulated samples per period of the band's upper edge."""
_NEIGHBOURS = 15
"""Frequencies whose power is averaged: 30 degrees of freedom."""
_SIGNIFICANT = 1.5
"""Power over that of the noise from which a frequency belongs to the signal; noise alone exceeds it once in 25."""
_BLOCK = 8_000_000
"""Most samples simulated at a time."""
_CLIPPED = ("clipping", "clipping_suspected")


@dataclass(frozen=True)
class ConstrainedPeaks:
    """A signal in swings, each from one local minimum of its absolute value to the next."""

    course: Floats
    """The signal, (n,) [unit]."""

    def with_peak(self, peak: float) -> Floats:
        """The likeliest signal whose largest absolute value is ``peak`` [unit], (n,) [unit]."""
        return self._scaled(peak, self._heights)

    def with_peak_to_peak(self, span: float) -> Floats:
        """The likeliest signal whose peak-to-peak value is ``span`` [unit], (n,) [unit].

        Both ends take half of the difference from the estimated span; neither passes zero.
        """
        up, down = self._signed
        top, bottom = float(up.max()), float(down.max())
        shared = float(np.clip(top + 0.5 * (span - top - bottom), 0.0, span))
        high = shared if top > 0.0 and bottom > 0.0 else span * (top > 0.0)
        return self._scaled(high, up) + self._scaled(span - high, down)

    @cached_property
    def highest(self) -> "ConstrainedPeaks":
        """The highest swing alone; zero elsewhere."""
        only = np.arange(len(self._heights)) == int(np.argmax(self._heights))
        return ConstrainedPeaks(self.course * np.repeat(only, self._lengths))

    def _scaled(self, peak: float, heights: Floats) -> Floats:
        """The swings with ``heights`` (m,), limited to ``peak``, the highest set to it; those of height zero vanish."""
        if not heights.any():
            return np.zeros_like(self.course)
        wanted = np.minimum(heights, peak)
        wanted[np.argmax(heights)] = peak
        factors = np.divide(wanted, heights, out=np.zeros_like(heights), where=heights > 0.0)
        return self.course * np.repeat(factors, self._lengths)

    @cached_property
    def _starts(self) -> np.ndarray:
        """First sample of each swing: where the sign changes, and at local minima of the absolute value, (m,)."""
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
    """What is read of a record: a peak itself, but the square of the RMS, to which noise adds its own power."""

    metric: Metric

    @property
    def squared(self) -> bool:
        """Whether the reading is the square of the amplitude."""
        return self.metric == "rms"

    def noiseless_reading(self, amplitude: Floats) -> Floats:
        """What amplitudes (k,) [unit] read without noise, (k,) [unit, or its square]."""
        return amplitude**2 if self.squared else amplitude

    def amplitude(self, reading: float) -> float:
        """The amplitude of a reading without noise [unit]."""
        return max(reading, 0.0) ** 0.5 if self.squared else reading

    def extremes(self, peaks: ConstrainedPeaks, amplitudes: Floats, noise: Floats) -> Floats:
        """Peaks, or peak-to-peak values, at amplitudes (k,) in records of noise (b, n), (b, k); all [unit]."""
        at = {"peak": peaks.with_peak, "peak_to_peak": peaks.with_peak_to_peak}[self.metric]
        return np.stack([self._extreme(at(float(a)).astype(noise.dtype), noise) for a in amplitudes], axis=1)

    def _extreme(self, signal: Floats, noise: Floats) -> Floats:
        """Extremes (b,) of the signal in noise; only samples within 12 standard deviations of the largest matter."""
        reach = 12.0 * float(noise[:8].std())
        if self.metric == "peak":
            near = np.abs(signal) >= np.abs(signal).max() - reach
            return np.abs(signal[near] + noise[:, near]).max(axis=1)
        high, low = signal >= signal.max() - reach, signal <= signal.min() + reach
        return (signal[high] + noise[:, high]).max(axis=1) - (signal[low] + noise[:, low]).min(axis=1)


@dataclass(frozen=True)
class Amplitude:
    """A channel in one run; ``noise`` is None where no rest shows it."""

    values: Floats
    """As recorded, (n,) [unit]."""
    rate_hz: float
    measure: Measure
    noise: Noise | None
    saturated: bool = False
    """Whether the sensor reached the end of its range: the amplitude is at least what was read."""
    own_rest: bool = True
    """Whether the noise is that of this record's own rest, not of another run's."""
    stated_noise: Noise | None = None
    """The channel's noise by the rig, used where no rest shows it."""
    faults: tuple[tuple[str, str], ...] = ()
    """Signs of a failed sensor in the record: finding code and message."""

    @property
    def statistic(self) -> MetricStatistic:
        """What is read of the record."""
        return MetricStatistic(self.measure.metric)

    @cached_property
    def reading(self) -> float:
        """What was read, noise included [unit, or its square]."""
        return float(self.statistic.noiseless_reading(np.array(self.measure.amplitude(self.values, self.rate_hz))))

    @property
    def seconds(self) -> float:
        """Length of the record [s]."""
        return len(self.values) / self.rate_hz

    @cached_property
    def floor(self) -> float | None:
        """Median reading of noise alone [unit, or its square]."""
        return None if self.noise is None else float(np.median(self.simulate(np.zeros(1), known=True)))

    def simulate(self, amplitudes: Floats, known: bool = False) -> Floats:
        """Simulated readings (draws, k) [unit, or its square] if the amplitude were one of ``amplitudes`` (k,) [unit].

        With ``known`` the noise has exactly the estimated power; otherwise its power varies as far as the rest allows.
        """
        if self.statistic.squared:
            return self._powers(amplitudes, known)
        scale = np.ones(DRAWS, np.float32) if known else self._scales
        found, done = [], 0
        for noise in self._noises():
            block = noise * scale[done : done + len(noise), None]
            found.append(self.statistic.extremes(self._peaks, amplitudes, block))
            done += len(noise)
        return np.concatenate(found).astype(float)

    def _powers(self, amplitudes: Floats, known: bool) -> Floats:
        """Mean squares a^2 + 2 a c + p: c the mean product of noise and a signal of RMS 1, p the power of the noise.

        Only after its rest may the noise of the record have another power than estimated: that ratio has an F
        distribution with the degrees of freedom of both parts. c has Student's t, since its variance is estimated too.
        """
        assert self.noise is not None
        rng, band, power = self._generator(), self.measure.band, self.noise.power(self.measure.band)
        share = min(self.noise.seconds / self.seconds, 1.0) if self.own_rest and not known else 0.0
        variance, freedom = self._product
        if known:
            own, cross = (
                _chi_squared(rng, self.noise.degrees_of_freedom(band, self.seconds)),
                rng.standard_normal(POWERS),
            )
        else:
            later = _chi_squared(rng, self.noise.degrees_of_freedom(band, (1.0 - share) * self.seconds))
            own = share + (1.0 - share) * later / _chi_squared(rng, self.noise.degrees_of_freedom(band))
            cross = rng.standard_normal(POWERS) / np.sqrt(_chi_squared(rng, freedom))
        return amplitudes**2 + 2.0 * np.outer(variance**0.5 * cross, amplitudes) + (power * own)[:, None]

    @cached_property
    def _product(self) -> tuple[float, float]:
        """Variance of the mean product of noise and the signal at RMS 1 [unit^2], and its degrees of freedom.

        sum |signal|^2 S / 2 T over both signs of frequency, signal and noise as filtered by the band.
        """
        assert self.noise is not None
        course = self._course
        frequency = np.arange(len(course) // 2 + 1) / self.seconds
        power = 2.0 * np.abs(np.fft.rfft(course)) ** 2 / max(float(np.sum(course**2)) * len(course), 1e-300)
        weights = power * self._gain(frequency) ** 2
        variance = float(weights @ self._density(frequency)) / (2.0 * self.seconds)
        return variance, self.noise.degrees_of_freedom_of_sum(frequency, weights)

    @cached_property
    def _scales(self) -> Floats:
        """Simulated true over estimated amplitude of the noise: sqrt(nu / chi squared), (DRAWS,) [-]."""
        assert self.noise is not None
        freedom = self.noise.degrees_of_freedom(self.measure.band)
        drawn = self._generator().chisquare(freedom, DRAWS) if np.isfinite(freedom) else np.full(DRAWS, 1.0)
        return np.sqrt((freedom if np.isfinite(freedom) else 1.0) / drawn).astype(np.float32)

    def _generator(self) -> np.random.Generator:
        """Seeded by the record: the same record gives the same draws."""
        return np.random.default_rng(zlib.crc32(np.ascontiguousarray(self.values).tobytes()))

    def _noises(self) -> Iterable[Floats]:
        """DRAWS records of noise in blocks (b, n) [unit]; one cached block where it is small."""
        return [self._only_block] if DRAWS * self._count <= _BLOCK else self._blocks()

    @cached_property
    def _only_block(self) -> Floats:
        return np.concatenate(list(self._blocks()))

    def _blocks(self) -> Iterator[Floats]:
        rng, block = self._generator(), max(_BLOCK // self._count, 1)
        for start in range(0, DRAWS, block):
            yield self._draw(min(block, DRAWS - start), rng)

    @cached_property
    def _count(self) -> int:
        """Samples of a simulated record: as many as its band needs."""
        band = self.measure.band
        rate = min(_SAMPLES_PER_PERIOD * band.high_hz, self.rate_hz) if band else self.rate_hz
        return max(round(self.seconds * rate), 16)

    def _draw(self, count: int, rng: np.random.Generator) -> Floats:
        """Noise in the band, (count, n) [unit]: cosines at multiples of half a period a record, sqrt(S / T) each.

        Cosines are even about both ends of the record, like noise that the band's filter mirrors there.
        """
        from scipy.fft import idct

        frequency = np.arange(self._count) / (2.0 * self.seconds)
        sizes = self._gain(frequency) * np.sqrt(self._density(frequency) / self.seconds)
        sizes[0] = 0.0  # the mean is removed
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
    def _peaks(self) -> ConstrainedPeaks:
        """Swings of the signal; the highest one alone where no frequency rises above the noise."""
        peaks = ConstrainedPeaks(self._course)
        return peaks if self._seen.any() else peaks.highest

    @cached_property
    def _course(self) -> Floats:
        """The signal: the frequencies of the record that rise above the noise, or all if none does, (n,) [unit].

        They are not weighted as by a Wiener filter, which would make the swings too low.
        """
        spectrum = self._spectrum
        return np.fft.irfft(spectrum * self._seen if self._seen.any() else spectrum, self._count)

    @cached_property
    def _seen(self) -> np.ndarray:
        """Frequencies that have, with their neighbours, significantly more power than the noise, (m,)."""
        frequency = np.arange(self._count // 2 + 1) / self.seconds
        noise = self._count**2 * self._density(frequency) * self._gain(frequency) ** 2 / (2.0 * self.seconds)
        power = np.convolve(np.abs(self._spectrum) ** 2, np.full(_NEIGHBOURS, 1.0 / _NEIGHBOURS), "same")
        return power > _SIGNIFICANT * noise

    @cached_property
    def _spectrum(self) -> np.ndarray:
        """Of the record in its band, resampled to the length of the simulated noise, (m,) [unit]."""
        shaped = self.measure.shape(self.values, self.rate_hz)
        count = self._count // 2 + 1
        spectrum = np.fft.rfft(shaped)[:count] * (self._count / len(shaped))
        return np.pad(spectrum, (0, count - len(spectrum)))


def _chi_squared(rng: np.random.Generator, freedom: float) -> Floats:
    """Draws of chi squared over its degrees of freedom, (POWERS,) [-]."""
    return rng.chisquare(freedom, POWERS) / freedom if np.isfinite(freedom) else np.ones(POWERS)


def amplitudes_of_run(run: "SIRun", measure: Measure) -> dict[Place, Amplitude]:
    """Amplitudes [m/s2] of each axis of each accelerometer on the base; ``noise`` is None where no rest shows it."""
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
        clipping_found = group.channels[index].name in clipped
        faults = _faults(values, rate, clipping_found)
        saturated = clipping_found or any(code in _CLIPPED for code, _ in faults)
        found[place] = Amplitude(values, rate, measure, noise, saturated, stated_noise=stated, faults=faults)
    return found


def _faults(values: Floats, rate_hz: float, clipping_found: bool) -> tuple[tuple[str, str], ...]:
    """Signs of a failed sensor in a record; ``clipping_found``: ingest reported already that it clipped."""
    shown = {
        "held_value": stuck_value(values, rate_hz),
        "clipping_suspected": None if clipping_found else flat_tops(values),
    }
    return tuple((code, message) for code, message in shown.items() if message)


def _noise(values: Floats, rate_hz: float, still: slice | None, step: float, measure: Measure) -> Noise | None:
    if still is None:
        return None
    try:
        noise = Noise.of(values[still], rate_hz, step or observed_resolution(values))
    except AnalysisError:
        return None
    return noise if noise.degrees_of_freedom(measure.band) >= ENOUGH else None


def _rest(run: "SIRun", group: str, rate_hz: float) -> slice | None:
    """The rest before anything moves, in samples of the logger that recorded ``group``."""
    signals = [run.recorded.channel(c.channel, group) for c in run.rig.columns() if run.holds(c, group)]
    return rest_before([s for s in signals if np.isfinite(s).all()], rate_hz)


def observed_resolution(values: Floats) -> float:
    """Smallest step between the values (n,) [unit] of a channel [unit]: its resolution, where the rig states none."""
    steps = np.diff(np.unique(values))
    real = steps[steps > 1e-9 * max(float(np.abs(values).max(initial=0.0)), 1e-300)]
    return float(real.min()) if real.size else 0.0
