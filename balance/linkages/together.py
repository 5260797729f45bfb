"""Whether bodies that are said to turn together do."""

import numpy as np

from ..closure import Closure
from ..errors import ModelError
from ..loading.loading import mechanism_from_text
from .method import Balance
from .model import mjcf
from .skeleton import skeleton

STATES = 8
"""Configurations, about the start, at which their angular velocities are compared."""


def check_turns(result: Balance) -> None:
    """Raise ModelError for bodies that are said to turn together and do not, by velocities that the joints allow."""
    linkage = result.linkage
    if not linkage.turns_with:
        return
    mechanism = mechanism_from_text(mjcf(result, "before", together=False), linkage.name)
    closure = Closure(mechanism)
    rates = closure.velocities(closure.states(STATES, step=0.02))
    tree = skeleton(result, together=False)

    def spin(body: str) -> np.ndarray:
        joints = [mechanism.coordinate_index(joint.name) for _, joint in tree.path(body) if joint.revolute]
        return rates[:, joints].sum(axis=1)

    for first, second in linkage.turns_with:
        apart = float(np.abs(spin(first) - spin(second)).max())
        if apart > 1e-9 * float(np.abs(rates).max()):
            raise ModelError(
                f"turns_with: bodies {first} and {second} of {linkage.name} do not turn together: their angular "
                "velocities differ"
            )
