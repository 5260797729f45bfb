"""Gravity on a base that moves: what the weight does as the platform wanders and the base tilts.

The mounts carry the weight at rest, and sensors are zeroed there. Left out is what the weight adds to the mounts'
stiffness, like that of a pendulum upside down: m g h beside their turning stiffness, some 0.2 % on the default frame.
"""

import numpy as np

from balance.arrays import Floats


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
