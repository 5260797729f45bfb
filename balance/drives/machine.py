"""A machine: mechanism, motor, gearbox, loads; its torques on the crank, and its equation of motion.

A load is a torque or force at a joint, reduced to the crank by the joint's gain g = dq/du.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated

import numpy as np

from ..arrays import Floats
from ..results import Key, rpm
from .equivalent_inertia import EquivalentInertia
from .motors import Motor, Values

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
        """Torque at the crank, at angle phi [rad], gain g [-, m] and rate of travel [rad/s], scalars or (n,), [N m].

        Negative where it resists.
        """
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
        """Derivative of that share by the rate, by gain [-, m] and rate [rad/s], scalars or (n,), [N m s]."""
        if self.kind == "viscous":
            return -self.value * gain * gain + 0.0 * rate
        if self.kind == "quadratic":
            return -2.0 * self.value * np.abs(gain) ** 3 * np.abs(rate)
        return 0.0 * gain * rate


READINGS = {
    "geared": "Q = ratio x M: the gearbox multiplies the torque, as physics asks for",
    "ungeared": "Q = M: the motor's torque acts on the crank unmultiplied, speeds geared; nearest to the source",
}
"""The two readings of a source that does not state whether the gear ratio multiplies the motor's torque."""


@dataclass(frozen=True)
class Inertia:
    """Inertia that turns with the crank's or with the motor's shaft."""

    name: Annotated[str, Key()]
    value: Annotated[float, Key("inertia_kgm2")]
    """About its own shaft [kg m2]."""
    side: Annotated[str, Key()]
    """``crank`` or ``motor``."""


@dataclass(frozen=True)
class Machine:
    """A machine of one degree of freedom at one setting of its motor."""

    reduced: EquivalentInertia
    motor: Motor
    ratio: float
    """Turns of the motor per turn of the crank."""
    reading: Annotated[str, Key()]
    """One of READINGS."""
    nominal: Annotated[float, Key("nominal_rpm", to=rpm)]
    """Nominal speed of the motor [rad/s]."""
    inertias: tuple[Inertia, ...] = ()
    loads: tuple[Load, ...] = ()

    @property
    def nominal_crank(self) -> Annotated[float, Key("nominal_crank_rpm", to=rpm)]:
        """Nominal speed of the crank [rad/s]."""
        return self.nominal / self.ratio

    @property
    def constant_inertia(self) -> float:
        """Inertias of the shafts, at the crank: J_crank + ratio^2 J_motor [kg m2]."""
        return sum(i.value * (self.ratio**2 if i.side == "motor" else 1.0) for i in self.inertias)

    def with_flywheel(self, inertia: float, side: str = "crank") -> "Machine":
        """With one more inertia on a shaft [kg m2]."""
        return replace(self, inertias=(*self.inertias, Inertia("flywheel", inertia, side)))

    def inertia(self, u: Values) -> Floats:
        """Whole inertia at the crank at travel u, scalar or (n,) [rad], [kg m2]."""
        return self.reduced.inertia(u) + self.constant_inertia

    def motor_torque(self, rate: Values) -> Values:
        """Torque of the motor at the crank, by its rate of any shape [rad/s], [N m]."""
        return self._gearing * self.motor.torque_at(self.ratio * rate, self.nominal)

    def torque(self, u: Values, rate: Values, gains: Floats | None = None) -> Values:
        """Q: motor, joint friction and loads at the crank, without weight, [N m].

        Travel u [rad] and rate [rad/s] of one shape, ``gains`` (nv, *shape) [-, m] where they are known.
        """
        total = self.motor_torque(rate)
        if not self._resisted:
            return total
        gains = self.reduced.gains(u) if gains is None else gains
        dry = np.tensordot(self.reduced.mechanism.coulomb, np.abs(gains), 1)
        total = total - self._viscous(gains) * rate - dry * np.sign(rate)
        phi = self.reduced.direction * np.asarray(u)
        return total + sum(load.torque(phi, gains[load.joint], rate) for load in self.loads)

    def torque_slope(self, u: Values, rate: Values) -> Values:
        """dQ/du' at travel u [rad] and rate [rad/s] of one shape, [N m s]."""
        total = self._gearing * self.ratio * self.motor.slope_at(self.ratio * rate, self.nominal)
        if not self._resisted:
            return total
        gains = self.reduced.gains(u)
        return total - self._viscous(gains) + sum(load.slope(gains[load.joint], rate) for load in self.loads)

    def acceleration(self, u: float, rate: float) -> float:
        """u'' = (Q - V' - I' u'^2 / 2) / I [rad/s2], at one state."""
        inertia, _, *gains, inertia_slope, potential_slope = self.reduced.motion(u)
        torque = self.torque(u, rate, np.array(gains))
        return float((torque - potential_slope - 0.5 * inertia_slope * rate * rate) / (inertia + self.constant_inertia))

    @property
    def _gearing(self) -> float:
        return self.ratio if self.reading == "geared" else 1.0

    @cached_property
    def _resisted(self) -> bool:
        model = self.reduced.mechanism
        return bool(self.loads or model.viscous.any() or model.coulomb.any())

    def _viscous(self, gains: Floats) -> Floats:
        return np.tensordot(self.reduced.mechanism.viscous, gains * gains, 1)
