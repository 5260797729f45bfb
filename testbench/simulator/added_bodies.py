"""Bodies and counter-masses in planes of their own: balanced in projection, they still tip the base about x and y.

Rotors of motors on the base: their angular momentum, which the mechanism's file lacks, and the torque that it costs.

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
from balance.mechanism.mechanism import Mechanism

from ..errors import RigError

if TYPE_CHECKING:
    from ..rig.bench import Rotor


def with_planes(mechanism: Mechanism, planes: Mapping[str, float]) -> Mechanism:
    """The mechanism with bodies, and counter-masses that are mounted later, moved out along the body's z axis [m].

    Raises RigError for what is neither a body nor a site of a moving body.
    """
    for name, z in planes.items():
        if name in mechanism.own_mass:
            mechanism = _with_body(mechanism, name, z)
        elif name in mechanism.sites and mechanism.sites[name].body >= 0:
            site = mechanism.sites[name]
            moved = replace(site, position=site.position + [0.0, 0.0, z])
            mechanism = replace(mechanism, sites={**mechanism.sites, name: moved})
        else:
            known = [*mechanism.own_mass, *(n for n, site in mechanism.sites.items() if site.body >= 0)]
            raise RigError(f"bench.planes: {mechanism.name} has no body or site {name!r}: there are {', '.join(known)}")
    return mechanism


def _with_body(mechanism: Mechanism, body: str, z: float) -> Mechanism:
    index, own = mechanism.own_mass[body]
    moved = shifted(own, z)
    parameters = mechanism.parameters.copy()
    parameters[index] += moved - own
    return replace(mechanism, parameters=parameters, own_mass={**mechanism.own_mass, body: (index, moved)})


def shifted(row: Floats, z: float) -> Floats:
    """Inertial parameters (10,) of a body that is moved by z along its z axis [m].

    mcz' = mcz + m z, Ixx' = Ixx + 2 z mcz + m z^2 and Iyy alike, Ixz' = Ixz - z mcx, Iyz' = Iyz - z mcy.
    """
    m, x, y, first = row[:4]
    steiner = z * (2.0 * first + m * z)
    return row + np.array([0.0, 0.0, 0.0, m * z, steiner, 0.0, steiner, -z * x, -z * y, 0.0])


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
