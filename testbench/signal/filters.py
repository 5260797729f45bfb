"""Zero-phase band filters of sampled signals, and the lag between two records.

A Butterworth filter is run forwards and backwards, as ``scipy.signal.sosfiltfilt`` does with even extension, and agrees
with it to rounding. A recursion waits for its own last result at every sample; long records are therefore filtered four
channels side by side, by compiled loops in two threads.
"""

import re
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from types import ModuleType

import numpy as np

from balance.arrays import Floats, parabola_peak
from balance.compiled_kernels import can_compile

from ..errors import AnalysisError

ORDER = 4
"""Of the Butterworth filters; run forwards and backwards, so that the phase is zero and the order twice that."""
MIRRORED_PERIODS = 4.0
"""Periods of the band's slowest edge for which a record is mirrored at its ends (even extension). With the usual odd
extension the first and last sample would pass unfiltered, and with them noise of all frequencies in every peak."""
IDENTITY_SECTION = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
"""A second-order section that passes its input unchanged."""
LANES = 4
"""Channels filtered side by side."""
COMPILED_FROM_SAMPLES = 1 << 17
"""Samples from which on the compiled loops pay for their import, in a campaign of many runs."""
THREADED_FROM_SAMPLES = 1 << 22
"""Samples from which on a second thread pays."""
LARGEST_BUFFER = 1 << 19
"""Samples of a channel up to which a thread keeps its buffer, 16 MB."""
_buffers = threading.local()


@dataclass(frozen=True)
class Band:
    """Frequencies that are kept, by a zero-phase Butterworth filter. A low end of zero keeps all that is slow.

    >>> import testbench
    >>> str(testbench.Band(1.0, 100.0))
    '1..100 Hz'
    """

    low_hz: float
    high_hz: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.low_hz < self.high_hz < np.inf:
            raise AnalysisError(f"band {self}: expected 0 <= low < high")

    def limits(self) -> list[float]:
        """Both ends [Hz]."""
        return [self.low_hz, self.high_hz]

    def __str__(self) -> str:
        return f"{self.low_hz:g}..{self.high_hz:g} Hz"

    def filtered(self, values: Floats, rate_hz: float, in_place: bool = False) -> Floats:
        """The part of signals (..., n) [any unit] that lies in the band, (..., n); ``in_place`` overwrites them.

        Raises AnalysisError where the rate does not hold the band, or the record is too short.
        """
        sos = self._sections(rate_hz)
        if values.shape[-1] <= 6 * len(sos) + 3:
            raise AnalysisError(
                f"{values.shape[-1]} samples are too few for a filter: expected a longer record, or no band"
            )
        settled = round(MIRRORED_PERIODS * rate_hz / (self.low_hz or self.high_hz))
        length = min(max(settled, 6 * len(sos) + 3), values.shape[-1] - 1)
        rows = values.reshape(-1, values.shape[-1])
        return zero_phase(sos, rows, length, rows if in_place else None).reshape(values.shape)

    def gain(self, frequency: Floats, rate_hz: float) -> Floats:
        """Factor on an amplitude at each frequency (n,) [Hz], (n,) [-]: |H|^2, since the filter runs both ways."""
        from scipy.signal import sosfreqz

        within = np.minimum(frequency, rate_hz / 2.0)
        return np.abs(sosfreqz(self._sections(rate_hz), within, fs=rate_hz)[1]) ** 2

    def _sections(self, rate_hz: float) -> Floats:
        """Raises AnalysisError where the rate does not hold the band."""
        if not self.high_hz < rate_hz / 2.0:
            raise AnalysisError(
                f"band {self} needs more than {2 * self.high_hz:g} samples a second, the record has {rate_hz:g}: "
                "name a lower band, or none"
            )
        return _designed(self, rate_hz)


def band_of(text: str) -> Band | None:
    """``1..200`` or ``..200`` in Hz as a band, ``none`` as None. Raises AnalysisError for another text."""
    number = r"(\d+\.?\d*)"
    match = re.fullmatch(rf"{number}?\s*\.\.\s*{number}\s*(?:Hz)?", text.strip())
    if match is None and text != "none":
        raise AnalysisError(f"{text!r}: expected two frequencies in Hz such as 1..200, or none")
    return match and Band(float(match[1] or 0.0), float(match[2]))


@lru_cache(maxsize=64)
def _designed(band: Band, rate_hz: float) -> Floats:
    """Second-order sections of a band (s, 6) at a rate."""
    from scipy.signal import butter

    if band.low_hz > 0.0:
        return np.asarray(butter(ORDER, (band.low_hz, band.high_hz), "bandpass", fs=rate_hz, output="sos"))
    return np.asarray(butter(ORDER, band.high_hz, "lowpass", fs=rate_hz, output="sos"))


def without_mean(values: Floats) -> Floats:
    """A signal (n,) [any unit] less its mean over the whole record."""
    return values - values.mean()


def correlation_lag(late: Floats, early: Floats, rate_hz: float) -> float:
    """How much later ``late`` (n,) shows what ``early`` (m,) shows [s]: the peak of their correlation.

    A parabola through the peak and its neighbours gives the place between samples; units do not matter.
    """
    from scipy.signal import correlate, correlation_lags

    both = correlate(without_mean(late), without_mean(early))
    k = int(np.argmax(both))
    return (float(correlation_lags(len(late), len(early))[k]) + parabola_peak(both, k)[0]) / rate_hz


@dataclass(frozen=True)
class CorrelationPeak:
    """A lag at which one record is like another."""

    lag: float
    """By how much later the first shows the same [samples]."""
    correlation: float
    """Of what both show at that lag, at most 1 [-]."""
    turn: float
    """RMS slope over RMS of what both have in common, [rad/sample]."""
    common: int
    """Samples that both show at that lag."""


_FINE = 4
"""Points a sample at which a correlation is looked at: between samples it is band-limited as the records are."""
_SAME = 1.0 - 5e-7
"""Correlation from which two records show the same: it is not interpolated better."""


def correlation_peaks(late: Floats, early: Floats, most: int) -> list[CorrelationPeak]:
    """Of ``late`` (n,) with ``early`` (m,) [any unit]: the ``most`` likely lags, likeliest first.

    Each is of what both show at that lag, less its own means: those of whole records count how long each rests.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    if min(len(late), len(early)) < 8:
        return []
    least = max(1e-24 * float(late @ late) * float(early @ early), 1e-300)  # of what is constant but for its rounding
    late, early = without_mean(late), without_mean(early)
    size = next_fast_len(len(late) + len(early), real=True)
    both = _FINE * irfft(rfft(late, size) * np.conj(rfft(early, size)), _FINE * size)
    whole = np.arange(8 - len(early), len(late) - 7)
    first, last = np.maximum(-whole, 0), np.minimum(len(early), len(late) - whole)
    sums = [
        (total := np.r_[0.0, np.cumsum(values)])[last + moved] - total[first + moved]
        for values, moved in ((early, 0 * whole), (late, whole), (early**2, 0 * whole), (late**2, whole))
    ]
    common = last - first
    power = (sums[2] - sums[0] ** 2 / common) * (sums[3] - sums[1] ** 2 / common)
    steps = np.arange(_FINE * whole[0], _FINE * whole[-1] + 1)
    both = both[steps]
    shared = both - np.interp(steps, _FINE * whole, sums[0] * sums[1] / common)
    like = shared / np.sqrt(np.maximum(np.interp(steps, _FINE * whole, power), least))
    found, clear = [], (shared > 0.5 * max(float(shared.max()), 1e-300))[1:-1]
    for k in np.flatnonzero(clear & (like[1:-1] >= like[:-2]) & (like[1:-1] > like[2:])) + 1:
        move, height = parabola_peak(like, int(k))
        if (bend := 2.0 * both[k] - both[k - 1] - both[k + 1]) > 0.0:
            lag, turn = round(float(steps[k] + move) / _FINE, 6), _FINE * float(np.sqrt(bend / shared[k]))
            found.append(CorrelationPeak(lag, min(height, _SAME), turn, int(common[k // _FINE])))
    return sorted(found, key=lambda one: one.common * np.log1p(-(one.correlation**2)))[:most]


def loaded_loops() -> ModuleType | None:
    """The compiled loops, if filters of long records have loaded them before; else none: nothing else pays alone."""
    return sys.modules.get(f"{__package__}.compiled_loops")


def zero_phase(sections: Floats, channels: Floats, padding: int, out: Floats | None = None) -> Floats:
    """Filter channels (k, n) [any unit] along their samples, (k, n); ``sections`` (s, 6) as ``scipy.signal.butter``'s.

    Records are mirrored at both ends over ``padding`` samples (less than n); the filter starts settled there. The
    result is written to ``out`` (k, n) where that is given, which may be the channels themselves.
    """
    filtered = np.empty(channels.shape) if out is None else out
    if channels.size < COMPILED_FROM_SAMPLES or not can_compile():
        filtered[...] = both_ways(sections, channels, padding)
        return filtered
    if len(sections) % 2:
        sections = np.vstack([sections, IDENTITY_SECTION])
    settled = _settled(sections.tobytes())
    parts = [slice(i, i + LANES) for i in range(0, len(channels), LANES)]

    def run(part: slice) -> None:
        _both_ways(np.ascontiguousarray(sections), settled, channels[part], padding, filtered[part])

    if len(parts) == 1 or channels.size < THREADED_FROM_SAMPLES:
        for part in parts:
            run(part)
    else:
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(run, parts))
    return filtered


def both_ways(sections: Floats, values: Floats, padding: int, odd: bool = False) -> Floats:
    """``scipy.signal.sosfiltfilt`` of values (..., n) [any unit], (..., n), with even extension or ``odd``.

    That would compute anew each time in which states the filter is settled: a third of what a short record takes.
    """
    from scipy.signal import sosfilt

    head, tail = values[..., padding:0:-1], values[..., -2 : -padding - 2 : -1]
    if odd:
        head, tail = 2.0 * values[..., :1] - head, 2.0 * values[..., -1:] - tail
    whole = np.concatenate([head, values, tail], axis=-1)
    settled = _settled(sections.tobytes())
    settled = settled.reshape(-1, *(1,) * (values.ndim - 1), 2)
    for _ in range(2):
        whole = sosfilt(sections, whole, zi=settled * whole[..., :1])[0][..., ::-1]
    return np.asarray(whole[..., padding : whole.shape[-1] - padding])


@lru_cache(maxsize=64)
def _settled(sections: bytes) -> Floats:
    """States (s, 2) of second-order sections (s, 6), as bytes, that pass a constant."""
    from scipy.signal import sosfilt_zi

    return np.ascontiguousarray(sosfilt_zi(np.frombuffer(sections).reshape(-1, 6)), dtype=np.float64)


def _both_ways(sections: Floats, settled: Floats, channels: Floats, padding: int, out: Floats) -> None:
    from .compiled_loops import recursion

    count, length = channels.shape
    lanes = _lanes(length + 2 * padding)
    lanes[:, count:] = 0.0
    for lane, values in enumerate(channels):
        lanes[padding : padding + length, lane] = values
    lanes[:padding] = lanes[padding + 1 : 2 * padding + 1][::-1]
    lanes[padding + length :] = lanes[length - 1 : padding + length - 1][::-1]
    for backwards in (False, True):
        recursion(sections, settled[:, :, None] * lanes[-1 if backwards else 0], lanes, backwards)
    out[...] = lanes[padding : padding + length, :count].T


def _lanes(length: int) -> Floats:
    """Buffer for four channels side by side, (length, 4): new pages cost as much as the filter, so it is kept."""
    buffer: Floats | None = getattr(_buffers, "lanes", None)
    if buffer is None or len(buffer) < length:
        buffer = np.empty((length, LANES))
        _buffers.lanes = buffer if length <= LARGEST_BUFFER else None
    return buffer[:length]
