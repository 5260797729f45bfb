"""What a drive feels apart from the bodies it moves, linear in parameters of its joint: friction, rotor, offset.

tau = ... + coulomb sign(v) + viscous v + offset + armature a
"""

from collections.abc import Sequence

import numpy as np

from ..arrays import Floats

COULOMB_SPEED = 0.05
"""Speed at which dry friction has reached 76 % of its value [rad/s, m/s]: a sign that has noise about zero is none."""
TERMS = ("coulomb", "viscous", "offset", "armature")
"""Dry friction [N m], viscous friction [N m s], offset [N m], inertia of the drive [kg m2]; for slides, N ..."""


def joint_terms(joints: Sequence[str], v: Floats, a: Floats) -> tuple[Floats, tuple[str, ...]]:
    """Columns for the TERMS of each joint, (n, joints, 4 joints), and their names, such as ``coulomb[J1]``.

    ``v`` [rad/s, m/s] and ``a`` are those of the joints, (n, joints).
    """
    count, size = v.shape
    columns = np.zeros((count, size, size, len(TERMS)))
    diagonal = np.arange(size)
    terms = np.stack([np.tanh(v / COULOMB_SPEED), v, np.ones_like(v), a], axis=2)
    columns[:, diagonal, diagonal] = terms
    names = tuple(f"{term}[{joint}]" for joint in joints for term in TERMS)
    return columns.reshape(count, size, -1), names
