"""Frequency response between channels sampled together: gain, phase, coherence and their uncertainty.

With S the spectral densities of the inputs x and the output y, H = S_xx^-1 S_xy: least squares at each frequency, all
noise taken to be in the output. With several inputs, H is the response to each with the others fixed, and the partial
coherence is what each alone explains; an input that is correlated with the others has none.
J. S. Bendat and A. G. Piersol, Random Data, 4th ed., chapters 7 and 9.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats

from ..errors import AnalysisError
from .welch import CrossDensities, Spectra

LEAST_SEGMENTS = 4.0
"""Independent segments below which a coherence says nothing: of one segment it is 1, whatever was recorded."""
LEAST_OWN_POWER = 1e-6
"""Share of an input's power that the other inputs do not explain, below which it has no response of its own."""


@dataclass(frozen=True)
class FrequencyResponse:
    """Responses of one output to q inputs, to each with the others fixed; with one input H1 = S_xy / S_xx."""

    frequency: Floats
    """(m,) [Hz]"""
    response: NDArray[np.complex128]
    """(q, m) [output unit / input unit]; zero where an input has no power of its own."""
    coherence: Floats
    """Partial coherence: share that an input explains of the output's residual by the other inputs, 0 to 1, (q, m)."""
    multiple: Floats
    """Multiple coherence: share of the output that all inputs explain, (m,)."""
    segments: float
    """Number of independent segments, less one for each input beyond the first."""

    @property
    def significant(self) -> NDArray[np.bool_]:
        """Where a coherence is above what 95 of 100 records of unrelated noise show, (q, m) [-].

        1 - 0.05^(1 / (segments - 1)): G. C. Carter, C. H. Knapp and A. H. Nuttall, IEEE Trans. Audio Electroacoust.
        AU-21, 337 (1973).
        """
        return np.asarray(self.coherence > 1.0 - 0.05 ** (1.0 / (self.segments - 1.0)))

    @property
    def relative_deviation(self) -> Floats:
        """Standard deviation of a gain as a share of it, (q, m) [-]; inf where the coherence c is zero.

        sqrt((1 - c) / (2 c n)): J. S. Bendat and A. G. Piersol, Random Data, 4th ed., eq. 9.88.
        """
        with np.errstate(divide="ignore"):
            return np.sqrt((1.0 - self.coherence) / (2.0 * self.coherence * self.segments))


def response_of(found: Spectra, inputs: Sequence[int], output: int) -> FrequencyResponse:
    """From q channels to another, by their numbers in densities that were found together.

    Raises AnalysisError where there are too few segments for so many inputs.
    """
    count = len(inputs)
    segments = found.independent - (count - 1)
    if segments < LEAST_SEGMENTS:
        raise AnalysisError(
            f"the record has {found.independent:.1f} independent segments: expected at least "
            f"{LEAST_SEGMENTS + count - 1:g} for {count} inputs; take shorter segments or record for longer"
        )
    chosen = np.array([*inputs, output])
    response, coherence, multiple = _responses(np.moveaxis(found.density[chosen[:, None], chosen], 2, 0), count)
    return FrequencyResponse(found.frequency, response, coherence, multiple, segments)


def _responses(density: CrossDensities, count: int) -> tuple[NDArray[np.complex128], Floats, Floats]:
    """Responses, partial coherences, (q, m), the multiple one, (m,), of densities (m, q + 1, q + 1), output last."""
    power = np.diagonal(density, axis1=1, axis2=2).real
    own = np.array([_residual_power(density, [i for i in range(count) if i != j], j) for j in range(count)]).T
    used = (own > LEAST_OWN_POWER * power[:, :count]) & (power[:, count:] > 0.0)
    response, partial = np.zeros((count, len(density)), dtype=np.complex128), np.zeros((count, len(density)))
    multiple = np.zeros(len(density))
    for pattern in np.unique(used[used.any(axis=1)], axis=0):  # lines in which the same inputs have power of their own
        lines, inputs = np.flatnonzero((used == pattern).all(axis=1)), np.flatnonzero(pattern)
        some = density[lines]
        among = some[:, inputs[:, None], inputs]
        response[np.ix_(inputs, lines)] = np.linalg.solve(among, some[:, inputs, count, None])[..., 0].T
        residual = _residual_power(some, inputs, count)
        for j in inputs:
            without = _residual_power(some, inputs[inputs != j], count)
            known = without > 0.0
            partial[j, lines[known]] = np.maximum(0.0, 1.0 - residual[known] / without[known])
        multiple[lines] = 1.0 - residual / power[lines, count]
    return response, partial, multiple


def _residual_power(density: CrossDensities, inputs: "Sequence[int] | NDArray[np.intp]", output: int) -> Floats:
    """Power density of a channel that inputs, which may be linearly dependent, do not explain, (m,)."""
    power = density[:, output, output].real
    if not len(inputs):
        return power
    rows = np.asarray(inputs)
    size = np.sqrt(density[:, rows, rows].real)
    size[size == 0.0] = 1.0
    among = density[:, rows[:, None], rows] / (size[:, :, None] * size[:, None, :])
    cross = density[:, rows, output] / size
    inverse = among if len(rows) == 1 else np.linalg.pinv(among, rcond=1e-9, hermitian=True)  # of one it is 1, or 0
    explained = np.einsum("mi,mij,mj->m", cross.conj(), inverse, cross)
    return np.maximum(0.0, power - explained.real)
