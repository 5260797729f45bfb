"""Power and cross spectral densities by Welch's method, in blocks that stay in the processor's cache.

Segments overlap by half, have their mean taken off and a Hann window: to rounding what ``scipy.signal.welch`` and
``csd`` give. Those lay all segments of a record out in memory several times over; here a block of segments is windowed,
transformed and added up before the next one, and each thread has blocks of its own.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.compiled_kernels import can_compile

from ..errors import AnalysisError

SEGMENT = 4096
"""Samples of a segment by default."""
BLOCK = 1 << 15
"""Samples that are transformed at once: with their spectrum half a megabyte."""
COMPILED_FROM_SAMPLES = 1 << 17
"""Samples of all segments from which on compiled loops pay for their import."""
THREADED_FROM_SAMPLES = 1 << 20
"""Samples of all segments from which on a second thread pays."""
CrossDensities = NDArray[np.complex128]


@dataclass(frozen=True)
class Spectra:
    """One-sided densities of channels that were sampled together."""

    frequency: Floats
    """(m,) [Hz]"""
    density: CrossDensities
    """(k, k, m) [unit unit/Hz]: mean of conj(X_i) X_j; on the diagonal the power spectral densities, real."""
    segments: int
    """How many were averaged; those that overlap are not independent."""

    def power(self, channel: int = 0) -> Floats:
        """Power spectral density of a channel, (m,) [unit^2/Hz]."""
        return np.ascontiguousarray(self.density[channel, channel].real)

    @property
    def independent(self) -> float:
        """Independent segments of the same variance: with a Hann window and half overlap 18/19 of them.

        P. D. Welch, IEEE Trans. Audio Electroacoust. AU-15, 70 (1967): variance by (1 + 2 rho (K - 1) / K) / K, where
        rho = (sum w(i) w(i + n/2) / sum w^2)^2 = 1/36.
        """
        return self.segments / (1.0 + (self.segments - 1.0) / (18.0 * self.segments))


def welch(
    channels: Sequence[Floats], rate_hz: float, segment: int = SEGMENT, highest_hz: float | None = None
) -> Spectra:
    """Densities of channels sampled together, (n,) each [any unit]; ``segment`` in samples, even.

    Of lines up to ``highest_hz`` alone, where that is given.

    Raises AnalysisError where the channels differ in length or are shorter than a segment.
    """
    lengths = sorted({len(values) for values in channels})
    if len(lengths) != 1 or segment < 4 or segment % 2 or lengths[0] < segment:
        raise AnalysisError(
            f"spectrum of channels of {lengths} samples in segments of {segment}: expected one length, of an even "
            "segment or more"
        )
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(segment) / segment)
    values = [np.require(v, np.float64, ["C", "W"]) for v in channels]  # compiled loops take what can be written alone
    count = (lengths[0] - segment) // (segment // 2) + 1
    frequency = np.fft.rfftfreq(segment, 1.0 / rate_hz)
    lines = len(frequency) if highest_hz is None else int(np.searchsorted(frequency, highest_hz, "right"))
    scale = np.full(len(frequency), 2.0 / (rate_hz * float(window @ window) * count))
    scale[[0, -1]] /= 2.0
    return Spectra(frequency[:lines], _summed(values, window, count, lines) * scale[:lines], count)


def _summed(channels: Sequence[Floats], window: Floats, count: int, lines: int) -> CrossDensities:
    """Sum over ``count`` segments of conj(X_i) X_j in the first ``lines``, (k, k, m)."""
    step = max(1, BLOCK // len(window))
    parts = [range(i, min(i + step, count)) for i in range(0, count, step)]
    size = count * len(window) * len(channels)
    compiled = can_compile()
    if size < THREADED_FROM_SAMPLES:
        compiled = compiled and size >= COMPILED_FROM_SAMPLES
        return _PartialSum(channels, window, step, compiled, lines).add_blocks(parts)
    with ThreadPoolExecutor(2) as pool:
        sums = [_PartialSum(channels, window, step, compiled, lines) for _ in range(2)]
        shares = [pool.submit(one.add_blocks, parts[i::2]) for i, one in enumerate(sums)]
        return np.asarray(shares[0].result() + shares[1].result())


class _PartialSum:
    """Sums over the segments of one thread, in buffers of its own."""

    def __init__(self, channels: Sequence[Floats], window: Floats, step: int, compiled: bool, lines: int) -> None:
        self.channels, self.window, self.compiled = channels, window, compiled
        self.blocks = np.empty((step, len(window)))
        self.power = np.zeros((len(channels), lines))
        self.cross = {(i, j): np.zeros(lines, np.complex128) for i in range(len(channels)) for j in range(i)}

    def add_blocks(self, parts: Sequence[range]) -> CrossDensities:
        """Sums of conj(X_i) X_j over blocks of segments, (k, k, m) [unit unit]."""
        for part in parts:
            spectra = [self._transformed(values, part) for values in self.channels]
            for i, spectrum in enumerate(spectra):
                power = self.power[i]
                if self.compiled:
                    from .compiled_loops import add_power

                    add_power(spectrum, power)
                else:
                    power += (spectrum.real**2 + spectrum.imag**2).sum(axis=0)
                for j in range(i):
                    self.cross[i, j] += np.einsum("ij,ij->j", spectrum.conj(), spectra[j])
        return self._matrix()

    def _transformed(self, values: Floats, part: range) -> NDArray[Any]:
        from scipy.fft import rfft

        block, half = self.blocks[: len(part)], len(self.window) // 2
        if self.compiled:
            from .compiled_loops import windowed

            windowed(values, part.start * half, self.window, block)
        else:
            segments = sliding_window_view(values[part.start * half :], 2 * half)[::half][: len(part)]
            np.subtract(segments, segments.mean(axis=1, keepdims=True), out=block)
            block *= self.window
        return np.ascontiguousarray(rfft(block, axis=1)[:, : self.power.shape[1]])

    def _matrix(self) -> CrossDensities:
        k, m = self.power.shape
        found = np.zeros((k, k, m), np.complex128)
        for i in range(k):
            found[i, i] = self.power[i]
        for (i, j), values in self.cross.items():
            found[i, j], found[j, i] = values, values.conj()
        return found
