"""Bodies that only translate: each is a point mass at its revolute joint."""

import numpy as np

from ..errors import SizingError
from .description import GROUND, Linkage
from .loads import ForceBalance


def check_point_mass(linkage: Linkage, force: ForceBalance, extra: ForceBalance) -> None:
    """Raise SizingError where a translating body is no point mass at its joint for the moment too.

    It is one where its centre of mass lies in that joint, or on the line along which that joint slides.
    """
    first, mass = force.residual + extra.residual, force.mass + extra.mass
    off = float(np.linalg.norm(first))
    scale = mass * max((float(np.linalg.norm(c.position)) for c in force.counters), default=0.0) + off
    slides = [j for j in linkage.joints_of(force.body, revolute=False) if j.other(force.body) == GROUND]
    if slides:
        along = slides[0].end(force.body).along
        off = abs(float(np.cos(along) * first[1] - np.sin(along) * first[0]))
    if off > 1e-12 * scale:
        raise SizingError(
            f"body {force.body} only translates, and its centre of mass moves {off / mass:.4g} m beside its joint "
            f"{force.joint}: its moment would remain; give it a counter_mass"
        )
