"""Frequency response to several inputs at once: to each with the others held, and what each alone explains.

With S the densities of the inputs x and the answer y, H = S_xx^-1 S_xy: least squares line by line, all noise taken to
be in the answer. An input that goes with the others tells nothing of its own, which its partial coherence shows.
J. S. Bendat and A. G. Piersol, Random Data, 4th ed., chapters 7 and 9.

Frequency response between channels that were sampled together: gain, phase, coherence, and how sure they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats

from ..errors import AnalysisError
from .welch import welch

LEAST_SEGMENTS = 4.0
"""Independent segments below which a coherence says nothing: of one segment it is 1, whatever was recorded."""


@dataclass(frozen=True)
class FrequencyResponse:
    """H1 = S_xy / S_xx: least squares, all noise taken to be in the output."""

    frequency: Floats
    """(m,) [Hz]"""
    response: NDArray[np.complex128]
    """(m,) [output unit / input unit]; zero where the input has nothing."""
    coherence: Floats
    """|S_xy|^2 / (S_xx S_yy), 0 to 1, (m,)."""
    segments: float
    """Independent ones."""

    @property
    def significant(self) -> NDArray[np.bool_]:
        """Whether the coherence is above what 95 of 100 records of unrelated noise show: 1 - 0.05^(1/(n-1)), (m,).

        G. C. Carter, C. H. Knapp and A. H. Nuttall, IEEE Trans. Audio Electroacoust. AU-21, 337 (1973).
        """
        return np.asarray(self.coherence > 1.0 - 0.05 ** (1.0 / (self.segments - 1.0)))

    @property
    def relative_deviation(self) -> Floats:
        """Standard deviation of the gain as a share of it: sqrt((1 - c) / (2 c n)), (m,); inf where c is zero.

        J. S. Bendat and A. G. Piersol, Random Data, 4th ed., eq. 9.88.
        """
        with np.errstate(divide="ignore"):
            return np.sqrt((1.0 - self.coherence) / (2.0 * self.coherence * self.segments))


def frequency_response(given: Floats, answer: Floats, rate_hz: float, segment: int) -> FrequencyResponse:
    """From what is given to its answer, (n,) each. Raises AnalysisError where there are too few segments to tell."""
    found = welch([given, answer], rate_hz, segment)
    if found.independent < LEAST_SEGMENTS:
        raise AnalysisError(
            f"{len(given)} samples are {found.independent:.1f} independent segments of {segment}: expected at least "
            f"{LEAST_SEGMENTS:g}; take shorter segments or record for longer"
        )
    cross, power, out = found.density[0, 1], found.power(0), found.power(1)
    there = power > 1e-24 * power.max(initial=0.0)
    response = np.divide(cross, power, out=np.zeros_like(cross), where=there)
    both = power * out
    coherence = np.divide(np.abs(cross) ** 2, both, out=np.zeros_like(both), where=both > 0.0)
    return FrequencyResponse(found.frequency, response, np.minimum(coherence, 1.0), found.independent)


ALONE = 1e-6
"""Share of an input's power that the other inputs do not explain, below which it is none of its own."""


@dataclass(frozen=True)
class ConditionedResponse:
    """Responses of one answer to q inputs."""

    frequency: Floats
    """(m,) [Hz]"""
    response: NDArray[np.complex128]
    """(q, m) [answer unit / input unit]; zero where an input has nothing of its own."""
    partial: Floats
    """Of what the other inputs leave of the answer, the share that an input explains, 0 to 1, (q, m)."""
    multiple: Floats
    """Share of the answer that all inputs explain, (m,)."""
    segments: float
    """Independent ones, less one for each input beyond the first."""

    @property
    def significant(self) -> NDArray[np.bool_]:
        """Whether a partial coherence is above what 95 of 100 records of unrelated noise show, (q, m)."""
        return np.asarray(self.partial > 1.0 - 0.05 ** (1.0 / (self.segments - 1.0)))

    @property
    def relative_deviation(self) -> Floats:
        """Standard deviation of a gain as a share of it: sqrt((1 - c) / (2 c n)), (q, m); inf where c is zero."""
        with np.errstate(divide="ignore"):
            return np.sqrt((1.0 - self.partial) / (2.0 * self.partial * self.segments))


def conditioned_response(inputs: Sequence[Floats], answer: Floats, rate_hz: float, segment: int) -> ConditionedResponse:
    """From inputs to an answer, (n,) each. Raises AnalysisError where there are too few segments to tell them apart."""
    found, count = welch([*inputs, answer], rate_hz, segment), len(inputs)
    left = found.independent - (count - 1)
    if left < LEAST_SEGMENTS:
        raise AnalysisError(
            f"{len(answer)} samples are {found.independent:.1f} independent segments of {segment}: expected at least "
            f"{LEAST_SEGMENTS + count - 1:g} for {count} inputs; take shorter segments or record for longer"
        )
    lines = np.moveaxis(found.density, 2, 0)
    response = np.zeros((len(found.frequency), count), dtype=np.complex128)
    partial = np.zeros((len(found.frequency), count))
    multiple = np.zeros(len(found.frequency))
    for line, density in enumerate(lines):
        response[line], partial[line], multiple[line] = _at_line(density, count)
    return ConditionedResponse(found.frequency, response.T, partial.T, multiple, left)


def _at_line(density: NDArray[np.complex128], count: int) -> tuple[NDArray[np.complex128], Floats, float]:
    """Responses, partial coherences and the multiple one, of densities (q + 1, q + 1), the answer's last."""
    out = float(density[count, count].real)
    told = [j for j in range(count) if _own(density, j, [i for i in range(count) if i != j]) > ALONE]
    response, partial = np.zeros(count, dtype=np.complex128), np.zeros(count)
    if not told or not out > 0.0:
        return response, partial, 0.0
    response[told] = np.linalg.solve(density[np.ix_(told, told)], density[told, count])
    left = _left(density, told, count)
    for j in told:
        without = _left(density, [i for i in told if i != j], count)
        partial[j] = max(0.0, 1.0 - left / without) if without > 0.0 else 0.0
    return response, partial, 1.0 - left / out


def _own(density: NDArray[np.complex128], j: int, others: Sequence[int]) -> float:
    """Share of an input's power that others do not explain."""
    whole = float(density[j, j].real)
    return _left(density, others, j) / whole if whole > 0.0 else 0.0


def _left(density: NDArray[np.complex128], inputs: Sequence[int], out: int) -> float:
    """Power of a channel that inputs do not explain; they may go together."""
    whole = float(density[out, out].real)
    if not inputs:
        return whole
    size = np.sqrt(density[inputs, inputs].real)
    size[size == 0.0] = 1.0
    among = density[np.ix_(inputs, inputs)] / np.outer(size, size)
    cross = density[inputs, out] / size
    return max(0.0, whole - float((cross.conj() @ np.linalg.pinv(among, rcond=1e-9, hermitian=True) @ cross).real))
