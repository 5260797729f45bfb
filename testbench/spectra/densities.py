"""Power and cross spectral densities by Welch's method, in blocks that stay in the processor's cache.

Segments that overlap by half, each less its own mean, a Hann window: to rounding what ``scipy.signal.welch`` and
``csd`` give. They lay all segments of a record out in memory several times over; here a block of segments is windowed,
transformed and added up before the next one is touched, and each thread works at blocks of its own.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from balance.arrays import Floats

from ..errors import AnalysisError

SEGMENT = 4096
"""Samples of a segment where none is asked for."""
BLOCK = 1 << 15
"""Samples that are transformed at once: with their spectrum half a megabyte."""
WORTH = 1 << 20
"""Samples from which on a second thread pays."""
Matrix = NDArray[np.complex128]


@dataclass(frozen=True)
class Spectra:
    """One-sided densities of channels that were sampled together."""

    frequency: Floats
    """(m,) [Hz]"""
    density: Matrix
    """(k, k, m) [unit unit/Hz]: mean of conj(X_i) X_j; on the diagonal the power spectral densities, real."""
    segments: int
    """How many were averaged; those that overlap share what they tell."""

    def power(self, channel: int = 0) -> Floats:
        """Power spectral density of a channel, (m,) [unit^2/Hz]."""
        return np.ascontiguousarray(self.density[channel, channel].real)

    @property
    def independent(self) -> float:
        """Segments that would tell as much if none overlapped: with a Hann window and half overlap 18/19 of them.

        P. D. Welch, IEEE Trans. Audio Electroacoust. AU-15, 70 (1967): variance by (1 + 2 rho (K - 1) / K) / K, where
        rho = (sum w(i) w(i + n/2) / sum w^2)^2 = 1/36.
        """
        return self.segments / (1.0 + (self.segments - 1.0) / (18.0 * self.segments))


def welch(channels: Sequence[Floats], rate_hz: float, segment: int = SEGMENT) -> Spectra:
    """Densities of channels of one length (n,) each, sampled together; ``segment`` in samples, even.

    Raises AnalysisError where the channels differ in length or are shorter than a segment.
    """
    lengths = sorted({len(values) for values in channels})
    if len(lengths) != 1 or segment < 4 or segment % 2 or lengths[0] < segment:
        raise AnalysisError(
            f"spectrum of channels of {lengths} samples in segments of {segment}: expected one length, of an even "
            "segment or more"
        )
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(segment) / segment)
    views = [sliding_window_view(np.asarray(v, dtype=np.float64), segment)[:: segment // 2] for v in channels]
    total = _summed(views, window)
    count = len(views[0])
    scale = np.full(segment // 2 + 1, 2.0 / (rate_hz * float(window @ window) * count))
    scale[[0, -1]] /= 2.0
    return Spectra(np.fft.rfftfreq(segment, 1.0 / rate_hz), total * scale, count)


def _summed(views: Sequence[Floats], window: Floats) -> Matrix:
    """Sum over all segments of conj(X_i) X_j, (k, k, m)."""
    count, step = len(views[0]), max(1, BLOCK // len(window))
    parts = [slice(i, min(i + step, count)) for i in range(0, count, step)]
    workers = min(2, os.cpu_count() or 1) if count * len(window) * len(views) >= WORTH else 1
    shares = [parts[i::workers] for i in range(workers)]
    if workers == 1:
        return _Share(views, window, step).over(parts)
    with ThreadPoolExecutor(workers) as pool:
        return np.sum(list(pool.map(lambda share: _Share(views, window, step).over(share), shares)), axis=0)


class _Share:
    """What one thread adds up, in buffers of its own."""

    def __init__(self, views: Sequence[Floats], window: Floats, step: int) -> None:
        self.views, self.window = views, window
        self.blocks = np.empty((step, len(window)))
        self.power = np.zeros((len(views), len(window) + 2))
        self.cross = {
            (i, j): np.zeros(len(window) // 2 + 1, np.complex128) for i in range(len(views)) for j in range(i)
        }

    def over(self, parts: Sequence[slice]) -> Matrix:
        """The sums over blocks of segments."""
        for part in parts:
            spectra = [self._transformed(view[part]) for view in self.views]
            for i, spectrum in enumerate(spectra):
                pairs = spectrum.view(np.float64)
                self.power[i] += np.einsum("ij,ij->j", pairs, pairs)
                for j in range(i):
                    self.cross[i, j] += np.einsum("ij,ij->j", spectrum.conj(), spectra[j])
        return self._matrix()

    def _transformed(self, segments: Floats) -> NDArray[Any]:
        from scipy.fft import rfft

        block = self.blocks[: len(segments)]
        np.subtract(segments, segments.mean(axis=1, keepdims=True), out=block)
        block *= self.window
        return np.asarray(rfft(block, axis=1))

    def _matrix(self) -> Matrix:
        k, m = len(self.views), len(self.window) // 2 + 1
        found = np.zeros((k, k, m), np.complex128)
        for i in range(k):
            found[i, i] = self.power[i, 0::2] + self.power[i, 1::2]
        for (i, j), values in self.cross.items():
            found[i, j], found[j, i] = values, values.conj()
        return found
