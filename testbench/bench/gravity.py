"""Gravity on a base that moves: what the weight does as the platform wanders and the base tilts.

The mounts carry the weight at rest, and sensors are zeroed there. As the base turns, the weight acts at another place,
and so do the forces of the mounts that hold it: a pendulum upside down, some 0.2 % of the default frame's stiffness.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.dynamics.moving_base import displacement_at, first_moment, skew

if TYPE_CHECKING:
    from ..rig.bench import Mount


def rotation(turn: Floats) -> Floats:
    """Rotation matrix of a rotation vector (3,) [rad], (3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(turn).as_matrix())


def tilted(gravity: Floats, turn: Floats) -> Floats:
    """Gravity (3,) in the axes of a base that rests turned by ``turn`` (3,) [rad]: R' g."""
    return rotation(turn).T @ gravity


def wandering(weight_moment: Floats) -> Floats:
    """Wrench of the weight less that at rest, (n, 6), from its moment (n, 3): constant weight, wandering place."""
    return np.hstack([np.zeros_like(weight_moment), weight_moment - weight_moment[0]])


def apparent(gravity: Floats, displacement: Floats) -> Floats:
    """What a base displaced by (u, phi), (n, 6), makes accelerometers show: R' (-g) + g = phi x g, (n, 3) [m/s2]."""
    return np.cross(displacement[:, 3:], gravity)


def turned_weight(gravity: Floats, first: Floats, mass: float, displacement: Floats) -> Floats:
    """Change of the weight's wrench in base axes as the base turns, (n, 6) [N, N m]: -phi x W, at the centre of mass.

    ``first`` is the first moment of mass (n, 3) [kg m].
    """
    change = -apparent(gravity, displacement)
    return np.hstack([mass * change, np.cross(first, change)])


def stiffness(mounts: "Sequence[Mount]", elastic: Floats, mass: Floats, gravity: Floats) -> Floats:
    """What weight and preload of the mounts add to the ``elastic`` stiffness of the mounts, (6, 6) each [N m/rad].

    A force f at p of the base, constant in space, has the moment (p + phi x p) x f about the base's origin, so it adds
    -S(f) S(p); here the weight at the centre of mass, and what each mount holds of it at rest.
    """
    first, total = first_moment(mass), float(mass[0, 0])
    sunk = np.linalg.solve(elastic, np.concatenate([total * gravity, np.cross(first, gravity)]))
    added = np.zeros((6, 6))
    added[3:, 3:] = -skew(gravity) @ skew(first)
    for mount in mounts:
        at = np.array(mount.position)
        held = -np.array(mount.stiffness) * (displacement_at(at) @ sunk)
        added[3:, 3:] -= skew(held) @ skew(at)
    return added
