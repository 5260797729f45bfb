"""Shaking force per acceleration of the payload, at rest in the home configuration."""

from dataclasses import replace

import numpy as np

from .closure import Closure
from .drive import PointDrive
from .dynamics import simulate
from .errors import ClosureError
from .mechanism import Mechanism
from .motion import Samples


def shaking_force_per_acceleration(mechanism: Mechanism, body: str) -> float | None:
    """Largest shaking force per acceleration of a body's centre in the plane x-y, whatever its direction [N/(m/s2)].

    None where the position of that body does not determine the mechanism, so that there is no such number.
    """
    closure = Closure(mechanism)
    drive = PointDrive.of(mechanism, body, ("x", "y"))
    if drive.size != closure.dof:
        return None
    at = drive.value(mechanism, closure.home)
    rest = Samples(np.zeros(1), at[None], np.zeros((1, 2)), np.zeros((1, 2)), point=body)
    try:
        columns = [
            simulate(replace(mechanism, driven=()), closure.follow(replace(rest, acceleration=unit[None]))).force[0]
            for unit in np.eye(2)
        ]
    except ClosureError:
        return None
    return float(np.linalg.svd(np.array(columns), compute_uv=False)[0])
