"""Real gears: a disc has the pitch diameter 2 a Z / (Z + Z*), a the distance of the two axes."""

from collections.abc import Mapping

import numpy as np

from ..errors import ModelError
from .description import GROUND, Gear, Linkage
from .loads import pin


def wheel(
    linkage: Linkage, tree: Mapping[str, str], values: Mapping[str, float], gear: Gear, joint: str, carrier: str
) -> tuple[float, float]:
    """Mass [kg] and inertia [kg m2] of the gear on the body: m d^2 / 8 of a disc; zero where nothing is given."""
    given = gear.wheel
    if given is None:
        return 0.0, 0.0
    if given.diameter is None:
        return given.mass, given.inertia
    diameter = _pitch_diameter(linkage, tree, values, gear, joint, carrier)
    mass = given.mass * (diameter / given.diameter) ** 2
    return mass, mass * diameter**2 / 8.0


def _pitch_diameter(
    linkage: Linkage, tree: Mapping[str, str], values: Mapping[str, float], gear: Gear, joint: str, carrier: str
) -> float:
    if carrier == GROUND and gear.pivot is None:
        raise ModelError(
            f"gear {gear.name}: a disc on the ground needs the pivot of its counter-gear: "
            "counter = { on = 'ground', at = [...] }"
        )
    pivot = gear.pivot if gear.pivot is not None else pin(linkage, tree[carrier], carrier)
    distance = float(np.linalg.norm(pivot.plus(pin(linkage, joint, carrier), -1.0).at(values)))
    if not distance > 0:
        raise ModelError(f"gear {gear.name}: both gears would sit on one axis: give its counter-gear another pivot")
    return 2.0 * distance * gear.teeth[0] / sum(gear.teeth)
