"""Gears as couplings of joint coordinates: a counter-gear's angle is linear in those of the linkage.

Relative to the carrier it turns -(Z/Z*) times as far as the body does; in a plane the angle of a body is the sum of the
revolute coordinates towards the base, so the coupling holds for velocities and accelerations alike.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats
from ..closure import Trajectory
from ..mechanism import Mechanism
from .description import GROUND
from .method import Balance
from .skeleton import Skeleton, skeleton


@dataclass(frozen=True)
class Couplings:
    """Rates of the counter-gears' joints per rate of the linkage's."""

    rates: Mapping[str, Mapping[str, float]]
    """By counter-gear joint: factors by joint of the linkage."""

    @classmethod
    def of(cls, result: Balance) -> "Couplings":
        """The couplings of all gears of a balanced linkage."""
        tree, rates = skeleton(result), {}
        for name, gear in (result.moment.gears if result.moment else {}).items():
            relative = dict(_turns(tree, gear.gear.body))
            for joint, factor in _turns(tree, gear.carrier).items():
                relative[joint] = relative.get(joint, 0.0) - factor
            rates[f"{name}*"] = {joint: -gear.gear.ratio * factor for joint, factor in relative.items() if factor}
        return cls(rates)

    def extend(self, trajectory: Trajectory, linkage: Mechanism, geared: Mechanism) -> Trajectory:
        """A trajectory of the linkage as one of the same linkage with its counter-gears."""
        matrix = np.zeros((len(geared.coordinates), len(linkage.coordinates)))
        for row, name in enumerate(geared.coordinates):
            for joint, factor in self.rates.get(name, {name: 1.0}).items():
                matrix[row, linkage.coordinate_index(joint)] = factor
        return replace(
            trajectory,
            mechanism=geared.name,
            q=_times(trajectory.q, matrix),
            v=_times(trajectory.v, matrix),
            a=_times(trajectory.a, matrix),
            per_drive=np.einsum("ij,njk->nik", matrix, trajectory.per_drive),
        )


def _turns(tree: Skeleton, body: str) -> dict[str, float]:
    """Revolute coordinates whose sum is the angle of a body."""
    if body == GROUND:
        return {}
    return {joint.name: 1.0 for _, joint in tree.path(body) if joint.revolute}


def _times(samples: Floats, matrix: Floats) -> Floats:
    return np.ascontiguousarray(samples @ matrix.T)
