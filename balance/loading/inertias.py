"""What no rigid body has: a negative mass, principal inertias of which one exceeds the sum of the others."""

from collections.abc import Sequence

import numpy as np

from ..arrays import Floats
from ..errors import ModelError

ROUNDING = 1e-6
"""Of inertias in a file: what they may miss the triangle inequality by, relative to those about the joint."""


def refuse_impossible(name: str, bodies: Sequence[str], parameters: Floats) -> None:
    """Raise ModelError, naming the file and the body, if ``parameters`` (bodies, 10) [SI] are of no rigid body.

    A body that moves in a plane only may have any inertias about the other axes, but no file says so: they are refused
    alike, as MuJoCo does. With the inertia tensor I_c about the centre of mass, positive definite
    Sigma = tr(I_c)/2 1 - I_c is the condition (Wensing, Kim, Slotine 2018).
    """
    if not np.any(parameters[:, 0] > 0.0):
        raise ModelError(f"{name}: no moving body has mass; give each an <inertial>, or geometry with a density")
    for body, row in zip(bodies, parameters, strict=True):
        low, middle, high = principal_inertias(row)
        if row[0] < 0.0 or low + middle < high - ROUNDING * abs(row[[4, 6, 9]]).sum():
            raise ModelError(
                f"{name}: body {body!r} (with what is fixed to it) has mass {row[0]:.6g} kg and principal inertias "
                f"{low:.6g}, {middle:.6g}, {high:.6g} kg m2 about its centre of mass: no body has one larger than the "
                "sum of the other two; is the inertia about another point than the centre of mass?"
            )


def principal_inertias(row: Floats) -> Floats:
    """Principal moments of inertia about the centre of mass of a body's ten parameters, rising, (3,) [kg m2]."""
    mass, first = row[0], row[1:4]
    xx, xy, yy, xz, yz, zz = row[4:]
    about_origin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if mass > 0.0:
        about_origin = about_origin - (first @ first * np.eye(3) - np.outer(first, first)) / mass
    return np.linalg.eigvalsh(about_origin)
