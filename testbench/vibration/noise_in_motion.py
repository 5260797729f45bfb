"""Noise in motion where no run is repeated: what of one side of a condition is no smooth multiple of the other.

Both sides follow one command on one base. Within a narrow band, what the mechanism causes along one axis on one side is
a smooth complex multiple of what it causes on the other, along all axes, and what is left is noise of both (local
polynomial method: Pintelon, Schoukens, Vandersteen and Barbe, Mech. Syst. Signal Process. 24, 573, 2010; here of sine
tapers). Where a mode or the course of a force differs within the band more is left. Noise is taken to be broadband, so
that the lower quartile of the bands about a frequency counts.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from balance.arrays import Floats

from .amplitude import Amplitude
from .noise_floor import TAPERS, Noise, Segment, tapers
from .noise_over_time import NoiseOverTime

WIDTH_HZ = 30.0
"""Of a band; the next begins a third later."""
FIRST = 2
"""Frequencies, multiples of one over the motion, that are left out: they hold what is slow."""
_TERMS = 2
"""Complex multiple and its slope."""
_NEAR = 7
"""Bands about a frequency, or next to it at the ends."""
_QUARTILE = 0.25
_APART_S = 0.13
"""By how much ends of two motions may be wrong that a record does not show the beginning of."""
_STEPS_S = (0.008, 0.001)
"""In which their lag is sought, then about the best."""
_SEEN = 0.75
"""Share of noise of 30 to 150 Hz width that is so found, median (Monte Carlo)."""
LOUDER = 3.0
"""Times the power at rest from which there is noise in motion: without any, no more is found in nine of ten channels
(Monte Carlo), where forces of another course are small.
"""
_SCATTER = 0.4
"""Standard deviation of the logarithm of the power so found (Monte Carlo: 0.5 to 1.4 of what it is)."""


def noise_in_motion(at_rest: Noise, side: Amplitude, others: Sequence[Amplitude]) -> tuple[Noise, NoiseOverTime] | None:
    """At least the noise at rest, and what one side's motion shows beyond it and beyond all axes of the other side;
    and how that goes over time.

    None where the sides cannot be compared.
    """
    if max(abs(other.rate_hz / side.rate_hz - 1.0) for other in others) > 1e-4:
        return None
    begin, segments = _together(side, others)
    if not segments[0].usable:
        return None
    centres, densities, left = _left(segments[0], segments[1:])
    firsts = np.clip(np.arange(len(centres)) - _NEAR // 2, 0, max(len(centres) - _NEAR, 0))
    calm = [np.exp(np.quantile(np.log(densities[i : i + _NEAR]), _QUARTILE)) / _SEEN for i in firsts]
    density = np.maximum(at_rest.density, np.interp(at_rest.frequency, centres, calm))
    moving, count = side.moving or slice(0, len(side.whole)), len(segments[0].values)
    known = slice(begin, begin + count)
    evened = _over_time(left * np.minimum(np.array(calm) / densities, 1.0)[:, None, None] ** 0.5, count)
    louder, band = replace(at_rest, density=density, scatter=max(at_rest.scatter, _SCATTER)), side.measure.band
    resting = at_rest.power(band)[0] / max(louder.power(band)[0], 1e-300)
    shown = side.in_band(evened)[None]
    return louder, NoiseOverTime.of(shown, 1.0, known, moving, len(side.course), side.rate_hz, resting)


def exceeds_rest(at_rest: Noise, side: Amplitude, length: int) -> bool:
    """Whether any part of a record, of so many samples, has more power than the noise at rest, whatever it is."""
    length = min(length, len(side.whole))
    starts = np.linspace(0, len(side.whole) - length, 2 * len(side.whole) // max(length, 1)).astype(int)
    parts = [Noise.of([Segment(side.whole[at : at + length], side.rate_hz)]) for at in starts]
    return any(one is not None and one.exceeds(at_rest, side.measure.band) for one in parts)


def _together(side: Amplitude, others: Sequence[Amplitude]) -> tuple[int, list[Segment]]:
    """The part of the motion that both sides show, and its first sample in the record of the one side.

    Records that begin in motion are shifted to where least is left, near where their motions end together.
    """
    own, other = (run.moving or slice(0, len(run.whole)) for run in (side, others[0]))

    def part(lag: int) -> tuple[int, list[Segment]]:
        first = max(own.start, other.start + lag)
        count = max(min(own.stop, other.stop + lag) - first, 0)
        begins = [first, *(first - lag for _ in others)]
        runs = zip((side, *others), begins, strict=True)
        return first, [Segment(run.whole[begin : begin + count], side.rate_hz) for run, begin in runs]

    def left(lag: int) -> float:
        segments = part(lag)[1]
        return float(np.log(_left(segments[0], segments[1:])[1]).mean()) if segments[0].usable else np.inf

    if (own.start and other.start) or (side.moving is others[0].moving is None):
        return part(own.start - other.start)
    lag, reach = own.stop - other.stop, _APART_S
    for seconds in _STEPS_S:
        step = max(round(seconds * side.rate_hz), 1)
        lag = min(range(lag - round(reach * side.rate_hz), lag + round(reach * side.rate_hz) + 1, step), key=left)
        reach = seconds
    return part(lag)


def _left(one: Segment, others: Sequence[Segment]) -> tuple[Floats, Floats, np.ndarray]:
    """Centres (k,) [Hz] of bands, the density in them [unit^2/Hz] of what of a segment is no smooth multiple of others
    of its length, and the spectra of that in the middle third of each band, by taper, (k, TAPERS, third).
    """
    count, terms = len(one.values), _TERMS * len(others)
    wide = max(round(WIDTH_HZ * one.seconds), terms + 4)
    third = max(wide // 3, 1)
    bands = np.arange(FIRST, count // 2 + 1 - wide, third)[:, None] + np.arange(wide)
    slopes = np.linspace(-1.0, 1.0, wide)[:, None] ** np.arange(_TERMS)
    given = [other.spectra(count)[:, bands].transpose(1, 0, 2)[..., None] * slopes for other in others]
    rows = len(bands), TAPERS * wide
    basis = np.linalg.qr(np.concatenate(given, axis=-1).reshape(*rows, terms))[0]
    wanted = one.spectra(count)[:, bands].transpose(1, 0, 2).reshape(*rows, 1)
    left = wanted - basis @ (basis.conj().swapaxes(1, 2) @ wanted)
    freedom = rows[1] * (1.0 - terms / wide)
    densities = 2.0 * (np.abs(left) ** 2).sum(axis=(1, 2)) / freedom / one.rate_hz
    return bands.mean(axis=1) / one.seconds, densities, left.reshape(len(bands), TAPERS, wide)[..., third : 2 * third]


def _over_time(left: np.ndarray, count: int) -> Floats:
    """Of spectra in thirds of bands that follow each other (k, TAPERS, third), the course without tapers, (count,)."""
    spectra = np.zeros((TAPERS, count // 2 + 1), dtype=complex)
    joined, third = left.transpose(1, 0, 2).reshape(TAPERS, -1), left.shape[2]
    spectra[:, FIRST + third : FIRST + third + joined.shape[1]] = joined
    given = tapers(count)
    weight = (given**2).sum(axis=0)
    return np.asarray((np.fft.irfft(spectra, count) * given).sum(axis=0) / np.maximum(weight, 0.1 * weight.max()))
