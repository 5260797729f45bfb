"""The noise spectrum of a channel, estimated from the rest before the motion or stated by the rig."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError

if TYPE_CHECKING:
    from ..signal.filters import Band

BANDWIDTH = 16.0
"""Time-bandwidth product: 31 tapers, so that the density is known to a fifth at every frequency."""
ENOUGH = 12.0
"""Least degrees of freedom of the noise power in a band for which a rest is used."""
STATED_S = 0.2
"""Rest that a stated noise is taken to be worth [s]: the shortest of the shipped rigs' rests."""
_SEGMENT = 8192
"""Longest segment of a spectrum [samples]."""


@dataclass(frozen=True)
class Noise:
    """A noise spectrum and the length of rest that it is known from."""

    frequency: Floats
    """(m,) [Hz]"""
    density: Floats
    """One-sided power spectral density, (m,) [unit^2/Hz]."""
    seconds: float
    """Length of the rest [s]."""
    rate_hz: float
    step: float
    """Resolution of the channel [unit]."""

    @classmethod
    def of(cls, resting: Floats, rate_hz: float, step: float = 0.0) -> "Noise":
        """By Thomson's multitaper method, from a rest (n,) [unit] of a channel with the resolution ``step`` [unit].

        A coarse channel may show no noise at rest; in motion its quantization is white noise of variance step^2 / 12
        (JCGM 100:2008, F.2.2.1), so the density is no less than that. Noise slower than the rest is not seen. Raises
        AnalysisError for a rest too short for any spectrum.
        """
        size = min(len(resting), _SEGMENT)
        if size < 4 * BANDWIDTH:
            raise AnalysisError(
                f"{len(resting)} samples at rest are too few for a spectrum: expected at least {4 * BANDWIDTH:.0f}"
            )
        pieces = resting[: len(resting) // size * size].reshape(-1, 1, size)
        tapers = _tapers(size)
        power = np.abs(np.fft.rfft((pieces - pieces.mean(axis=-1, keepdims=True)) * tapers)) ** 2
        density = 2.0 * power.mean(axis=(0, 1)) / rate_hz
        frequency = np.fft.rfftfreq(size, 1.0 / rate_hz)
        return cls(frequency, np.maximum(density, step**2 / (6.0 * rate_hz)), len(resting) / rate_hz, rate_hz, step)

    @classmethod
    def stated(cls, deviation: float, rate_hz: float, step: float = 0.0) -> "Noise | None":
        """White noise of the standard deviation [unit] that a rig states, as if from STATED_S of rest; None of zero."""
        if deviation <= 0.0:
            return None
        frequency = np.linspace(0.0, rate_hz / 2.0, _SEGMENT // 2 + 1)
        density = max(2.0 * deviation**2 / rate_hz, step**2 / (6.0 * rate_hz))
        return cls(frequency, np.full_like(frequency, density), STATED_S, rate_hz, step)

    def at(self, frequency: Floats) -> Floats:
        """The density at frequencies (k,) [Hz], (k,) [unit^2/Hz]."""
        return np.interp(frequency, self.frequency, self.density)

    def power(self, band: "Band | None") -> float:
        """Mean square of the noise in a band [unit^2]."""
        return float(np.trapezoid(self._weighted(band), self._fine))

    def degrees_of_freedom(self, band: "Band | None", seconds: float | None = None) -> float:
        """Degrees of freedom of the power in a band over ``seconds`` [s], by default over the rest.

        2 T (int S df)^2 / int S^2 df, the lower integral corrected for the scatter of the tapers.
        """
        weighted = self._weighted(band)
        square = np.trapezoid(weighted**2, self._fine) / (1.0 + 1.0 / round(2 * BANDWIDTH - 1))
        if square <= 0.0:
            return np.inf
        whole = np.trapezoid(weighted, self._fine) ** 2
        return float(2.0 * (self.seconds if seconds is None else seconds) * whole / square)

    def degrees_of_freedom_of_sum(self, frequency: Floats, weights: Floats) -> float:
        """Degrees of freedom of sum w S, with weights w (k,) [-] at frequencies (k,) [Hz].

        The tapers average over their bandwidth, mirrored at zero: 2 T (sum w S)^2 / int (w~ S)^2 df, w~ the weights
        averaged the same way.
        """
        half = BANDWIDTH * float(self.frequency[1])
        density = weights * self.at(frequency)
        edges = np.linspace(0.0, self.rate_hz / 2.0 + half, 2001)
        total = np.concatenate([[0.0], np.cumsum(density)])
        below = total[np.searchsorted(frequency, np.concatenate([edges + half, np.abs(edges - half)]))]
        upper, lower = below.reshape(2, -1)
        spread = np.where(edges < half, upper + lower, upper - lower) / (2.0 * half)
        square = float(np.trapezoid(spread**2, edges))
        return 2.0 * self.seconds * float(total[-1]) ** 2 / square if square > 0.0 else np.inf

    @cached_property
    def _fine(self) -> Floats:
        """Frequencies of integrals [Hz]."""
        return np.linspace(0.0, self.rate_hz / 2.0, 4001)

    def _weighted(self, band: "Band | None") -> Floats:
        gain = band.gain(self._fine, self.rate_hz) if band else 1.0
        return self.at(self._fine) * gain**2


@lru_cache(maxsize=8)
def _tapers(size: int) -> Floats:
    """Discrete prolate spheroidal sequences, (2 BANDWIDTH - 1, size) [-]; a logger's channels share them."""
    from scipy.signal.windows import dpss

    return np.asarray(dpss(size, BANDWIDTH, round(2 * BANDWIDTH - 1)))
