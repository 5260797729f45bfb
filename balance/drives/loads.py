"""Loads on a machine: torque or force at a joint, reduced to the crank by the joint's gain g = dq/du."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

KINDS = {
    "constant": "a force against the joint's positive direction, whichever way it moves",
    "dry": "a force against the joint's motion",
    "viscous": "in proportion to the joint's speed, against it",
    "quadratic": "in proportion to the square of the joint's speed, against it (a fan)",
    "table": "a force against the joint's positive direction that depends on the crank's angle",
}


@dataclass(frozen=True)
class Load:
    """A load at a joint; its share of the crank's torque follows from the power F q'."""

    name: str
    kind: str
    """One of KINDS."""
    joint: int
    """Index of the coordinate it acts on."""
    value: float
    """F [N m, N], c of F = c v [N m s, N s/m], or c of F = c v^2 [N m s2, N s2/m2]."""
    curve: "PchipInterpolator | None" = None
    """F over the crank's angle in one turn, 0 to 2 pi [N m, N]."""

    def torque(self, phi: Floats | float, gain: Floats | float, rate: Floats | float) -> Floats | float:
        """Share of the crank's torque at angle phi, gain g, and rate of travel [N m]; negative where it resists."""
        if self.kind == "constant":
            return -self.value * gain + 0.0 * rate
        if self.kind == "table" and self.curve is not None:
            return -self.curve(np.mod(phi, 2.0 * np.pi)) * gain + 0.0 * rate
        if self.kind == "dry":
            return -self.value * np.abs(gain) * np.sign(rate)
        if self.kind == "viscous":
            return -self.value * gain * gain * rate
        return -self.value * np.abs(gain) ** 3 * rate * np.abs(rate)

    def slope(self, gain: Floats | float, rate: Floats | float) -> Floats | float:
        """Derivative of that share by the rate [N m s]."""
        if self.kind == "viscous":
            return -self.value * gain * gain + 0.0 * rate
        if self.kind == "quadratic":
            return -2.0 * self.value * np.abs(gain) ** 3 * np.abs(rate)
        return 0.0 * gain * rate
