"""Conditions of static balance, found from the model: what keeps the potential energy of weight constant."""

import numpy as np

from ..closure import Closure
from ..combinations import echelon, row_space
from ..conditions import Conditions, pivot_order
from ..dynamics.regressor import potential_regressor
from ..errors import ModelError
from ..mechanism import Mechanism


def find(mechanism: Mechanism) -> Conditions:
    """Conditions on the inertial parameters for which weight does no work in any motion; residuals in kg m.

    V = W(q) @ pi is constant where pi is orthogonal to the rows of W less their mean over closed configurations.
    Force balance implies them; a body that only moves level needs no static balance.
    """
    if not mechanism.gravity.any():
        raise ModelError(f"{mechanism.name}: its file has no gravity: every mass is balanced statically")
    closure = Closure(mechanism)
    q = closure.states(max(48, 4 * len(mechanism.bodies) * 4))
    rows = potential_regressor(mechanism, q) / float(np.linalg.norm(mechanism.gravity))
    basis, gap = row_space(rows - rows.mean(axis=0), mechanism.name)
    return Conditions(mechanism, closure.dof, echelon(basis, pivot_order(mechanism)), gap)
