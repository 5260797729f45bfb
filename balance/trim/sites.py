"""What masses at sites do to the values of the balance conditions, and a mechanism that has given values."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..arrays import Floats
from ..conditions import Conditions
from ..mechanism import Mechanism


def shares_of(conditions: Conditions, mechanism: Mechanism, sites: Sequence[str]) -> Floats:
    """The mass that each site lacks per unit of each condition's value, (sites, rank) [1/m]: m = -B^+ c."""
    return -np.linalg.pinv(site_columns(conditions, mechanism, sites), rcond=1e-12)


def site_columns(conditions: Conditions, mechanism: Mechanism, sites: Sequence[str]) -> Floats:
    """What a kilogram at each site adds to each condition's value, B of C pi + B m = 0, (rank, sites) [m]."""
    columns = [conditions.matrix @ (mechanism.with_counter_mass({site: 1.0}).pi - mechanism.pi) for site in sites]
    return np.array(columns).T


def adjusted(conditions: Conditions, mechanism: Mechanism, values: Floats) -> Mechanism:
    """The mechanism with the least change of its parameters that gives the conditions these values (rank,) [kg m]."""
    change = np.linalg.pinv(conditions.matrix) @ (values - conditions.values(mechanism))
    parameters = mechanism.parameters + change.reshape(mechanism.parameters.shape)
    parameters.setflags(write=False)
    return replace(mechanism, parameters=parameters)


def columns_of(conditions: Conditions, regressor: Floats) -> Floats:
    """The columns that the values of the conditions multiply, of a force regressor (n, 3, 10 nb), (n, 3, rank)."""
    pivots = [int(np.flatnonzero(row)[0]) for row in conditions.matrix]
    return np.asarray(regressor[:, :, pivots])
