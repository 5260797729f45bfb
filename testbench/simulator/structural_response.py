"""Elastic modes of the frame: each a lightly damped oscillator that the mechanism's wrench excites.

With psi the mode's shape where the mechanism stands (translation and rotation) and W what the mechanism exerts on the
base: m (e'' + 2 z w e' + w^2 e) = psi W; a sensor whose shape is s is accelerated by s e'' more. The shapes are those
of the free frame, so that the modes leave its motion as a rigid body alone; what the mounts do to them is left out.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.dynamics.moving_base import linear_response

if TYPE_CHECKING:
    from ..rig.bench import Mode


def coordinate(mode: "Mode", wrench: Floats, step: float) -> Floats:
    """Acceleration e'' of a mode from rest, (n,) [m/s2], under ``wrench`` (n, 6) [N, N m]."""
    omega = 2.0 * np.pi * mode.frequency
    push = wrench @ np.array([*mode.translation, *mode.rotation]) / mode.mass
    back = np.array([-(omega**2), -2.0 * mode.damping * omega])
    state = linear_response(np.array([[0.0, 1.0], back]), np.array([[0.0], [1.0]]), push[:, None], step)
    return push + state @ back


def at_sensors(modes: "tuple[Mode, ...]", wrench: Floats, step: float) -> Mapping[str, Floats]:
    """What all modes add to the acceleration at each sensor, base axes, (n, 3) [m/s2]."""
    found: dict[str, Floats] = {}
    for mode in modes:
        moved = coordinate(mode, wrench, step)[:, None]
        for sensor, shape in mode.at.items():
            found[sensor] = found.get(sensor, 0.0) + moved * np.array(shape)
    return found
