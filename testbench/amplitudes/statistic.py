"""What is read of a record to judge an amplitude: near the amplitude itself for peaks, its square for the RMS."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from ..vibration import Metric
from .lobes import Lobes


@dataclass(frozen=True)
class Statistic:
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

    def extremes(self, lobes: Lobes, amplitudes: Floats, noise: Floats) -> Floats:
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
