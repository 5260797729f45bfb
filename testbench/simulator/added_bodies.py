"""What a rig adds to the mechanism of a file: planes of bodies and counter-masses, rotors of the motors.

Bodies in different planes still tip the base about x and y when they are balanced in projection. A rotor of inertia J
that turns N times as fast as its joint adds the angular momentum J N q' about its axis, hence the moment -J N q'' on
the base and the torque J N^2 q'' on its joint. The drive torque itself is internal: a motor exerts it on its joint and
back on the base, and the shaking moment -d(angular momentum)/dt contains both.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from balance.arrays import Floats
from balance.dynamics.moving_base import rigid_body, skew
from balance.errors import ModelError
from balance.mechanism.mechanism import Mechanism

from ..errors import RigError
from ..rig.bench import Rider, Rotor


def with_planes(mechanism: Mechanism, planes: Mapping[str, float]) -> Mechanism:
    """The mechanism with bodies, and sites of counter-masses, moved by ``planes`` [m] along what the body turns about.

    Raises RigError for what is neither a body nor a site of a moving body.
    """
    for name, z in planes.items():
        if name in mechanism.own_mass:
            mechanism = _with_body(mechanism, name, z)
        elif name in mechanism.sites and mechanism.sites[name].body >= 0:
            site = mechanism.sites[name]
            moved = replace(site, position=site.position + z * site.axis)
            mechanism = replace(mechanism, sites={**mechanism.sites, name: moved})
        else:
            known = [*mechanism.own_mass, *(n for n, site in mechanism.sites.items() if site.body >= 0)]
            raise RigError(f"bench.planes: {mechanism.name} has no body or site {name!r}: there are {', '.join(known)}")
    return mechanism


def _with_body(mechanism: Mechanism, body: str, z: float) -> Mechanism:
    index, own = mechanism.own_mass[body]
    at = mechanism.anchor(body, np.zeros(3))
    moved = moved_frame(own, z * mechanism.tree.normal(at.joint, at.rotation))
    parameters = mechanism.parameters.copy()
    parameters[index] += moved - own
    return replace(mechanism, parameters=parameters, own_mass={**mechanism.own_mass, body: (index, moved)})


def moved_frame(row: Floats, by: Floats) -> Floats:
    """Inertial parameters (10,) [kg, kg m, kg m2] of a body after moving it ``by`` (3,) [m] in its frame.

    With first moment h: h' = h + m d, and the inertia grows by that of h d' + d h' + m d d'.
    """
    mixed = np.outer(row[1:4], by)
    grown = mixed + mixed.T + row[0] * np.outer(by, by)
    about = np.trace(grown) * np.eye(3) - grown
    return row + np.array([0.0, *(row[0] * by), *about[np.triu_indices(3)][[0, 1, 3, 2, 4, 5]]])


def inertial_parameters(mass: float, centre: Floats, inertia: Floats) -> Floats:
    """Those of a body, (10,) [kg, kg m, kg m2], of ``inertia`` (3, 3) [kg m2] about its ``centre`` (3,) [m]."""
    about = inertia[np.triu_indices(3)][[0, 1, 3, 2, 4, 5]]
    return moved_frame(np.array([mass, 0.0, 0.0, 0.0, *about]), centre)


def with_rotors(mechanism: Mechanism, rotors: Mapping[str, Rotor]) -> Mechanism:
    """The mechanism with the rotors' inertia at their joints. Raises RigError for an unknown joint."""
    armature = mechanism.armature.copy()
    for joint, rotor in rotors.items():
        armature[_index(mechanism, joint)] += rotor.inertia * rotor.ratio**2
    return replace(mechanism, armature=armature)


def rotor_momentum(mechanism: Mechanism, rotors: Mapping[str, Rotor], rates: Floats) -> Floats:
    """Angular momentum of the rotors at joint ``rates`` (n, nv) [rad/s], base axes, (n, 3) [kg m2/s].

    Joint accelerations [rad/s2] instead of rates give its rate [N m].
    """
    total = np.zeros((len(rates), 3))
    for joint, rotor in rotors.items():
        axis = np.array(rotor.axis) / np.linalg.norm(rotor.axis)
        total += rotor.inertia * rotor.ratio * rates[:, [_index(mechanism, joint)]] * axis
    return total


def rider_inertia(rider: Rider) -> Floats:
    """Inertia of what rides on the force sensors about the base frame's origin, (6, 6) [kg, kg m, kg m2]."""
    centre = np.array(rider.centre)
    about = np.diag(rider.inertia) - rider.mass * skew(centre) @ skew(centre)
    return rigid_body(rider.mass, rider.mass * centre, about)


def _index(mechanism: Mechanism, joint: str) -> int:
    try:
        return mechanism.coordinate_index(joint)
    except ModelError as error:
        raise RigError(f"bench.rotors: {error}") from error
