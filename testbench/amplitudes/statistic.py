"""What is read of a record to judge an amplitude: near the amplitude itself for peaks, its square for the RMS."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from ..vibration import Metric


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

    def simulate(self, shape: Floats, amplitudes: Floats, noise: Floats) -> Floats:
        """Readings of ``shape`` (n,), which has amplitude 1, at each amplitude, in noise (b, n): (b, k)."""
        if self.squared:
            cross, own = noise @ shape / len(shape), np.mean(noise**2, axis=1)
            return amplitudes**2 + 2.0 * np.outer(cross, amplitudes) + own[:, None]
        return np.stack([self._extreme(shape, a, noise) for a in amplitudes], axis=1)

    def _extreme(self, shape: Floats, amplitude: float, noise: Floats) -> Floats:
        """Only samples that noise may make the extreme one need be looked at."""
        signal = (amplitude * shape).astype(noise.dtype)
        reach = 12.0 * float(noise[:8].std())
        if self.metric == "peak":
            near = np.abs(signal) >= np.abs(signal).max() - reach
            return np.abs(signal[near] + noise[:, near]).max(axis=1)
        high, low = signal >= signal.max() - reach, signal <= signal.min() + reach
        return (signal[high] + noise[:, high]).max(axis=1) - (signal[low] + noise[:, low]).min(axis=1)
