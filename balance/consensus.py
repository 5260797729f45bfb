"""Values of the balance conditions from several sources: weighted by their covariances, and whether they agree.

c = (sum L_i)^-1 sum L_i c_i with L_i the inverse covariance of source i, zero where it tells nothing. Where the sources
agree, sum (c_i - c)' L_i (c_i - c) is distributed as chi-square; covariances are estimates themselves, so that it is
compared with Fisher's F (per degree of freedom), which leaves more room.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import Floats
from .trim import Free, Imbalance

CONTRADICT = 1e-3
"""Probability of such a disagreement by chance, below which sources contradict each other."""
_NOTHING = 1e-12
"""Variance, relative to the largest of a source, below which a direction was not found but held."""


@dataclass(frozen=True)
class Consensus:
    """The weighted values, and the agreement."""

    imbalance: Imbalance
    chi_square: float
    freedom: int
    """Of chi-square: what is told more than once."""
    probability: float
    """Of a disagreement at least as large by chance; 1 where nothing is told twice."""

    @property
    def agrees(self) -> bool:
        """Whether the sources do not contradict each other."""
        return self.probability >= CONTRADICT


def consensus(sources: Sequence[Imbalance]) -> Consensus:
    """What the sources say together; each as excited as it must be for what is asked of it."""
    weights = [_inverse(one.covariance) for one in sources]
    whole = np.sum(weights, axis=0)
    covariance = _inverse(whole)
    rank = int(np.linalg.matrix_rank(whole, hermitian=True))
    held = sources[0].free.start if len(sources[0].free.directions) < len(whole) else sources[0].values
    told = covariance @ np.sum([w @ (one.values - held) for w, one in zip(weights, sources, strict=True)], axis=0)
    values = held + told
    chi = sum(float((one.values - values) @ w @ (one.values - values)) for w, one in zip(weights, sources, strict=True))
    freedom = sum(int(np.linalg.matrix_rank(w, hermitian=True)) for w in weights) - rank
    shares = [float(np.trace(w @ covariance)) / rank for w in weights]
    effective = 1.0 / sum(share**2 / one.freedom for share, one in zip(shares, sources, strict=True))
    sizes, directions = np.linalg.eigh(covariance)
    free = Free(directions[:, sizes > _NOTHING * sizes[-1]].T, held)
    combined = Imbalance(
        sources[0].conditions,
        values,
        covariance,
        int(effective),
        free,
        np.eye(len(free.directions)),
        max(one.unexplained for one in sources),
    )
    spare = min(one.freedom for one in sources)
    return Consensus(combined, chi, freedom, _probability(chi, freedom, spare))


def _inverse(covariance: Floats) -> Floats:
    return np.asarray(np.linalg.pinv(0.5 * (covariance + covariance.T), rcond=_NOTHING, hermitian=True))


def _probability(chi_square: float, freedom: int, spare: int) -> float:
    if freedom < 1:
        return 1.0
    from scipy.special import fdtrc

    return float(fdtrc(freedom, spare, chi_square / freedom))
