"""Supports of a rig: the force sensors that carry the mechanism.

Mechanism and base are rigid between the supports, each support is a spring along the axes that its sensor measures and
free along the others. A relative displacement d then loads support i at p_i with f_i = k_i J_i d, and the wrench on the
base is w = sum J_i' f_i, so f_i = k_i J_i (sum J_i' k_i J_i)^-1 w: of all distributions that add up to w, the one of
least elastic energy.
"""

from collections.abc import Mapping

import numpy as np

from balance.arrays import Floats
from balance.dynamics.moving_base import skew

from ..errors import RigError
from .sensors import Support


def wrench_transport(point: Floats) -> Floats:
    """Matrix from the wrench (F, M) about ``point`` (3,) [m] to that about the origin, (6, 6): M_0 = M + point x F."""
    return np.block([[np.eye(3), np.zeros((3, 3))], [skew(point), np.eye(3)]])


def support_wrenches(supports: Mapping[str, Support]) -> dict[str, Floats]:
    """For each support, the matrix from the wrench about the origin to its own about its position, (6, 6) [SI].

    Raises RigError if the supports cannot carry every wrench.
    """
    if not supports:
        return {}
    stiffness = {name: np.diag(support.axis_stiffness) for name, support in supports.items()}
    to_origin = {name: wrench_transport(np.array(support.position)) for name, support in supports.items()}
    total = sum((to_origin[n] @ stiffness[n] @ to_origin[n].T for n in supports), np.zeros((6, 6)))
    scale = np.sqrt(np.diag(total))
    if (scale == 0.0).any() or np.linalg.cond(total / np.outer(scale, scale)) > 1e12:
        raise RigError(
            f"sensors: the supports {', '.join(supports)} cannot carry every force and moment between mechanism and "
            "base: add the supports that are missing, or remove the force sensors"
        )
    return {name: stiffness[name] @ to_origin[name].T @ np.linalg.inv(total) for name in supports}
