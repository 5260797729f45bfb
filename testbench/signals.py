"""Laws on sampled signals: band, offset, the lag between two records."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from .errors import AnalysisError

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
        from .spectra.zerophase import zero_phase

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
