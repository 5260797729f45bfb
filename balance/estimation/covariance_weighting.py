"""Values of the balance conditions from several sources: weighted by their covariances, and whether they agree.

c = (sum L_i)^-1 sum L_i c_i with L_i the inverse covariance of source i, zero where it determines nothing. Where the
sources agree, sum (c_i - c)' L_i (c_i - c) is distributed as chi-square; covariances are estimates, so that it is
compared with Fisher's F (per degree of freedom), which leaves more room.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from ..arrays import Floats
from ..results import Key
from .estimate import effective_degrees_of_freedom, f_tail
from .first_moment_imbalance import Imbalance, Subspace

CONTRADICT = 1e-3
"""Probability of such a disagreement by chance, below which sources contradict each other."""
_FIXED = 1e-12
"""Variance, relative to the largest of a source, below which a direction was not estimated but fixed."""


@dataclass(frozen=True)
class CombinedImbalance:
    """The weighted values, and the agreement."""

    imbalance: Imbalance
    chi_square: Annotated[float, Key()]
    degrees_of_freedom: Annotated[int, Key("freedom")]
    """Of chi-square: what more than one source determines."""
    probability: Annotated[float, Key()]
    """Of a disagreement at least as large by chance; 1 where nothing is determined twice."""

    @property
    def agrees(self) -> Annotated[bool, Key()]:
        """Whether the sources do not contradict each other."""
        return self.probability >= CONTRADICT


def combine(sources: Sequence[Imbalance]) -> CombinedImbalance:
    """The sources together; each as excited as it must be for what is asked of it."""
    weights = [_inverse(one.covariance) for one in sources]
    whole = np.sum(weights, axis=0)
    covariance = _inverse(whole)
    rank = int(np.linalg.matrix_rank(whole, hermitian=True))
    fixed = sources[0].values if sources[0].subspace.is_whole else sources[0].subspace.start
    away = np.sum([w @ (one.values - fixed) for w, one in zip(weights, sources, strict=True)], axis=0)
    values = fixed + covariance @ away
    chi = sum(float((one.values - values) @ w @ (one.values - values)) for w, one in zip(weights, sources, strict=True))
    freedom = sum(int(np.linalg.matrix_rank(w, hermitian=True)) for w in weights) - rank
    shares = np.array([np.trace(w @ covariance) / rank for w in weights])
    each = np.array([one.degrees_of_freedom for one in sources])
    sizes, directions = np.linalg.eigh(covariance)
    subspace = Subspace(directions[:, sizes > _FIXED * sizes[-1]].T, fixed)
    combined = Imbalance(
        sources[0].conditions,
        values,
        covariance,
        subspace,
        np.eye(len(subspace.directions)),
        max(one.unexplained for one in sources),
        effective_degrees_of_freedom(shares, each),
    )
    probability = f_tail(chi / freedom, freedom, float(each.min())) if freedom > 0 else 1.0
    return CombinedImbalance(combined, chi, freedom, probability)


def _inverse(covariance: Floats) -> Floats:
    return np.asarray(np.linalg.pinv(0.5 * (covariance + covariance.T), rcond=_FIXED, hermitian=True))
