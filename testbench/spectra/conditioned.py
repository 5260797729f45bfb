"""Frequency response to several inputs at once: to each with the others held, and what each alone explains.

With S the densities of the inputs x and the answer y, H = S_xx^-1 S_xy: least squares line by line, all noise taken to
be in the answer. An input that goes with the others tells nothing of its own, which its partial coherence shows.
J. S. Bendat and A. G. Piersol, Random Data, 4th ed., chapters 7 and 9.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats

from ..errors import AnalysisError
from .densities import welch
from .transfer import LEAST_SEGMENTS

ALONE = 1e-6
"""Share of an input's power that the other inputs do not explain, below which it is none of its own."""


@dataclass(frozen=True)
class Conditioned:
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


def conditioned(inputs: Sequence[Floats], answer: Floats, rate_hz: float, segment: int) -> Conditioned:
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
    return Conditioned(found.frequency, response.T, partial.T, multiple, left)


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
