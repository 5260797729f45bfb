"""Base parameters of a mechanism: the combinations that a record determines, by least squares, and what follows.

tau = W pi, W = W[pivots] @ combinations: the base parameters b = combinations @ pi are solved for, nothing else.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats
from .estimate import Estimate
from .identifiability import Identifiability
from .regression import RegressionFit, RegressionRecord, fit


@dataclass(frozen=True)
class BaseParameters:
    """Base parameters as identified."""

    identifiability: Identifiability
    fit: RegressionFit

    @property
    def values(self) -> Floats:
        """(r,) [SI]"""
        return self.fit.values

    @property
    def covariance(self) -> Floats:
        """(r, r) [SI]"""
        return self.fit.covariance

    def estimate(self, combination: Mapping[str, float] | Floats) -> Estimate:
        """Any identifiable combination, by names or as a vector over all parameters (p,).

        Raises NotIdentifiable, naming it, if the record does not determine it.
        """
        known = self.identifiability
        vector = known.vector(combination) if isinstance(combination, Mapping) else combination
        return self.fit.estimate(known.share(vector))

    def predict(self, regressor: Floats) -> Floats:
        """Torques [N m, N] of a regressor (n, rows, p), (n, rows)."""
        return np.asarray(self.identifiability.base_columns(regressor) @ self.values)


def base_parameters(record: RegressionRecord, identifiability: Identifiability) -> BaseParameters:
    """From a record whose columns are those of the base parameters, or of all parameters, which are reduced to them.

    Raises DataError where there are too few blocks.
    """
    if record.columns.shape[2] != identifiability.rank:
        record = replace(record, columns=identifiability.base_columns(record.columns))
    return BaseParameters(identifiability, fit([record], conditions=identifiability.first_moments))
