"""Rotors of motors on the base: their angular momentum, which the mechanism's file lacks, and the torque that it costs.

Drive torque itself is internal: what a motor exerts on its joint it exerts back on the base, and the shaking moment
-d(angular momentum)/dt holds both. A rotor of inertia J that turns N times as fast as its joint adds the angular
momentum J N q' about its axis, so the moment -J N q'' on the base, and the torque J N^2 q'' on its own joint.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.errors import ModelError
from balance.mechanism import Mechanism

from ..errors import RigError

if TYPE_CHECKING:
    from ..rig.effects import Rotor


def with_rotors(mechanism: Mechanism, rotors: "Mapping[str, Rotor]") -> Mechanism:
    """The mechanism with the rotors' inertia at their joints. Raises RigError for a joint that it has not."""
    armature = mechanism.armature.copy()
    for joint, rotor in rotors.items():
        armature[_index(mechanism, joint)] += rotor.inertia * rotor.ratio**2
    return replace(mechanism, armature=armature)


def momentum(mechanism: Mechanism, rotors: "Mapping[str, Rotor]", rates: Floats) -> Floats:
    """Angular momentum of the rotors, base axes, (n, 3) [kg m2/s], at joint rates (n, nv); its rate at their rates."""
    total = np.zeros((len(rates), 3))
    for joint, rotor in rotors.items():
        axis = np.array(rotor.axis) / np.linalg.norm(rotor.axis)
        total += rotor.inertia * rotor.ratio * rates[:, [_index(mechanism, joint)]] * axis
    return total


def _index(mechanism: Mechanism, joint: str) -> int:
    try:
        return mechanism.coordinate_index(joint)
    except ModelError as error:
        raise RigError(f"bench.rotors: {error}") from error
