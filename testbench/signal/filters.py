"""Laws on sampled signals: band, offset, the lag between two records.

Second-order sections run forwards and backwards over several channels at once.

What ``scipy.signal.sosfiltfilt`` gives with even extension, to rounding. A recursion waits for its own last result at
every sample; four channels side by side wait together, and two threads take four channels each.
"""

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from ..compiled_kernels import can_compile
from ..errors import AnalysisError

ORDER = 4
"""Of the Butterworth filters; run forwards and backwards, so that the phase is zero and the order twice that."""


_PERIODS = 4.0
"""Of the band's slowest edge, for which a record is mirrored at its ends. Turned over there as well, as is usual, the
raw first and last sample would pass unfiltered, and with them noise of all frequencies into every peak."""


@dataclass(frozen=True)
class Band:
    """Frequencies that are kept, by a zero-phase Butterworth filter. A low end of zero keeps all that is slow."""

    low_hz: float
    high_hz: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.low_hz < self.high_hz < np.inf:
            raise AnalysisError(f"band {self}: expected 0 <= low < high")

    def __str__(self) -> str:
        return f"{self.low_hz:g}..{self.high_hz:g} Hz"

    def of(self, values: Floats, rate_hz: float, in_place: bool = False) -> Floats:
        """The part of a signal (..., n) that lies in the band, written over it where that is asked for.

        Raises AnalysisError if rate or length forbid it.
        """

        sos = self._sections(rate_hz)
        if values.shape[-1] <= 6 * len(sos) + 3:
            raise AnalysisError(
                f"{values.shape[-1]} samples are too few for a filter: expected a longer record, or no band"
            )
        settled = round(_PERIODS * rate_hz / (self.low_hz or self.high_hz))
        length = min(max(settled, 6 * len(sos) + 3), values.shape[-1] - 1)
        rows = values.reshape(-1, values.shape[-1])
        return zero_phase(sos, rows, length, rows if in_place else None).reshape(values.shape)

    def gain(self, frequency: Floats, rate_hz: float) -> Floats:
        """What becomes of an amplitude at each frequency (n,) [Hz]: |H|^2, since the filter runs both ways."""
        from scipy.signal import sosfreqz

        within = np.minimum(frequency, rate_hz / 2.0)
        return np.abs(sosfreqz(self._sections(rate_hz), within, fs=rate_hz)[1]) ** 2

    def _sections(self, rate_hz: float) -> Floats:
        """Raises AnalysisError where the rate does not hold the band."""
        from scipy.signal import butter

        if not self.high_hz < rate_hz / 2.0:
            raise AnalysisError(
                f"band {self} needs more than {2 * self.high_hz:g} samples a second, the record has {rate_hz:g}: "
                "name a lower band, or none"
            )
        if self.low_hz > 0.0:
            return np.asarray(butter(ORDER, (self.low_hz, self.high_hz), "bandpass", fs=rate_hz, output="sos"))
        return np.asarray(butter(ORDER, self.high_hz, "lowpass", fs=rate_hz, output="sos"))


def without_offset(values: Floats) -> Floats:
    """A signal less its mean over the whole record."""
    return values - values.mean()


def lag(late: Floats, early: Floats, rate_hz: float) -> float:
    """How much later ``late`` shows what ``early`` shows [s]: the peak of their correlation, between samples."""
    from scipy.signal import correlate, correlation_lags

    both = correlate(without_offset(late), without_offset(early))
    k = int(np.argmax(both))
    shift = float(correlation_lags(len(late), len(early))[k])
    if 0 < k < len(both) - 1:
        left, top, right = both[k - 1 : k + 2]
        bend = left - 2.0 * top + right
        shift += float(0.5 * (left - right) / bend) if bend < 0.0 else 0.0
    return shift / rate_hz


_NOTHING = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
"""A section that passes what it is given."""
LANES = 4
"""Channels side by side."""
WORTH = 1 << 18
"""Samples from which on the compiled form pays for its import."""
_MOST_KEPT = 1 << 19
"""Samples of a channel up to which a thread keeps its room, 16 MB."""
_KEPT = threading.local()
WORTH_A_THREAD = 1 << 22
"""Samples from which on a second thread pays."""


def zero_phase(sections: Floats, channels: Floats, padding: int, out: Floats | None = None) -> Floats:
    """Filter channels (k, n) along their samples; ``sections`` (s, 6) as of ``scipy.signal.butter``, (k, n).

    Records are mirrored at both ends over ``padding`` samples, below n; the filter starts as if settled there. The
    result is written to ``out`` where that is given, which may be the channels themselves.
    """
    from scipy.signal import sosfilt_zi, sosfiltfilt

    passed = np.empty(channels.shape) if out is None else out
    if channels.size < WORTH or not can_compile():
        passed[...] = sosfiltfilt(sections, channels, padtype="even", padlen=padding)
        return passed
    if len(sections) % 2:
        sections = np.vstack([sections, _NOTHING])
    settled = np.ascontiguousarray(sosfilt_zi(sections), dtype=np.float64)
    parts = [slice(i, i + LANES) for i in range(0, len(channels), LANES)]

    def run(part: slice) -> None:
        _both_ways(np.ascontiguousarray(sections), settled, channels[part], padding, passed[part])

    if len(parts) == 1 or channels.size < WORTH_A_THREAD:
        for part in parts:
            run(part)
    else:
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(run, parts))
    return passed


def _both_ways(sections: Floats, settled: Floats, channels: Floats, padding: int, out: Floats) -> None:
    from .compiled_loops import recursion

    count, length = channels.shape
    wide = _wide(length + 2 * padding)
    wide[:, count:] = 0.0
    for lane, values in enumerate(channels):
        wide[padding : padding + length, lane] = values
    wide[:padding] = wide[padding + 1 : 2 * padding + 1][::-1]
    wide[padding + length :] = wide[length - 1 : padding + length - 1][::-1]
    for backwards in (False, True):
        recursion(sections, settled[:, :, None] * wide[-1 if backwards else 0], wide, backwards)
    out[...] = wide[padding : padding + length, :count].T


def _wide(length: int) -> Floats:
    """Room for four channels side by side: fresh pages cost as much as the filter, so a thread keeps its last one."""
    kept: Floats | None = getattr(_KEPT, "wide", None)
    if kept is None or len(kept) < length:
        kept = np.empty((length, LANES))
        _KEPT.wide = kept if length <= _MOST_KEPT else None
    return kept[:length]
