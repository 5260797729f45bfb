"""Repeats of a condition: how they are aligned, what does not repeat between them, and by how much runs differ.

Runs of one condition follow one command. Aligned by their own correlation, what they share is vibration that the
mechanism causes, and what they do not share is noise as it is in motion. Whether amplitudes of runs differ beyond that
noise is tested over all groups of repeats of a campaign; only where they do is a share of the amplitude added to the
variance (two components: Rocke and Lorenzato, Technometrics 37, 176, 1995; pooled over conditions: JCGM 100:2008,
4.2.4), and the repeat that differs is named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from balance.arrays import Floats, parabola_peak
from balance.estimation.estimate import chi_square_tail, coverage_factor, f_tail

from .amplitude import SAME_RATE, Amplitude, Place, shifted, with_shifts
from .amplitude_likelihood import AmplitudeLikelihood
from .noise_floor import Noise, Segment, squared_magnitudes
from .noise_over_time import NoiseOverTime

DIFFER = 0.01
"""Level at which repeats differ beyond noise, over a campaign: half of it by one group, half by all together."""
SAMPLING_SHARE = {True: 0.02, False: 0.005}
"""Share of the amplitude by which repeats may differ: an RMS by where the record begins and ends, a peak by the
instants of samples about it."""
GAIN_SHARE = 0.002
"""Share by which repeats may differ in how much of their mean they show, where all of them reach."""
SURE = 0.2
"""Error of that share by noise from which it says nothing."""
CLEAR = 0.25
"""Of what noise does, from which what repeats may differ by counts."""
EDGE = 8
"""Samples next to an end of another repeat's record, which shifting it spoils."""
KNOWN = 1.0
"""Of an amplitude, from which its repeats' interval, where they differ beyond noise, reaches zero and says nothing."""
UNLIKE = 0.2**2
"""Power of what repeats do not share over that of what they do, from which they may be no repeats of one condition."""
LOUDER = 10.0
"""Times the lower quartile of all sides, from which that power is no noise of the campaign."""
REVERSED = 0.9
"""Correlation of a channel with its own reversed in another run, from which, if none is larger, one is reversed."""
CERTAIN = 0.9
"""Correlation of two repeats from which they are shifted to match whenever their motions begin: a mode of the floor
that two short records show is as like itself at some shift, up to less."""
LEAST_CORRELATION = 0.5
"""From which they are shifted to match about where their motions begin: below it noise is more than what repeats."""
STANDS_OUT = 0.7
"""Share of the largest correlation, below which all others are, away from it, that it is of what repeats alone."""
BEGINS_S = {True: 0.003, False: 0.06}
"""To which it is known when a motion begins, by whether command or encoders tell it [s]."""
CLOCKS_S = 0.006
"""By how much more two beginnings may differ that loggers with other clocks tell, each to 3 ms [s]."""
_SLOW = 0.2
"""Of a step, by which a signal changes from sample to sample, up to which samples of repeats lie on one plateau."""
_NEIGHBOURS = 15
"""Frequencies, of records twice as long, whose power is averaged."""


@dataclass(frozen=True, eq=False)
class Group:
    """One run, or repeats, of one condition, with or without counter-masses."""

    runs: tuple[AmplitudeLikelihood, ...]
    names: tuple[str, ...] = ()
    """Names of the runs."""
    gains: Floats | None = None
    """By what share each run shows more of the mean's course than the mean, (n,) [-]; none where not aligned."""
    gain_error: float = np.inf
    """Standard deviation of each by noise [-]."""

    @cached_property
    def amplitude(self) -> float:
        """Mean of the runs' amplitudes; where noise is not :attr:`clear`, the amplitude that would read as much as they
        do on average, zero where noise alone does [unit].
        """
        return float(np.mean([run.amplitude for run in self.runs])) if self.clear else self._alike

    @cached_property
    def shares(self) -> Floats:
        """Amplitude of each run over that of the group, (n,) [-]: one where noise does not tell them apart.

        By ends of records and instants of samples runs may differ by hundreds of standard deviations of the noise. Each
        is as much larger as the others are smaller, then, however large its own noise is estimated to be.
        """
        return np.array([run.amplitude / self.amplitude if self.clear else 1.0 for run in self.runs])

    @cached_property
    def _alike(self) -> float:
        """The amplitude of runs of one amplitude [unit]."""
        tried = np.unique(np.concatenate([run.amplitudes for run in self.runs]))
        above = np.minimum.accumulate(self.deviations(tried).sum(axis=0))
        return float(np.interp(0.0, above[::-1], tried[::-1]))

    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom of the scatter."""
        return len(self.runs) - 1

    @cached_property
    def common(self) -> float:
        """Share of the noise's variance that the runs have in common."""
        return float(np.mean([run.common for run in self.runs]))

    @cached_property
    def rounded(self) -> float:
        """Share of the variance that a step adds."""
        return float(np.mean([run.rounded for run in self.runs]))

    @cached_property
    def _witness(self) -> tuple[Floats, float, float]:
        """What shows whether runs differ: deviations (n,) from their mean and the variance of what makes no repeat
        differ, in variances of the noise of one of them, and the amplitude in standard deviations of it.

        What share of its signal each run shows where all of them reach; the readings, which also differ by where a
        record begins and ends and what slope is taken off it, where noise leaves nothing of that.
        """
        if self.gains is not None and self.gain_error < SURE:
            return self.gains / self.gain_error, 1.0 + (GAIN_SHARE / self.gain_error) ** 2, 1.0 / self.gain_error
        away = self.deviations(np.array([self._alike]))[:, 0]
        sure = SAMPLING_SHARE[self.runs[0].statistic.squared] * self.signal_to_noise
        return away - away.mean(), max(1.0 - self.common, 0.05) + sure**2, self.signal_to_noise

    @cached_property
    def scatter(self) -> float:
        """Sum of squares of the runs about their mean [variances of what each run has of its own]."""
        return float((self._witness[0] ** 2).sum()) / self.own

    @property
    def own(self) -> float:
        """Variance of what each run has of its own: noise, and what makes no repeat differ [variances of noise]."""
        return self._witness[1]

    @property
    def weight(self) -> float:
        """Square of the amplitude in standard deviations of the noise of what shows whether runs differ [-]."""
        return self._witness[2] ** 2

    @cached_property
    def odd(self) -> str:
        """Name of the run that differs most from the mean."""
        return self.names[int(np.argmax(np.abs(self._witness[0])))] if self.names else ""

    @cached_property
    def signal_to_noise(self) -> float:
        """The amplitude in standard deviations of the noise [-]."""
        return float(np.sqrt(np.mean([run.signal_to_noise(self._alike) ** 2 for run in self.runs])))

    @property
    def clear(self) -> bool:
        """Whether noise is so small that ends of records and instants of samples are no smaller than it."""
        return SAMPLING_SHARE[self.runs[0].statistic.squared] * self.signal_to_noise > CLEAR

    def deviations(self, amplitudes: Floats) -> Floats:
        """Of each run from amplitudes (k,) [unit], (n, k) [standard deviations of noise]."""
        return np.array([run.deviation(amplitudes) for run in self.runs])


@dataclass(frozen=True)
class Repeatability:
    """By what share of the amplitude the runs of a campaign differ beyond noise; zero where they do not."""

    share: float = 0.0
    """Square of the share [-]."""
    degrees_of_freedom: float = np.inf
    outlying: tuple[Group, ...] = ()
    """Groups that scatter more than the others, and by more than noise."""
    apart: tuple[Group, ...] = ()
    """Those of them that do so by more than the share: their own scatter counts."""
    rounding_in_common: float = 1.0
    """Share of what a step adds that repeats have in common [-]."""

    @classmethod
    def of(cls, groups: Sequence[Group], rounding_in_common: float = 1.0) -> "Repeatability":
        """From all groups of one place."""
        repeated = [group for group in groups if group.degrees_of_freedom]
        if not repeated:
            return cls(rounding_in_common=rounding_in_common)
        share, freedom = 0.0, np.inf
        least = 0.5 * DIFFER / len(repeated)
        odd = [g for g in repeated if chi_square_tail(g.scatter, g.degrees_of_freedom) < least]
        apart = odd
        if _differ(repeated) and (len(odd) > 1 or len(repeated) < 3 or not odd):
            unlike = _unlike_the_others(repeated, least)
            consistent = [g for g in repeated if g not in unlike]
            if _differ(consistent):
                share, freedom = max(_share(consistent), 0.0), float(sum(g.degrees_of_freedom for g in consistent))
                odd, apart = [g for g in consistent if g.scatter > g.degrees_of_freedom] + unlike, unlike
            else:
                odd = apart = [g for g in repeated if g in odd or g in unlike]
        return cls(share, freedom, tuple(odd), tuple(apart), rounding_in_common)

    def variance(self, group: Group) -> float:
        """Of the mean of a group [variances of the noise of one run]."""
        share = max(_share([group]), 0.0) if _contains(self.apart, group) else self.share
        common = group.common + self.rounding_in_common * group.rounded
        return common + (1.0 - common + share * group.signal_to_noise**2) / len(group.runs)

    def degrees_of_freedom_of(self, group: Group) -> float:
        """Degrees of freedom of that variance: infinite where the noise alone makes it."""
        if _contains(self.apart, group):
            return float(group.degrees_of_freedom)
        return self.degrees_of_freedom

    def withholds(self, group: Group) -> bool:
        """Whether a group's repeats differ, and by so much that Student's interval hardly bounds their mean."""
        half = coverage_factor(self.degrees_of_freedom_of(group)) * self.variance(group) ** 0.5
        return self.excludes(group) and half > KNOWN * group.signal_to_noise

    def excludes(self, group: Group) -> bool:
        """Whether a group's repeats differ."""
        return _contains(self.outlying, group)


def _contains(groups: Sequence[Group], group: Group) -> bool:
    return any(group is other or (bool(group.names) and group.names == other.names) for other in groups)


def _differ(groups: Sequence[Group]) -> bool:
    """Whether repeats differ beyond noise, all groups taken together."""
    return chi_square_tail(sum(g.scatter for g in groups), sum(g.degrees_of_freedom for g in groups)) < 0.5 * DIFFER


def _share(groups: Sequence[Group]) -> float:
    """Square of the share of the amplitude by which repeats differ beyond noise; below zero where noise does more."""
    away = sum(g.degrees_of_freedom * g.weight for g in groups)
    return sum((g.scatter - g.degrees_of_freedom) * g.own for g in groups) / max(away, 1e-300)


def _unlike_the_others(groups: Sequence[Group], least: float) -> list[Group]:
    """As many groups, up to half, as can be of which each differs by a larger share than all others can together, by
    Fisher's F; the first differs most. Two do not hide each other: exchanged logs spoil both sides that they are of.
    """
    typical = max(_share(groups), 0.0)
    ranked = sorted(groups, key=lambda g: g.scatter * g.own / g.degrees_of_freedom / (g.own + typical * g.weight))
    for count in range(len(ranked) // 2, 0, -1):
        one, others = ranked[-count], ranked[:-count]
        freedom, amount = sum(g.degrees_of_freedom for g in others), sum(g.scatter * g.own for g in others)
        below = max(amount, sum(g.degrees_of_freedom * g.own for g in others))
        below /= max(sum(g.degrees_of_freedom * g.weight for g in others), 1e-300)
        above = one.scatter * one.own / one.degrees_of_freedom / (one.own + below * one.weight)
        if f_tail(above, one.degrees_of_freedom, freedom) < least / count:
            return ranked[: -count - 1 : -1]
    return []


@dataclass(frozen=True)
class AlignedPlace:
    """One channel in aligned repeats of one side: their mean, and what does not repeat."""

    mean: Amplitude
    residuals: tuple[Segment, ...]
    """In motion, each divided by its envelope, of the power in the band that they have there."""
    over_time: NoiseOverTime
    """How what does not repeat goes over the time of the first run."""
    gains: Floats
    """By what share of it each run shows more of the mean than the mean itself, where all of them reach, (k,) [-]."""
    weights: Floats
    """What a gain is the sum of a record times, (n,) [1/unit]: the mean's course, less what is like its shifts."""
    unshared: tuple[float, float]
    """Mean squares in the band, in motion: of what repeats do not share, and of their mean [unit^2]."""
    plateaus: tuple[float, float] | None
    """Mean squares in the band, where the mean changes so slowly that all repeats would lie on one plateau of a step
    that is not dithered: of what repeats do not share, and of what rounding at other zeros makes [unit^2]. None where
    there is no such plateau.
    """

    @classmethod
    def of(cls, runs: Sequence[Amplitude], whole: Floats, lags: Sequence[float]) -> "AlignedPlace | None":
        """From repeats, the whole record of each moved to the first, (k, n) [unit]; None where too little is common."""
        first, (number, count) = runs[0], whole.shape
        at, lengths = np.arange(count) + np.array(lags)[:, None], np.array([[len(run.course)] for run in runs])
        held = (at >= 0.0) & (at <= lengths - 1.0)
        shared = np.flatnonzero(held.all(axis=0))
        if len(shared) <= 2 * EDGE:
            return None
        nearly = (at > -1.0) & (at < lengths)  # within a sample, of which there is one at each end
        fewer = None if nearly.all() else np.sqrt(number / held.sum(axis=0))
        common = slice(int(shared[0]) + EDGE * (shared[0] > 0), int(shared[-1]) + 1 - EDGE * (shared[-1] < count - 1))
        mean = (whole * held).sum(axis=0) / held.sum(axis=0)
        felt = first.in_band(mean)
        basis, apart = with_shifts(felt)[common], (whole - mean).T[common]
        inverse = np.linalg.pinv(basis)
        left, gains = (apart - basis @ (inverse @ apart)).T, inverse[0] @ apart
        weights = np.pad(inverse[0], (common.start, count - common.stop))
        scale = (number / (number - 1.0)) ** 0.5
        rate, moving = first.rate_hz, first.moving or slice(0, count)
        part = slice(max(moving.start - common.start, 0), max(moving.stop - common.start, 0))
        shown = scale * first.in_band(left)
        course = NoiseOverTime.of(shown, number - 1.0, common, moving, count, rate)
        over_time = course.power[common] ** 0.5
        evened = float(np.mean((shown / over_time)[:, part] ** 2))  # less: the envelope follows the noise itself
        unshared = float(np.mean(shown[:, part] ** 2)), float(np.mean(felt[common][part] ** 2))
        level = scale * np.sqrt(unshared[0] / max(evened, 1e-300))
        residuals = tuple(Segment((level * one / over_time)[part], rate, 1.0 / scale**2) for one in left)
        plateaus = None
        slow = np.abs(np.gradient(mean))[common] * rate < _SLOW * first.step * first.logger_hz
        slow[: part.start], slow[part.stop :] = False, False
        made = [
            np.interp(late[common], np.arange(len(run.plateaus)), run.plateaus)
            for run, late in zip(runs, at, strict=True)
            if run.plateaus is not None
        ]
        if slow.any() and len(made) == number:
            steps = first.in_band(np.array(made))[:, slow]
            plateaus = float(np.mean(shown[:, slow] ** 2)), float(np.mean(steps**2))
        together = replace(first.mean_of(runs, lags, mean, felt), envelope=fewer)
        return cls(together, residuals, course, gains, weights, unshared, plateaus)


@dataclass(frozen=True)
class Synchronous:
    """Repeats of one side, aligned."""

    places: dict[Place, AlignedPlace]
    lags: tuple[float, ...]
    """By how much later each run shows what the first shows [samples]."""

    @classmethod
    def of(cls, runs: Sequence[dict[Place, Amplitude]]) -> "Synchronous | None":
        """From repeats; None of a single run, of records whose rates differ, or where nothing tells how they align."""
        places = list(runs[0])
        rates = [run[places[0]].rate_hz for run in runs]
        if len(runs) < 2 or max(rates) - min(rates) > SAME_RATE * max(rates):
            return None
        count = min(len(run[places[0]].course) for run in runs)
        aligned = _lags(runs, places, count)
        if aligned is None:
            return None
        lags, signs = aligned
        moved = [
            _moved([run[place].whole for place in places], lag, count) for run, lag in zip(runs, lags, strict=True)
        ]
        found = {}
        for i, (place, turned) in enumerate(zip(places, signs.T, strict=True)):
            whole = turned[:, None] * [records[i] for records in moved]
            one = AlignedPlace.of([run[place] for run in runs], whole, lags)
            if one is None:
                return None
            found[place] = one
        return cls(found, tuple(lags))


def unlike(aligned: Sequence["Synchronous | None"]) -> list[bool]:
    """Of repeats of each side, whether they are no repeats of one condition, for all that they show.

    What they do not share is then much beside what they share, and beside what the other sides do not share: logs that
    are exchanged, or a run of another condition. Loud noise is alike on all sides; what goes with the vibration, as
    friction does, is little beside it.
    """
    found = [False] * len(aligned)
    for place in dict.fromkeys(place for one in aligned if one for place in one.places):
        left, shared = np.array([one.places[place].unshared if one else (np.nan, np.nan) for one in aligned]).T
        usual = np.exp(np.nanquantile(np.log(np.maximum(left, 1e-300)), 0.25))
        found = [*np.logical_or(found, (left > LOUDER * usual) & (left > UNLIKE * shared))]
    return found


def _moved(records: Sequence[Floats], lag: float, count: int) -> Sequence[Floats]:
    """Each record (m,) moved; at once where they are of one length."""
    same = len({len(values) for values in records}) == 1
    return list(shifted(np.array(records), lag, count)) if same else [shifted(values, lag, count) for values in records]


def gain_error(mean: Amplitude, weights: Floats, noise: Noise) -> float:
    """Standard deviation of how much more of a mean of repeats one run shows, by its noise and its steps [-].

    ``weights`` (n,) [1/unit]: what the gain is the sum of a record times.
    """
    spectrum = np.fft.rfft(weights if mean.over_time is None else weights * mean.over_time.power**0.5)
    density = noise.at(np.arange(len(spectrum)) * mean.rate_hz / len(weights))
    by_noise = float(np.sum(density * np.abs(spectrum) ** 2)) * mean.rate_hz / len(weights)
    return float(np.hypot(by_noise**0.5, mean.rounding_gain))


def _lags(
    runs: Sequence[dict[Place, Amplitude]], places: Sequence[Place], count: int
) -> tuple[list[float], Floats] | None:
    """By how many samples each run shows later what the first shows, and the sign with which it shows that of each
    place, (runs, places): a channel may be reversed.

    None where it is not known of one: it is little like the first, and when its motion begins is not known, or known by
    what is felt alone, which noise may hide for long. To shift it until noise is most like noise would call noise what
    repeats.
    """
    size = 2 * count
    spectra, energies = [], []
    for run in runs:
        rows = np.array([run[place].course[:count] for place in places])
        spectra.append(np.fft.rfft(rows, size, axis=1))
        energies.append((rows**2).sum(axis=1))
    firsts = [run[places[0]] for run in runs]
    begins = [None if one.moving is None else one.moving.start for one in firsts]
    timed = all(one.timed for one in firsts)
    near = round(BEGINS_S[timed] * firsts[0].rate_hz) + 1
    lags, signs = [0.0], np.ones((len(runs), len(places)))
    still = [np.array([_is_still(run[place]) for place in places]) for run in runs]
    each_run = zip(signs[1:], spectra[1:], energies[1:], begins[1:], still[1:], strict=True)
    for turned, spectrum, own, begin, still_here in each_run:
        each = np.fft.irfft(spectrum * np.conj(spectra[0]), size)
        shifts = np.arange(size)
        if known := timed and begin is not None and begins[0] is not None:
            about, reach = begin - begins[0], near + round(CLOCKS_S * firsts[0].rate_hz)
            shifts = np.arange(about - reach, about + reach + 1)
        least, most = -each[:, shifts % size].min(axis=1), each[:, shifts % size].max(axis=1)
        turned[(least > most) & (least > REVERSED * np.sqrt(own * energies[0])) & still[0] & still_here] = -1.0
        both, energy = turned @ each, np.sqrt(own.sum() * energies[0].sum())
        best = int(np.argmax(both))
        certain = both[best] >= CERTAIN * energy and (not known or best in shifts % size)
        if not certain and (timed or not _stands_out(both, best, energy)):
            if begin is None or begins[0] is None:
                return None
            later = begin - begins[0]
            shifts = np.arange(later - near, later + near + 1)
            best = int(shifts[np.argmax(both[shifts % size])] % size)
            if both[best] < LEAST_CORRELATION * energy:
                if not timed:
                    return None
                lags.append(float(later))
                continue
            if timed:
                both = _likelihood(turned[:, None] * spectrum, spectra[0], later)
                both[shifts % size] -= 0.5 * ((shifts - later) / (0.5 * near)) ** 2
                best = int(shifts[np.argmax(both[shifts % size])] % size)
        lag = best + parabola_peak(both, best, periodic=True)[0]
        lags.append(lag - size if lag > count else lag)
    return lags, signs


def _is_still(run: Amplitude) -> bool:
    """Whether little of what a record shows is there at rest: a tone, half a period later, is no reversed channel."""
    if run.rest is None or run.moving is None or run.rest.stop <= run.rest.start:
        return True
    at_rest, moving = (float(np.mean(run.course[part] ** 2)) for part in (run.rest, run.moving))
    return at_rest < (1.0 - REVERSED) * moving


def _stands_out(both: Floats, best: int, energy: float) -> bool:
    """Whether the largest of correlations by lag (n,) is more than noise makes, and none away from it is near it: a
    mode of the floor is as much like itself a period away.
    """
    middle = len(both) // 2
    around = np.roll(both, middle - best)
    swung = np.flatnonzero(around <= 0.0)
    last, first = swung[swung < middle].max(initial=0), swung[swung > middle].min(initial=len(both))
    away = max(around[:last].max(initial=0.0), around[first:].max(initial=0.0))
    return bool(both[best] > LEAST_CORRELATION * energy and away < STANDS_OUT * both[best])


def _likelihood(spectra: np.ndarray, firsts: np.ndarray, about: int) -> Floats:
    """Logarithm of the likelihood of each lag of a run behind another, but for a constant, (2 (k - 1),) [-].

    ``spectra`` and ``firsts`` (places, k) are those of the run and of the other; where the run is shifted back by the
    lag ``about`` [samples], what still differs is the noise. Frequencies count by what they tell (Knapp and Carter,
    IEEE Trans. Acoust. Speech Signal Process. 24, 320, 1976): a mode of the floor that is like itself at several shifts
    tells little.
    """
    size = 2 * (spectra.shape[1] - 1)
    turned = spectra * np.exp(2j * np.pi * about * np.arange(spectra.shape[1]) / size)
    apart = squared_magnitudes(turned - firsts)
    smooth = np.array([np.convolve(row, np.full(_NEIGHBOURS, 1.0 / _NEIGHBOURS), "same") for row in apart])
    weighted = spectra * np.conj(firsts) / np.maximum(smooth, 1e-12 * smooth.max())
    return np.asarray(0.5 * size * np.fft.irfft(weighted, size).sum(axis=0))
