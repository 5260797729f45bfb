"""The noise of a channel: a spectrum, how well it is known, and records drawn from it.

The spectrum is pooled over all segments that show noise alone: the rests of the campaign's runs, and what does not
repeat between aligned repeats (which shows noise that acts in motion only; of single runs: ``noise_in_motion``). By
sine tapers (Riedel and Sidorenko, IEEE Trans. Signal Process. 43, 188, 1995) a segment of T seconds resolves 4 / T; in
a cell so wide the power may be that of a narrow mode, of which each segment shows one complex amplitude: two degrees
of freedom, however many the segment has elsewhere. What stands above the median of the cells about it counts so; what
that median has too is alike all over a cell, of which a segment shows several. Below 1 / T nothing is known but
that spectra of floors and drift rise towards low frequencies: there the density is extrapolated by a power of the
frequency between 0 and -2, drawn at random (JCGM 101:2008, 6.4).

Runs of one noise share the records that are drawn. Only samples near the extremes of a signal are looked at: where
noise is small they are few, and where it is not, few of each draw can become its extreme for any of the signals.
"""

import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Literal

import numpy as np

from balance.arrays import Floats, Indices
from balance.estimation.estimate import chi_square_tail, f_tail, normal_probability

from ..signal.filters import loaded_loops
from .metrics import Measure, gain_of_record

if TYPE_CHECKING:
    from ..signal.filters import Band

TAPERS = 3
SHORTEST = 24
"""Least samples of a segment [-]."""
LEAST_S = 0.03
"""Least length of a segment [s]."""
DIFFER = 0.01
"""Level at which powers of several segments, or of rest and motion, differ."""
FEWEST_CELLS = 8
"""Of two spectra that are compared cell by cell."""
BROAD = 0.1
"""Share of the power of one, from which what another has more of in the median cell counts: repeats that are not quite
aligned leave a little of their signal.
"""
_STATED = 30.0
"""Degrees of freedom of a cell of a stated spectrum: data sheets are good to a quarter."""
_PRIOR = 1.0
"""Degrees of freedom that a cell has beyond those of its segments: its neighbours are much like it."""
_INDEPENDENT = 2.5
"""Complex amplitudes that a segment shows of noise that is alike all over a cell: 4, less what tapers leave out, and
less where noise comes and goes with the motion (as the square of a sine: two thirds)."""
_NEAR = 7
"""Cells of which the median is what they have in common."""
_MOST_SCATTER = 2.0
"""Of powers of segments: a factor of seven."""
_STEEPEST = 2.0
"""Of the extrapolation: a random walk."""
DRAWS = 400
"""Simulated records of noise: a quantile of 2.5 % is known to 0.8 %."""
FEWEST = 60
"""Of long records."""
_MOST = 8_000_000
"""Samples that are simulated, unless of the fewest draws."""
_REACH = 7.0
"""Standard deviations of noise below the largest value of a signal from which a sample is never the largest."""
_AT_ONCE = 1 << 18
"""Samples that are compared at a time: they stay in the processor's cache."""
_one_draws = threading.Lock()


@dataclass(frozen=True)
class Segment:
    """Part of a record that shows noise alone."""

    values: Floats
    """(n,) [unit]"""
    rate_hz: float
    weight: float = 1.0
    """Share of an independent segment: n residuals of n repeats count for n - 1."""
    _densities: dict[int, Floats] = field(default_factory=dict, init=False, repr=False, compare=False)
    """By size."""

    @property
    def seconds(self) -> float:
        """Its length [s]."""
        return len(self.values) / self.rate_hz

    @property
    def usable(self) -> bool:
        """Whether it is long enough for any spectrum."""
        return len(self.values) >= SHORTEST and self.seconds >= LEAST_S

    def density(self, size: int) -> Floats:
        """One-sided power spectral density at size // 2 + 1 even frequencies, [unit^2/Hz]."""
        if size not in self._densities:
            self._densities[size] = 2.0 * squared_magnitudes(self.spectra(size)).mean(axis=0) / self.rate_hz
        return self._densities[size]

    def spectra(self, size: int) -> np.ndarray:
        """Of each taper at size // 2 + 1 even frequencies, straight line removed, (TAPERS, size // 2 + 1) [unit]."""
        from scipy.fft import rfft

        line = np.linspace(-1.0, 1.0, len(self.values))
        flat = self.values - self.values.mean()
        flat = flat - line * (line @ flat / (line @ line))
        return np.asarray(rfft(flat * tapers(len(flat)), size))


def random_numbers(values: Floats) -> np.random.Generator:
    """Of values (n,) [any unit], seeded by the sum of their squares: the same where they differ by rounding alone."""
    return np.random.default_rng(int(np.float32(np.log(values @ values + 1e-300)).view(np.uint32)))


@lru_cache(maxsize=64)
def tapers(count: int) -> Floats:
    """Sines of one, two and three half periods, each of power one, (3, count) [-]."""
    along = np.pi * np.arange(1, count + 1) / (count + 1)
    first, double = np.sqrt(2.0 / (count + 1)) * np.sin(along), 2.0 * np.cos(along)
    return np.stack([first, double * first, (double**2 - 1.0) * first])


def squared_magnitudes(spectra: np.ndarray) -> Floats:
    """Squares of the magnitudes of spectra (m,) [any unit], (m,) [its square]; ``abs`` takes a root first."""
    return np.asarray(spectra.real**2 + spectra.imag**2)


@dataclass(frozen=True, eq=False)
class Noise:
    """A spectrum in cells that are each known to so many degrees of freedom."""

    frequency: Floats
    """Even, from zero, (m,) [Hz]."""
    density: Floats
    """One-sided, (m,) [unit^2/Hz]."""
    resolution_hz: float
    """Width of a cell."""
    lowest_hz: float
    """Frequency below which the density is extrapolated."""
    freedom: float
    """Degrees of freedom of a cell."""
    scatter: float = 0.0
    """Standard deviation of the logarithm of the power from run to run, beyond chance [-]."""
    freedom_broad: float | None = None
    """Of a cell that is like those about it, so that its power is no narrow mode's; None: as of any other."""

    @classmethod
    def of(cls, segments: Sequence[Segment], least: float = 0.0, longest: int = 0) -> "Noise | None":
        """Pooled over segments of one rate; None where none is usable. ``least`` is a density below which none is.

        Frequencies follow from the longest segment, or from ``longest`` [samples] where that is more: give it where
        several noises are to have the same ones.
        """
        from scipy.fft import next_fast_len

        some = [segment for segment in segments if segment.usable]
        if not some:
            return None
        rate, longest = some[0].rate_hz, max(longest, *(len(segment.values) for segment in some))
        size = next_fast_len(2 * longest, real=True)
        size += size % 2
        frequency = np.arange(size // 2 + 1) * rate / size
        densities = np.array([segment.density(size) for segment in some])
        np.maximum(densities, max(least, 1e-300), out=densities)
        seconds = np.array([segment.seconds for segment in some])
        lowest = 1.0 / float(np.average(seconds, weights=seconds))
        first, weights = int(np.searchsorted(frequency, lowest)), seconds * [segment.weight for segment in some]
        total, density = np.zeros((2, len(frequency)))
        for weight, row, begin in zip(weights, densities, np.searchsorted(frequency, 0.9 / seconds), strict=True):
            known = slice(max(first, int(begin)), None)
            total[known] += weight
            density[known] += weight * row[known]
        density /= np.maximum(total, 1e-300)
        density[:first] = density[first : 2 * first + 1].mean()
        effective = np.sum([segment.weight * segment.seconds for segment in some]) * lowest
        return cls(
            frequency,
            density,
            4.0 * lowest,
            lowest,
            2.0 * float(effective) + _PRIOR,
            _scatter(some, densities, round(4.0 * lowest * size / rate)),
            2.0 * _INDEPENDENT * float(effective) + _PRIOR,
        )

    @classmethod
    def stated(cls, deviation: float, rate_hz: float) -> "Noise | None":
        """White noise of the standard deviation [unit] that a rig states; None of zero."""
        if deviation <= 0.0:
            return None
        frequency = np.linspace(0.0, rate_hz / 2.0, 1025)
        return cls(frequency, np.full_like(frequency, 2.0 * deviation**2 / rate_hz), rate_hz / 50.0, 0.0, _STATED)

    def plus(self, other: "Noise") -> "Noise":
        """Together with another, known as well as this one."""
        return replace(self, density=self.density + other.at(self.frequency))

    def without(self, other: "Noise", least: "Noise") -> "Noise":
        """Its density less that of another, and nowhere below that of ``least``."""
        return replace(self, density=np.maximum(self.density - other.at(self.frequency), least.at(self.frequency)))

    def without_lines(self, errors: "Noise") -> "Noise":
        """Its density less that of errors of lines, which are drawn by themselves, and nowhere lowered below the median
        of the cells about it.
        """
        cell = (self.frequency / self.resolution_hz).astype(int)
        least = np.minimum(self._about(np.bincount(cell, self.density) / np.bincount(cell))[cell], self.density)
        return replace(self, density=np.maximum(self.density - errors.at(self.frequency), least))

    def at(self, frequency: Floats) -> Floats:
        """The density at frequencies (k,) [Hz], (k,) [unit^2/Hz]."""
        return np.interp(frequency, self.frequency, self.density)

    def draws(self, frequency: Floats, gain: Floats, count: int, rng: np.random.Generator) -> Floats:
        """Square roots of densities that the segments allow at rising frequencies (k,) [Hz], times the gain of a band
        there (k,) [-], (count, k) [unit/Hz^0.5].

        The power of a cell is nu / chi squared of what was estimated, on average more than 1; the mean over many cells
        is 1, however, so that a factor takes off as much of the excess as averages out.
        """
        cell = (frequency / self.resolution_hz).astype(int)
        levels = np.sqrt(self.at(frequency)) * gain
        freedoms = self._freedoms(int(cell.max(initial=0)) + 1)
        factors = np.sqrt(freedoms / rng.chisquare(freedoms, (count, len(freedoms))))
        powers = np.bincount(cell, levels**2)
        alone = float((powers**2).sum() / max(float(powers.sum()) ** 2, 1e-300))
        factors /= np.sqrt(1.0 + (1.0 - alone) * 2.0 / (freedoms - 2.0))
        factors *= np.exp(0.5 * self.scatter * rng.standard_normal((count, 1)))
        found = factors.astype(np.float32)[:, cell] * levels.astype(np.float32)
        slopes = np.clip(rng.normal(self._slope, 0.7, (count, 1)), 0.0, _STEEPEST)
        below = int(np.searchsorted(frequency, self.lowest_hz))
        found[:, :below] *= (self.lowest_hz / np.maximum(frequency[:below], 0.1)) ** (0.5 * slopes)
        return np.asarray(found)

    def exceeds(self, other: "Noise", band: "Band | None") -> bool:
        """Whether its power in a band is larger than another's, beyond chance: in all, or in the median cell.

        The sum sees what is in narrow modes, and knows them to few degrees of freedom; what is in all of the band is
        seen beside them by the cells.
        """
        (power, freedom), (below, freedom_below) = self.power(band), other.power(band)
        if power > below and f_tail(power / max(below, 1e-300), freedom, freedom_below) < DIFFER:
            return True
        from scipy.special import digamma, polygamma

        width, lowest = max(self.resolution_hz, other.resolution_hz), max(self.lowest_hz, other.lowest_hz)
        cells = [one._cells(band, lowest, width) for one in (self, other)]
        within = [one[: int(band.high_hz / width)] if band else one for one in cells]
        pairs = np.array([(a, b) for a, b in zip(*within, strict=False) if a > 0.0 and b > 0.0]).reshape(-1, 2)
        if len(pairs) < FEWEST_CELLS or -len(pairs) * np.median(np.diff(pairs)) < BROAD * below:
            return False
        ratios = -np.diff(np.log(pairs))
        half = 0.5 * width * np.array([one.freedom / one.resolution_hz for one in (self, other)])
        expected = float(np.diff(np.log(half) - digamma(half))[0])  # of logarithms of chi squared
        deviation = float(np.sqrt(0.5 * np.pi * polygamma(1, half).sum() / len(ratios)))  # of a median
        return 1.0 - normal_probability((float(np.median(ratios)) - expected) / deviation) < DIFFER

    def power(self, band: "Band | None") -> tuple[float, float]:
        """Mean square of the noise in a band [unit^2], and its degrees of freedom."""
        cells = self._cells(band, self.lowest_hz, self.resolution_hz)
        total = float(cells.sum())
        return total, self.freedom * total**2 / max(float((cells**2).sum()), 1e-300)

    def _cells(self, band: "Band | None", lowest_hz: float, width_hz: float) -> Floats:
        """Mean squares in cells of a width in a band, from a frequency on, (k,) [unit^2]."""
        fine = self.frequency[self.frequency >= lowest_hz]
        gain = band.gain(fine, 2.0 * float(self.frequency[-1]) * 1.0001) if band else np.ones_like(fine)
        cells = np.bincount((fine / width_hz).astype(int), self.at(fine) * gain**2)
        return np.asarray(cells * float(self.frequency[1]))

    def of_modes(self, frequency: Floats, seconds: float, count: int, rng: np.random.Generator) -> Floats:
        """Factors on sizes at rising frequencies (k,) [Hz] of records of so many seconds, (count, k) [-].

        What may be one narrow mode comes and goes, and one record shows more or less of it than another.

        A mode as wide as a cell shows 2 B T of its values, one that outlasts the record two, and how wide it is
        nobody knows: from the one to the other, evenly by its logarithm.
        """
        cell = (frequency / self.resolution_hz).astype(int)
        broad = self._broad(int(cell.max(initial=0)) + 1)
        widest = np.log(max(self.resolution_hz * seconds, 1.0))
        values = 2.0 * np.exp(rng.uniform(0.0, widest, (count, len(broad))))
        powers = broad + (1.0 - broad) * rng.chisquare(values) / values
        return np.asarray(np.sqrt(powers).astype(np.float32)[:, cell])

    def _freedoms(self, count: int) -> Floats:
        """Degrees of freedom of so many cells, (count,)."""
        if self.freedom_broad is None:
            return np.full(count, self.freedom)
        broad = self._broad(count)
        return np.asarray(1.0 / (broad / self.freedom_broad + (1.0 - broad) / self.freedom))

    def _broad(self, count: int) -> Floats:
        """Share of the power of so many cells that the median of those about each has too, (count,) [-]: noise that is
        alike all over it; the rest may be one narrow mode. All of a stated spectrum.
        """
        if self.freedom_broad is None:
            return np.ones(count)
        cell = (self.frequency / self.resolution_hz).astype(int)
        powers = np.bincount(cell, self.density) / np.bincount(cell)
        broad = np.minimum(self._about(powers) / np.maximum(powers, 1e-300), 1.0)
        return np.pad(broad, (0, max(count - len(broad), 0)), "edge")[:count]

    @staticmethod
    def _about(powers: Floats) -> Floats:
        """Median of the cells (k,) about each, (k,)."""
        medians = np.median(np.lib.stride_tricks.sliding_window_view(powers, min(_NEAR, len(powers))), axis=1)
        return np.asarray(medians[np.clip(np.arange(len(powers)) - _NEAR // 2, 0, len(medians) - 1)])

    @cached_property
    def _slope(self) -> float:
        """Likeliest power of the extrapolation: that of the lowest octaves that are resolved."""
        low, high = (self.at(self.lowest_hz * np.linspace(*span, 9)).mean() for span in ((1.0, 2.0), (3.0, 6.0)))
        return float(np.clip(np.log(low / max(high, 1e-300)) / np.log(3.0), 0.0, _STEEPEST))


def _scatter(segments: Sequence[Segment], densities: Floats, cell: int) -> float:
    """By how much the power differs between segments beyond chance, as a standard deviation of its logarithm."""
    if len(segments) < 3:
        return 0.0
    starts = np.arange(0, densities.shape[1], max(cell, 1))
    cells = np.add.reduceat(densities, starts, axis=1)
    powers, mean = cells.sum(axis=1), cells.mean(axis=0)
    freedom = 2.0 * float(mean.sum() ** 2 / (mean**2).sum())
    variance, others = float(np.log(powers).var(ddof=1)), len(segments) - 1.0
    differ = chi_square_tail(0.5 * freedom * variance * others, others) < DIFFER
    return min(max(variance - 2.0 / freedom, 0.0) ** 0.5, _MOST_SCATTER) if differ else 0.0


@dataclass(frozen=True, eq=False)
class Draws:
    """Records of noise in the band, in parts that follow each other."""

    parts: tuple[Floats, ...]
    """(m, draws) each [unit]"""
    powers: Floats
    """Mean square of the noise that each was drawn from, when it is loudest: what runs in one noise share, (draws,)
    [unit^2]."""

    @cached_property
    def mean_squares(self) -> Floats:
        """(draws,) [unit^2]"""
        total = sum(np.einsum("ij,ij->j", part, part) for part in self.parts)
        return np.asarray(total / sum(map(len, self.parts)), dtype=float)

    @cached_property
    def ends(self) -> tuple[Floats, Floats]:
        """Largest and smallest values, (draws,) each [unit]."""
        at_once = max(_AT_ONCE // len(self.powers), 1)
        high, low = np.full((2, len(self.powers)), [[-np.inf], [np.inf]])
        for part in self.parts:
            for first in range(0, len(part), at_once):
                block = part[first : first + at_once]
                high, low = np.maximum(high, block.max(axis=0)), np.minimum(low, block.min(axis=0))
        return high, low

    def times(self, levels: Floats) -> "Draws":
        """The same with every sample times its level, (n, draws) or (n, 1) [-]."""
        loudest = levels.max(axis=0).astype(float)
        return Draws((np.concatenate(self.parts) * levels,), self.powers * loudest**2)

    def with_signals(self, signals: Floats) -> list[tuple[Floats, Floats]]:
        """Each part with that of signals (k, n)."""
        ends = np.cumsum([len(part) for part in self.parts])[:-1]
        return list(zip(self.parts, np.split(signals, ends, axis=1), strict=True))


@dataclass(frozen=True)
class NoiseRecords:
    """Noise and what else is not known of one record; the noise in multiples of ``scale``."""

    draws: Draws
    rounding: Floats
    """What a step that is not dithered adds to a reading, (draws,) [unit, or its square]."""
    scale: float = 1.0

    @property
    def powers(self) -> Floats:
        """Of the noise that each was drawn from, (draws,) [unit^2]."""
        return self.scale**2 * self.draws.powers

    @property
    def mean_squares(self) -> Floats:
        """Of the noise alone, (draws,) [unit^2]."""
        return self.scale**2 * self.draws.mean_squares

    @property
    def ends(self) -> tuple[Floats, Floats]:
        """Largest and smallest values of the noise alone, (draws,) each [unit]."""
        high, low = self.draws.ends
        return self.scale * high, self.scale * low

    def products(self, signal: Floats) -> Floats:
        """Mean of a signal (n,) [-] times each draw, (draws,) [unit]."""
        parts = self.draws.with_signals(signal[None])
        return np.asarray(self.scale * sum(some[0].astype(np.float32) @ part for part, some in parts) / len(signal))

    @property
    def reach(self) -> float:
        """How far below the largest value of a signal a sample is never the largest in noise [unit]."""
        return float(self.scale * _REACH * self.draws.powers.max() ** 0.5)

    def highest(self, samples: Indices, signals: Floats, sign: Literal[1, -1] = 1) -> Floats:
        """Largest value of signals at rising ``samples`` (s,), (k, s) [unit], in each draw times ``sign``, (draws, k)
        [unit]; elsewhere they are lower by ``reach``.
        """
        tops = signals.max(axis=1)
        found = np.full((len(signals), len(self.rounding)), -np.inf, np.float32)
        for noise, at, levels in self._near(samples, signals, tops):
            if loops := loaded_loops():
                loops.raise_highest(noise, at, sign, levels, found)
            else:
                np.maximum(found, (sign * noise[at] + levels[:, :, None]).max(axis=1), out=found)
        return np.asarray(self.scale * found.T + tops)

    def excess(
        self, samples: Indices, signals: Floats, tops: Floats, added: Floats, sign: Literal[1, -1] = 1
    ) -> Floats:
        """Sum of the squares by which signals at rising ``samples`` (s,), (k, s) [unit], in each draw times ``sign``
        with what is ``added`` to it (draws,) [unit], exceed ``tops`` (k,) [unit], (draws, k) [unit^2].
        """
        found, raised = np.zeros((len(signals), len(added))), (added / self.scale).astype(np.float32)
        for noise, at, levels in self._near(samples, signals, tops):
            if loops := loaded_loops():
                loops.add_excess(noise, at, sign, levels, raised, found)
            else:
                above = np.maximum(sign * noise[at] + raised + levels[:, :, None], np.float32(0.0))
                found += np.einsum("kij,kij->kj", above, above)
        return np.asarray(self.scale**2 * found.T)

    def _near(self, samples: Indices, signals: Floats, tops: Floats) -> Iterator[tuple[Floats, Indices, Floats]]:
        """Noise (n, draws), its samples (m,), and there signals (k, m) less ``tops`` (k,), in multiples of the scale,
        in blocks of those ``samples`` in which any may come near its top.
        """
        near = (signals >= tops[:, None] - self.reach).any(axis=0)
        samples, below = samples[near], ((signals[:, near] - tops[:, None]) / self.scale).astype(np.float32)
        first, at_once = 0, max(_AT_ONCE // (len(tops) * len(self.rounding)), 1)
        for part in map(np.ascontiguousarray, self.draws.parts):
            inside = slice(*np.searchsorted(samples, [first, first + len(part)]))
            for begin in range(inside.start, inside.stop, at_once):
                rows = slice(begin, min(begin + at_once, inside.stop))
                yield part, samples[rows] - first, below[:, rows]
            first += len(part)


def noise_draws(noise: Noise, measure: Measure, count: int, rate_hz: float) -> Draws:
    """Draws of ``count`` samples in the band of a measure.

    Records of about the same length share them: of longer ones they take what is next to both ends. What two threads
    ask for at once is drawn once.
    """
    with _one_draws:
        return _shared_draws(noise, measure, count, rate_hz)


@lru_cache(maxsize=2)
def _shared_draws(noise: Noise, measure: Measure, count: int, rate_hz: float) -> Draws:
    coarse = 1 << max(count.bit_length() - 5, 0)
    drawn, powers = _drawn(noise, measure, -(-count // coarse) * coarse, float(f"{rate_hz:.4g}"))
    first, excess = count // 2, len(drawn) - count
    return Draws((drawn[:first], drawn[first + excess :]), powers)


@lru_cache(maxsize=2)
def _drawn(noise: Noise, measure: Measure, count: int, rate_hz: float) -> tuple[Floats, Floats]:
    """Draws (n, draws) and powers (draws,), seeded by the noise: the same noise gives the same draws.

    They are made of cosines at multiples of half a period a record, which are even about both ends, like noise that
    the band's filter mirrors there.
    """
    from scipy.fft import idct

    seconds, number = count / rate_hz, int(np.clip(_MOST // count, FEWEST, DRAWS))
    rng = random_numbers(noise.density)
    gain = gain_of_record(measure, count, seconds)
    used = int(np.flatnonzero(gain > 1e-3)[-1]) + 1
    sizes = noise.draws(np.arange(used) / (2.0 * seconds), gain[:used], number, rng) / np.float32(seconds**0.5)
    sizes[:, 0] = 0.0
    powers = 0.5 * np.einsum("ij,ij->i", sizes, sizes).astype(float)
    sizes *= noise.of_modes(np.arange(used) / (2.0 * seconds), seconds, number, rng)
    sizes *= rng.standard_normal(sizes.shape, dtype=np.float32)
    sizes *= np.float32((count / 2.0) ** 0.5)
    return np.ascontiguousarray(idct(sizes, n=count, norm="ortho").T), powers
