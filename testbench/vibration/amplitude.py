"""One channel in one run: its record, what was read of it, and what would be read if the amplitude were another.

Noise as the campaign shows it (``noise_floor``) is drawn and added to the signal that the record shows (propagation of
distributions, JCGM 101:2008): the reading and its interval then contain the same effect of the noise. Drawn with it are
what the lines of the mains may be wrong by that were taken out (``tonal_lines``), and what a step hides: where the
noise does not dither the channel, rounding is no noise but the same in all samples near an extreme. The signal that the
record shows is then rounded anew, at offsets within a step of which nothing is known (a Type B term).

Peaks need a model of the signal. Several swings may be of nearly equal height, and noise may make any of them the
largest. If the largest is h, the likeliest heights are: as estimated where that is below h, h where it is above, and h
for the highest (maximum likelihood under the constraint max = h; Silvapulle and Sen, "Constrained Statistical
Inference", 2005). With the signal as estimated the interval would be too narrow: a swing that noise made the largest
would count as larger in truth.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np

from balance.arrays import Floats, Indices, upper_median

from ..signal import Metric
from .metrics import METRICS, Measure, gain_of_record
from .noise_floor import Draws, Noise, NoiseRecords, Segment, noise_draws, random_numbers
from .noise_over_time import NoiseOverTime
from .tonal_lines import Lines

Place = tuple[str, str]
"""Sensor and axis."""
Sign = Literal[1, -1]
SIGNS: tuple[Sign, Sign] = (1, -1)
SAMPLES_PER_PERIOD = 6.0
"""Samples of a simulated record per period of the band's upper edge."""
SAME_RATE = 1e-4
"""By which rates of repeats may differ, as those of rounded times do: a fifth of a millisecond over two seconds."""
_WHOLE = 0.8
"""Share of the frequencies of a resampled record up to which it is not tapered."""
_SIGNIFICANT = 1.5
"""Power over that of the noise from which a frequency belongs to the signal."""
_SWINGS = 3.0
"""Standard deviations of noise up to which its own swings go."""
_NEIGHBOURS = 15
"""Frequencies whose power is averaged."""
_FADING = 200
"""Samples in which a record fades out beyond its ends."""
_FINE_SAMPLES = 8
"""Samples, at least, to which each of a resampled record is made finer near its extremes."""
_POLYNOMIAL = 8
"""Fine samples that a polynomial is laid through."""
_OFFSETS = 24
"""Offsets within a step at which a course is rounded."""
_GOLDEN = 0.6180339887498949
"""Golden section: the fractions of its multiples fill 0 to 1 evenly, however many they are [-]."""
_HIDDEN = 9.0
"""Times by which noise that does not dither a step is weaker than the step's own: a rest on one value scatters by less
than a sixth of a step, how much less is not known (rectangular distribution of JCGM 101:2008, 6.4.2: step^2 / 108)."""
_DITHERED = 1e-3
"""Share of a step's error below which it is noise alone."""
_LOOKED_AT = 5000
"""Samples of a rest that tell whether noise drowns a step."""


@dataclass(frozen=True)
class ConstrainedPeaks:
    """A signal in swings, each from one local minimum of its absolute value to the next."""

    course: Floats
    """The signal, (n,) [unit]."""

    def with_amplitudes(self, metric: Metric, amplitudes: Floats, sign: Sign, reach: float) -> tuple[Indices, Floats]:
        """By :meth:`with_peaks` or :meth:`with_peak_to_peaks`."""
        at = self.with_peaks if metric == "peak" else self.with_peak_to_peaks
        return at(amplitudes, sign, reach)

    def with_peaks(self, peaks: Floats, sign: Sign = 1, reach: float = np.inf) -> tuple[Indices, Floats]:
        """``sign`` times the likeliest signals whose largest absolute values are ``peaks`` (k,) [unit]: samples (s,) of
        the swings that come within ``reach`` [unit] of the highest one, and values there (k, s) [unit].
        """
        return self._limited((peaks, peaks), [int(np.argmax(self._heights))], sign, reach)

    def with_peak_to_peaks(self, spans: Floats, sign: Sign = 1, reach: float = np.inf) -> tuple[Indices, Floats]:
        """Likewise of the likeliest signals whose peak-to-peak values are ``spans`` (k,) [unit].

        Both ends take half of the difference from the estimated span; neither passes zero.
        """
        top, bottom = (max(float(end.max()), 0.0) for end in self._ends)
        shared = np.clip(top + 0.5 * (spans - top - bottom), 0.0, spans)
        high = shared if top > 0.0 and bottom > 0.0 else spans * (top > 0.0)
        raised = [int(np.argmax(end)) for end in self._ends if end.max() > 0.0]
        return self._limited((high, spans - high), raised, sign, reach)

    def above(self, least: float, both: bool) -> "ConstrainedPeaks":
        """Swings higher than ``least`` [unit], and the highest, ``both``: of either sign; zero elsewhere."""
        kept = self._heights > least
        for end in self._ends if both else (self._heights,):
            kept[int(np.argmax(end))] |= bool(end.max() > 0.0)
        return ConstrainedPeaks(self.course * np.repeat(kept, self._lengths))

    @cached_property
    def _starts(self) -> np.ndarray:
        """First sample of each swing: where the sign changes, and at local minima of the absolute value, (m,)."""
        size, begins = np.abs(self.course), np.zeros(len(self.course), dtype=bool)
        begins[0] = True
        begins[1:-1] |= (size[1:-1] <= size[:-2]) & (size[1:-1] < size[2:])
        begins[1:] |= np.signbit(self.course[1:]) != np.signbit(self.course[:-1])
        return np.flatnonzero(begins)

    @cached_property
    def _lengths(self) -> np.ndarray:
        return np.diff(np.append(self._starts, len(self.course)))

    @cached_property
    def _ends(self) -> tuple[Floats, Floats]:
        """Largest value of each swing, and of its negative, (m,) each [unit]."""
        high, low = (ufunc.reduceat(self.course, self._starts) for ufunc in (np.maximum, np.minimum))
        return high, -low

    @cached_property
    def _heights(self) -> Floats:
        return np.maximum(*self._ends)

    @cached_property
    def _divisors(self) -> Floats:
        """Height of each swing, infinite where it has none, (m,) [unit]."""
        return np.where(self._heights > 0.0, self._heights, np.inf)

    def _limited(
        self, limits: tuple[Floats, Floats], raised: Sequence[int], sign: Sign, reach: float
    ) -> tuple[Indices, Floats]:
        """``sign`` times the signals whose swings are limited to heights above and depths below zero, (k,) [unit] each,
        those ``raised`` set to them: samples (s,) that come within ``reach`` of the largest, and values there (k, s).
        """
        ends, limit = self._ends[sign < 0], limits[sign < 0]
        near = ends >= min(float(ends.max()), float(limit.min())) - reach
        near[raised] = True
        swings = np.flatnonzero(near)
        lengths, (above, below) = self._lengths[swings], limits
        ends_of = lengths.cumsum()
        samples = np.repeat(self._starts[swings] - ends_of + lengths, lengths) + np.arange(ends_of[-1])
        wanted = np.where(self._ends[0][swings] > 0.0, above[:, None], below[:, None]) / self._divisors[swings]
        factors, set_to = np.minimum(wanted, 1.0), swings.searchsorted(raised)
        factors[:, set_to] = wanted[:, set_to]
        return samples, sign * self.course[samples] * np.repeat(factors, lengths, axis=1)


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

    def of_noise(self, noises: NoiseRecords) -> Floats:
        """Readings of noise alone, (draws,) [unit, or its square]."""
        if self.squared:
            return noises.mean_squares + noises.rounding
        high, low = noises.ends
        return noises.rounding + (np.maximum(high, -low) if self.metric == "peak" else high - low)

    def readings(self, peaks: ConstrainedPeaks, amplitudes: Floats, noises: NoiseRecords) -> Floats:
        """Readings at amplitudes (k,) [unit] in records of noise, (draws, k) [unit, or its square]."""
        added = noises.rounding[:, None]
        if self.squared:
            unit = peaks.course / max(float(np.sqrt(np.mean(peaks.course**2))), 1e-300)
            return (
                amplitudes**2
                + 2.0 * np.outer(noises.products(unit), amplitudes)
                + (noises.mean_squares[:, None] + added)
            )
        signals = (peaks.with_amplitudes(self.metric, amplitudes, sign, noises.reach) for sign in SIGNS)
        high, low = (noises.highest(*some, sign) for some, sign in zip(signals, SIGNS, strict=True))
        return added + (np.maximum(high, low) if self.metric == "peak" else high + low)

    def excess(
        self, peaks: ConstrainedPeaks, amplitudes: Floats, noises: NoiseRecords, shown: Floats
    ) -> tuple[Floats, Floats]:
        """Sums of the squares by which signals of amplitudes (k,) [unit] in records of noise exceed their own ends,
        (draws, k), and by which what is ``shown`` (n,) [unit] does, (k,) [unit^2].

        All swings tell that the amplitude is not as small: noise that makes one high makes not all so.
        """
        added, drawn, beyond = noises.rounding * (1.0 if self.metric == "peak" else 0.5), [], []
        for sign in SIGNS:
            samples, signals = peaks.with_amplitudes(self.metric, amplitudes, sign, noises.reach)
            tops = amplitudes if self.metric == "peak" else signals.max(axis=1)
            drawn.append(noises.excess(samples, signals, tops, added, sign))
            above = np.maximum(sign * shown[sign * shown > tops.min()] - tops[:, None], 0.0)
            beyond.append(np.einsum("ij,ij->i", above, above))
        return drawn[0] + drawn[1], beyond[0] + beyond[1]


@dataclass(frozen=True)
class Amplitude:
    """A channel in one run, resampled to what its band needs; lines of the mains are taken out."""

    measure: Measure
    seconds: float
    """Length of the record [s]."""
    reading: float
    """What was read at the logger's rate, noise included [unit, or its square]."""
    course: Floats
    """In the band, (n,) [unit]."""
    whole: Floats
    """Not limited by the band, without what is slow, (n,) [unit]."""
    rest: slice | None = None
    """Samples before the motion; None where it is not known when anything moves."""
    moving: slice | None = None
    """Samples from the first to the last motion; all where that is not known."""
    line_errors: Floats | None = None
    """By how much the lines that were taken out may be wrong, in the band, a standard deviation each, (j, n) [unit]."""
    rounding: tuple[float, ...] = ()
    """What rounding at random offsets adds to the reading [unit, or its square]; none where noise dithers the step."""
    rounding_gain: float = 0.0
    """Standard deviation of the share of its signal that rounding adds [-]."""
    plateaus: Floats | None = None
    """What rounding at one of these offsets adds to the record, (n,) [unit]; None where noise dithers the step."""
    toggles: float | None = None
    """Standard deviation of a rest on one value or two next to each other [steps]; None of another, and where noise
    dithers the step."""
    averages: int = 1
    """Records that it is the mean of."""
    envelope: Floats | None = None
    """Factor on the noise of a mean over time, larger where some of its records do not reach, (n,) [-]; None: 1."""
    over_time: NoiseOverTime | None = None
    """How noise in motion goes over time; None where there is none."""
    step: float = 0.0
    """Of the channel [unit]; zero where none is known."""
    logger_hz: float = np.inf
    """Rate at which it was recorded."""
    saturated: bool = False
    """Whether the sensor reached the end of its range: the amplitude is at least what was read."""
    dead: bool = False
    """Whether the channel shows one value only."""
    timed: bool = False
    """Whether command or encoders tell on its own clock when anything moves."""
    clocks: str = ""
    """What relates another clock on which they tell it, or why nothing does; empty where it needs none, or has none."""
    stated: Noise | None = None
    """The channel's noise by the rig."""
    faults: tuple[tuple[str, str], ...] = ()
    """Signs of a failed sensor in the record: finding code and message."""

    @classmethod
    def of(
        cls,
        values: Floats,
        rate_hz: float,
        measure: Measure,
        rest: tuple[float, float] | None = None,
        moving: tuple[float, float] | None = None,
        steps: Sequence[float] = (),
        quiet: tuple[float, float] | None = None,
    ) -> "list[Amplitude]":
        """From records (k, m) [unit] of one logger; ``rest``, ``moving`` and ``quiet``, in which lines of the mains are
        sought, else in the rest, are spans of time from their first sample [s].
        """
        band, statistic = measure.band, MetricStatistic(measure.metric)
        every = max(int(rate_hz * (1.0 + SAME_RATE) // (SAMPLES_PER_PERIOD * band.high_hz)), 1) if band else 1
        count = values.shape[1] // every
        used, seconds = count * every, count * every / rate_hz
        still, calm = (None if span is None else _samples(span, count, seconds) for span in (rest, quiet or rest))
        recorded, values = values, np.array([measure.without_trend(row) for row in values])
        cosines = _cosines(values[:, :used], count)
        wholes = values[:, :used].copy() if every == 1 else _from_cosines(cosines * _taper(count))
        courses = _from_cosines(cosines * gain_of_record(measure, count, seconds, rate_hz))
        errors: list[Floats | None] = [None] * len(values)
        for i, (whole, course) in enumerate(zip(wholes, courses, strict=True)):
            lines = None if calm is None else Lines.fitted(whole[calm], count / seconds)
            if lines is not None:
                values[i] = measure.without_trend(values[i] - lines.at(len(values[i]), rate_hz))
                shown = lines.at(count, count / seconds)
                found = np.vstack([shown, lines.errors(count, count / seconds)])
                found = _from_cosines(_cosines(found, count) * gain_of_record(measure, count, seconds, rate_hz))
                whole -= shown
                course -= found[0]
                errors[i] = found[1:]
        shaped = band.filtered(values, rate_hz) if band else values
        runs = []
        for i, step in enumerate(steps or [0.0] * len(values)):
            reading = float(statistic.noiseless_reading(np.array(METRICS[measure.metric][1](shaped[i]))))
            at_rest = np.diff(values[i], 2) / 6.0**0.5 if rest is None else values[i, _samples(rest, used, seconds)]
            undithered = undithered_share(at_rest, step)
            rounded = undithered > _DITHERED
            felt = slice(None) if moving is None else _samples(moving, used, seconds)
            rounding, gain, plateaus = (
                _rounding(measure, courses[i], step, undithered, used, rate_hz, felt) if rounded else ((), 0.0, None)
            )
            toggles = _toggles(recorded[i, _samples(rest, used, seconds)], step) if rounded and rest else None
            runs.append(cls(
                measure, seconds, reading, courses[i], wholes[i], still,
                None if moving is None else _samples(moving, count, seconds), errors[i], rounding, gain, plateaus,
                toggles, step=step, logger_hz=rate_hz,
            ))  # fmt: skip
        return runs

    @property
    def statistic(self) -> MetricStatistic:
        """What is read of the record."""
        return MetricStatistic(self.measure.metric)

    @property
    def rate_hz(self) -> float:
        """Of the resampled record."""
        return len(self.course) / self.seconds

    @property
    def step_density(self) -> float:
        """Density of steps as noise, white of variance step^2 / 12 (JCGM 100:2008, F.2.2.1) [unit^2/Hz]."""
        return self.step**2 / (6.0 * self.logger_hz)

    @property
    def hidden_density(self) -> float:
        """Density of noise that is not seen for the steps: that of the steps themselves where noise dithers them, of
        the weaker noise that they hide where it does not [unit^2/Hz].
        """
        return self.step_density / (_HIDDEN if self.rounding else 1.0)

    @property
    def resting(self) -> Segment | None:
        """The rest before the motion."""
        return None if self.rest is None else Segment(self.whole[self.rest], self.rate_hz)

    @property
    def rounded(self) -> Segment | None:
        """What rounding adds in the motion; None where noise dithers the step."""
        if self.plateaus is None:
            return None
        return Segment(self.plateaus[self.moving or slice(0, len(self.plateaus))], self.rate_hz)

    @property
    def unsure_lines(self) -> list[Segment]:
        """What the lines that were taken out may be wrong by in the motion, in segments that are one together: their
        mean density is that of the sum; none where no line was.
        """
        errors, part = () if self.line_errors is None else self.line_errors, self.moving or slice(None)
        return [Segment(len(errors) ** 0.5 * one[part], self.rate_hz, 1.0 / len(errors)) for one in errors]

    def noises(self, noise: Noise) -> NoiseRecords:
        """Records of noise in the band, and of what else is not known, seeded by the record."""
        draws = noise_draws(noise, self.measure, len(self.course), self.rate_hz)
        rng, scale = random_numbers(self.course), self.averages**-0.5
        number = len(draws.powers)
        if self.envelope is not None:
            draws = draws.times(self.envelope.astype(np.float32)[:, None])
        if self.over_time is not None:
            draws = draws.times(self.over_time.draws(number))
        if self.line_errors is not None:
            shares = rng.standard_normal((len(self.line_errors), number), np.float32)
            errors = (self.line_errors.T / scale).astype(np.float32) @ shares
            draws = Draws((np.concatenate(draws.parts) + errors,), draws.powers)
        rounding = rng.choice(self.rounding, number) if self.rounding else np.zeros(number)
        return NoiseRecords(draws, rounding, scale)

    @property
    def as_read(self) -> Floats:
        """The course with its reading at the logger's rate, (n,) [unit]."""
        return self.course * (
            self.statistic.amplitude(self.reading) / max(METRICS[self.measure.metric][1](self.course), 1e-300)
        )

    def in_band(self, whole: Floats) -> Floats:
        """Records (..., m) [unit] of the same rate in the band, (..., m) [unit]."""
        count = whole.shape[-1]
        gain = gain_of_record(self.measure, count, count / self.rate_hz, self.logger_hz)
        return _from_cosines(_cosines(whole, count) * gain)

    def mean_of(self, runs: Sequence["Amplitude"], lags: Sequence[float], mean: Floats, course: Floats) -> "Amplitude":
        """The mean of repeats that show it ``lags`` [samples] later, read as each of them would show it; whole, and in
        the band, (n,) [unit] each.
        """
        rows = zip(runs, lags, strict=True)
        if self.statistic.squared:  # which is the same at every rate
            sizes = [(shifted(course, -lag, len(course))[: len(run.course)], len(run.course)) for run, lag in rows]
            read = [float(row @ row) / size for row, size in sizes]
        else:
            sampled = [(lag, round(run.seconds * run.logger_hz), len(run.course)) for run, lag in rows]
            read = [METRICS[self.measure.metric][1](row) for row in _near_extremes(course, sampled)]
        errors = [run.line_errors for run in runs if run.line_errors is not None]
        same = [e[:, : len(course)] / len(runs) for e in errors if e.shape[1] >= len(course)]
        return replace(
            self, seconds=len(course) / self.rate_hz, reading=float(np.mean(read)), course=course, whole=mean,
            line_errors=np.concatenate(same) if same else None,
            rounding=tuple(error for run in runs for error in run.rounding),
            saturated=any(run.saturated for run in runs), averages=len(runs),
        )  # fmt: skip

    def peaks(self, noise: Noise) -> tuple[ConstrainedPeaks, ConstrainedPeaks]:
        """Swings that are the signal's for certain, and all that may be; the highest alone where no frequency rises
        above the noise.

        The signal is those frequencies of the record that have, with their neighbours, significantly more power than
        the noise. They are not weighted as by a Wiener filter, which would make the swings too low. Swings no higher
        than those of noise may be noise: as swings of the signal they would raise what an amplitude reads, and what is
        read would speak for a smaller one.
        """
        count, both = len(self.course), self.measure.metric == "peak_to_peak"
        spectrum = _cosines(self.course, count)
        expected = _expected(noise, self.measure, count, self.seconds) / self.averages
        seen = _neighbours(spectrum) > _SIGNIFICANT * expected
        if not seen.any():
            alone = ConstrainedPeaks(self.course).above(np.inf, both)
            return alone, alone
        shown = ConstrainedPeaks(_from_cosines(spectrum * seen))
        if self.statistic.squared:
            return shown, shown
        return shown.above(_SWINGS * float(np.sqrt(expected.sum() / count)), both), shown


@lru_cache(maxsize=8)
def _expected(noise: Noise, measure: Measure, count: int, seconds: float) -> Floats:
    """Squares of the cosines of noise in the band, on average, (count,) [unit^2]."""
    density = noise.at(np.arange(count) / 2.0 / seconds)
    return np.asarray(density * gain_of_record(measure, count, seconds) ** 2 * count / (2.0 * seconds))


def shifted(values: Floats, lag: float, count: int) -> Floats:
    """A record (m,), or several of one length, [any unit] moved ``lag`` samples earlier, (count,) each, count at most
    m; beyond their ends they keep their last values.

    About their ends they are mirrored so that neither value nor slope jumps, and fade out.
    """
    from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

    length = values.shape[-1]
    pad = min(length - 1, _FADING)
    fading = np.sin(0.5 * np.pi * (np.arange(pad) + 0.5) / pad) ** 2
    size = next_fast_len(length + 2 * pad, real=True)
    faded = np.zeros((*values.shape[:-1], size))
    first, last = values[..., :1], values[..., -1:]
    faded[..., :pad] = (2.0 * first - values[..., pad:0:-1]) * fading
    faded[..., pad : pad + length] = values
    faded[..., pad + length : length + 2 * pad] = (2.0 * last - values[..., -2 : -pad - 2 : -1]) * fading[::-1]
    turn, at = np.exp(2j * np.pi * lag * rfftfreq(size)), np.arange(count) + lag
    moved = irfft(rfft(faded) * turn, size)[..., pad : pad + count]
    return np.where(at < 0.0, first, np.where(at > length - 1, last, moved))


def _near_extremes(course: Floats, sampled: Sequence[tuple[float, int, int]]) -> Iterator[Floats]:
    """What loggers read of a course (n,) [unit] that they show some samples later, where it is near its extremes.

    Of each by how many samples of the course, and how many samples it reads while the course has how many. The course
    is made finer once, and between its fine samples a polynomial through eight of them is as good as the course: with
    48 a period it is off by 1e-10.
    """
    finer = -(-_FINE_SAMPLES * sampled[0][2] // sampled[0][1]) * round(sampled[0][1] / sampled[0][2])
    fine = _from_cosines(_cosines(course, finer * len(course)))
    mirrored, bend = np.pad(fine, _POLYNOMIAL // 2, "symmetric"), float(np.abs(np.diff(fine, 2)).max(initial=0.0))
    nodes = np.arange(_POLYNOMIAL) - _POLYNOMIAL // 2 + 1
    for lag, count, length in sampled:
        step, late = finer * length / count, finer * lag
        seen = slice(*np.clip(np.rint([-late, finer * length - late]), [0, 1], [len(fine) - 1, len(fine)]).astype(int))
        reach = bend * (0.5 * step + 1.0) ** 2  # a sample so far from an extreme is lower by no more
        part = fine[seen]
        near = np.flatnonzero((part >= part.max() - reach) | (part <= part.min() + reach)) + seen.start
        number = np.unique(np.clip(np.rint((near + 0.5 + late) / step - 0.5), 0, count - 1))
        at = np.clip((number + 0.5) * step - 0.5 - late, 0.0, len(fine) - 1.0)
        first = at.astype(int)
        weights = np.vander(at - first, _POLYNOMIAL) @ np.linalg.inv(np.vander(nodes, _POLYNOMIAL))
        yield (weights * mirrored[first[:, None] + nodes + _POLYNOMIAL // 2]).sum(axis=1)


def with_shifts(course: Floats) -> Floats:
    """A course (n,) [unit], what it changes by where it is shifted, to second order, and a straight line, (n, 5)."""
    count = len(course)
    turn = 2j * np.pi * np.fft.rfftfreq(2 * count)
    spectrum = np.fft.rfft(np.concatenate([course, course[::-1]]))
    slopes = [np.fft.irfft(spectrum * turn**order, 2 * count)[:count] for order in (1, 2)]
    return np.column_stack([course, *slopes, np.ones(count), np.linspace(-1.0, 1.0, count)])


def undithered_share(resting: Floats, step: float) -> float:
    """How much of a step's error is no noise, as a rest (n,) shows, between 0 and 1 [-].

    With Gaussian noise of standard deviation s the mean reading is off by exp(-2 pi^2 s^2 / q^2) of what it is without
    (Widrow and Kollar, Quantization Noise, 2008). A rest that toggles between two values scatters by up to half a
    step however small the noise is, so that much proves nothing. The median tells the scatter, of motion too.
    """
    if step <= 0.0 or not len(resting):
        return 0.0
    for some in (resting[:: max(len(resting) // _LOOKED_AT, 1)], resting):
        median = upper_median(np.abs(some - upper_median(some)))
        dither = max(min(float(np.std(some)), 1.4826 * median + 0.5 * step) ** 2 - step**2 / 4.0, 0.0)
        if dither > step**2:  # then it drowns for certain
            break
    return float(np.exp(-2.0 * np.pi**2 * dither / step**2))


def _toggles(resting: Floats, step: float) -> float | None:
    """Standard deviation [steps] of a rest (n,) that shows one value, or two next to each other; None of another."""
    values = np.rint((resting - resting.min(initial=0.0)) / step)
    return float(values.std()) if len(values) and np.ptp(values) <= 1.0 else None


def _rounding(
    measure: Measure, course: Floats, step: float, share: float, count: int, rate_hz: float, moving: slice
) -> tuple[tuple[float, ...], float, Floats]:
    """By how much the reading of a course (n,) moves if it is rounded to a step at offsets all over it, the standard
    deviation of the share of the course that this adds, and what one of them, at random, adds to the record, (n,).

    The course was rounded already; its plateaus would meet the new steps in beats. They are taken off as white noise of
    variance step^2 / 12 by Wiener's filter. For peaks its span, known to a step only, is varied by as much: one that is
    a multiple of the step would be read exactly at every offset. What is added has that variance in the motion, however
    little of it the record shows that was on one plateau.
    """
    gain = gain_of_record(measure, len(course), count / rate_hz, rate_hz)
    spectrum, expected = _cosines(course, len(course)), step**2 / 12.0 * gain**2 * len(course) / count
    smooth = spectrum * np.clip(1.0 - expected / np.maximum(_neighbours(spectrum), 1e-300), 0.0, 1.0)
    fine, statistic = _from_cosines(_cosines(_from_cosines(smooth), count)), MetricStatistic(measure.metric)
    offsets = (np.arange(_OFFSETS)[:, None] + 0.5) / _OFFSETS
    varied = (_GOLDEN * np.arange(_OFFSETS) % 1.0 - 0.5) * (not statistic.squared)
    scales = 1.0 + varied * step / max(float(np.ptp(fine)), step)
    added = (np.round(scales[:, None] * fine / step + offsets) - offsets) * step - scales[:, None] * fine
    gain = gain_of_record(measure, count, count / rate_hz, rate_hz)
    added -= added.mean(axis=1, keepdims=True)
    shown = _from_cosines(_cosines(fine, count) * gain)
    errors = _from_cosines(_cosines(added, count) * gain)
    read = [METRICS[measure.metric][1](row) for row in (*(scales[:, None] * shown + errors), shown)]
    moved = statistic.noiseless_reading(np.array(read[:-1])) - statistic.noiseless_reading(scales * read[-1])
    gains = np.linalg.pinv(with_shifts(shown))[0] @ errors.T
    one = added[random_numbers(course).integers(_OFFSETS)]
    felt = one[moving] if len(one[moving]) else one
    one = one * (step / 12.0**0.5 / max(float(felt.std()), 1e-9 * step))
    plateaus = share * _from_cosines(_cosines(one, len(course)) * _taper(len(course)))
    return tuple((share * moved).tolist()), share * float(gains.std()), plateaus


def _neighbours(spectrum: Floats) -> Floats:
    """Power of frequencies (k,), each averaged with its neighbours, (k,)."""
    around = np.pad(spectrum**2, _NEIGHBOURS // 2)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(around, len(spectrum)).mean(axis=0))


def _samples(span: tuple[float, float], count: int, seconds: float) -> slice:
    begin, end = (min(max(round(at * count / seconds), 0), count) for at in span)
    return slice(begin, end)


def _cosines(values: Floats, count: int) -> Floats:
    """The lowest ``count`` coefficients of a record (m,) mirrored at both ends, scaled to ``count`` samples."""
    from scipy.fft import dct

    size = values.shape[-1]
    found = dct(values, norm="ortho")[..., :count] * (count / size) ** 0.5
    return np.pad(found, [(0, 0)] * (values.ndim - 1) + [(0, max(count - size, 0))])


def _from_cosines(spectrum: Floats) -> Floats:
    from scipy.fft import idct

    return np.asarray(idct(spectrum, norm="ortho"))


@lru_cache(maxsize=8)
def _taper(count: int) -> Floats:
    """Factors on the cosines of a resampled record (count,) [-]: its uppermost frequencies fade out."""
    share = np.arange(count) / count
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.clip((share - _WHOLE) / (1.0 - _WHOLE), 0.0, 1.0)))
