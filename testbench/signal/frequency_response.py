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
from .welch import welch

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


def frequency_response(inputs: Sequence[Floats], answer: Floats, rate_hz: float, segment: int) -> FrequencyResponse:
    """From q inputs to an output, (n,) each [any unit]; ``segment`` in samples.

    Raises AnalysisError where there are too few segments for so many inputs.
    """
    found, count = welch([*inputs, answer], rate_hz, segment), len(inputs)
    segments = found.independent - (count - 1)
    if segments < LEAST_SEGMENTS:
        raise AnalysisError(
            f"{len(answer)} samples are {found.independent:.1f} independent segments of {segment}: expected at least "
            f"{LEAST_SEGMENTS + count - 1:g} for {count} inputs; take shorter segments or record for longer"
        )
    lines = [_at_line(density, count) for density in np.moveaxis(found.density, 2, 0)]
    response, coherence, multiple = (np.array(each).T for each in zip(*lines, strict=True))
    return FrequencyResponse(found.frequency, response, coherence, multiple, segments)


def _at_line(density: NDArray[np.complex128], count: int) -> tuple[NDArray[np.complex128], Floats, float]:
    """Responses, partial coherences and the multiple one, of densities (q + 1, q + 1), the output's last."""
    output_power = float(density[count, count].real)
    used = [
        j
        for j in range(count)
        if (power := float(density[j, j].real)) > 0.0
        and _residual_power(density, [i for i in range(count) if i != j], j) / power > LEAST_OWN_POWER
    ]
    response, partial = np.zeros(count, dtype=np.complex128), np.zeros(count)
    if not used or not output_power > 0.0:
        return response, partial, 0.0
    response[used] = np.linalg.solve(density[np.ix_(used, used)], density[used, count])
    residual = _residual_power(density, used, count)
    for j in used:
        without = _residual_power(density, [i for i in used if i != j], count)
        partial[j] = max(0.0, 1.0 - residual / without) if without > 0.0 else 0.0
    return response, partial, 1.0 - residual / output_power


def _residual_power(density: NDArray[np.complex128], inputs: Sequence[int], output: int) -> float:
    """Power density of a channel that inputs, which may be linearly dependent, do not explain."""
    power = float(density[output, output].real)
    if not inputs:
        return power
    size = np.sqrt(density[inputs, inputs].real)
    size[size == 0.0] = 1.0
    among = density[np.ix_(inputs, inputs)] / np.outer(size, size)
    cross = density[inputs, output] / size
    return max(0.0, power - float((cross.conj() @ np.linalg.pinv(among, rcond=1e-9, hermitian=True) @ cross).real))
