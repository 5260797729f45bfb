"""The noise of a channel, as the stretch at rest before the motion shows it, or as the rig states it."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError

if TYPE_CHECKING:
    from ..signal.filters import Band

BANDWIDTH = 16.0
"""Time-bandwidth product of the tapers: 31 of them, so that the noise is known to a fifth also where the signal is."""
ENOUGH = 12.0
"""Degrees of freedom below which a stretch tells too little of the noise in a band."""
STATED_S = 0.2
"""Seconds at rest that a stated noise is worth: what the shortest of the shipped rigs' rests tells."""
_SEGMENT = 8192
"""Longest piece of which a spectrum is taken [samples]."""


@dataclass(frozen=True)
class Noise:
    """A spectrum of noise, and how well it is known."""

    frequency: Floats
    """(m,) [Hz]"""
    density: Floats
    """One-sided power spectral density, (m,) [unit^2/Hz]."""
    seconds: float
    """Of the stretch that it was taken of."""
    rate_hz: float
    step: float
    """Resolution of the channel [unit]."""

    @classmethod
    def of(cls, resting: Floats, rate_hz: float, step: float = 0.0) -> "Noise":
        """By Thomson's multitaper method, of a stretch at rest (n,) of a channel with steps of ``step``.

        A channel with coarse steps may show no noise at rest; in motion its steps are noise of step^2 / 12, spread
        over all frequencies (GUM, JCGM 100, F.2.2.1). What is slower than the stretch is not seen. Raises
        AnalysisError for a stretch too short for any spectrum.
        """
        size = min(len(resting), _SEGMENT)
        if size < 4 * BANDWIDTH:
            raise AnalysisError(f"{len(resting)} samples at rest are too few for a spectrum of the noise")
        pieces = resting[: len(resting) // size * size].reshape(-1, 1, size)
        tapers = _tapers(size)
        power = np.abs(np.fft.rfft((pieces - pieces.mean(axis=-1, keepdims=True)) * tapers)) ** 2
        density = 2.0 * power.mean(axis=(0, 1)) / rate_hz
        frequency = np.fft.rfftfreq(size, 1.0 / rate_hz)
        return cls(frequency, np.maximum(density, step**2 / (6.0 * rate_hz)), len(resting) / rate_hz, rate_hz, step)

    @classmethod
    def stated(cls, deviation: float, rate_hz: float, step: float = 0.0) -> "Noise | None":
        """White noise of a standard deviation [unit] that a rig states; None of none.

        It is taken to be as sure as STATED_S of rest would make it.
        """
        if deviation <= 0.0:
            return None
        frequency = np.linspace(0.0, rate_hz / 2.0, _SEGMENT // 2 + 1)
        density = max(2.0 * deviation**2 / rate_hz, step**2 / (6.0 * rate_hz))
        return cls(frequency, np.full_like(frequency, density), STATED_S, rate_hz, step)

    def at(self, frequency: Floats) -> Floats:
        """The density at other frequencies, (k,) [unit^2/Hz]."""
        return np.interp(frequency, self.frequency, self.density)

    def power(self, band: "Band | None") -> float:
        """Mean square of the noise in a band [unit^2]."""
        return float(np.trapezoid(self._weighted(band), self._fine))

    def freedom(self, band: "Band | None", seconds: float | None = None) -> float:
        """Degrees of freedom of the power in a band over ``seconds``; as it is known, of the stretch at rest.

        2 T (int S df)^2 / int S^2 df, with the scatter of the tapers taken out of the lower integral.
        """
        weighted = self._weighted(band)
        square = np.trapezoid(weighted**2, self._fine) / (1.0 + 1.0 / round(2 * BANDWIDTH - 1))
        if square <= 0.0:
            return np.inf
        whole = np.trapezoid(weighted, self._fine) ** 2
        return float(2.0 * (self.seconds if seconds is None else seconds) * whole / square)

    def freedom_at(self, frequency: Floats, weights: Floats) -> float:
        """Degrees of freedom to which a weighted sum of densities (k,) is known from the stretch.

        The tapers take frequencies together over their bandwidth, mirrored at zero: 2 T (sum w S)^2 / int (w~ S)^2 df,
        w~ the weights as they are spread.
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
    """Discrete prolate spheroidal sequences, (2 BANDWIDTH - 1, size): the channels of a logger rest alike."""
    from scipy.signal.windows import dpss

    return np.asarray(dpss(size, BANDWIDTH, round(2 * BANDWIDTH - 1)))
