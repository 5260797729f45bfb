"""Frequency response between channels that were sampled together: gain, phase, coherence, and how sure they are."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats

from ..errors import AnalysisError
from .densities import welch

LEAST_SEGMENTS = 4.0
"""Independent segments below which a coherence says nothing: of one segment it is 1, whatever was recorded."""


@dataclass(frozen=True)
class Transfer:
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


def transfer(given: Floats, answer: Floats, rate_hz: float, segment: int) -> Transfer:
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
    return Transfer(found.frequency, response, np.minimum(coherence, 1.0), found.independent)
