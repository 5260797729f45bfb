"""Laws on sampled signals: band, offset, the lag between two records."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from .errors import AnalysisError

ORDER = 4
"""Of the Butterworth filters; run forwards and backwards, so that the phase is zero and the order twice that."""


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

    def of(self, values: Floats, rate_hz: float) -> Floats:
        """The part of a signal (n,) that lies in the band. Raises AnalysisError if rate or length forbid it."""
        from scipy.signal import butter, sosfiltfilt

        if not self.high_hz < rate_hz / 2.0:
            raise AnalysisError(
                f"band {self} needs more than {2 * self.high_hz:g} samples a second, the record has {rate_hz:g}: "
                "name a lower band, or none"
            )
        edges = (self.low_hz, self.high_hz) if self.low_hz > 0.0 else self.high_hz
        sos = butter(ORDER, edges, "bandpass" if self.low_hz > 0.0 else "lowpass", fs=rate_hz, output="sos")
        if len(values) <= 6 * len(sos) + 3:
            raise AnalysisError(f"{len(values)} samples are too few for a filter: expected a longer record, or no band")
        return np.asarray(sosfiltfilt(sos, values), dtype=float)


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
