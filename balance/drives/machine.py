"""A machine: mechanism, motor, gearbox, loads; its torques on the crank, and its equation of motion.

A motor gives torque against speed, with the slope that Newton's method needs: M(n) is on the motor's shaft at speed n,
the inverter or voltage being set to ``nominal``, both [rad/s]. A load is a torque or force at a joint, reduced to the
crank by the joint's gain g = dq/du.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np

from ..arrays import Floats
from ..errors import DataError
from ..input_files import Number, Positive, Quantity, Table
from ..results import Key, rpm
from .equivalent_inertia import EquivalentInertia

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

Values = Floats | float
"""One number, or an array of them."""
Speed = Annotated[float, Quantity("angular velocity")]
PositiveSpeed = Annotated[float, Quantity("angular velocity", above=0.0)]
Moment = Annotated[float, Quantity("moment")]
PositiveMoment = Annotated[float, Quantity("moment", above=0.0)]


class Induction(Table):
    """An induction motor, M = M_d s / (s + (s_d - s)^2 (a - b s^3)).

    The slip is s = (n_0 - n) / n_b. The published form is divided by s: 0/0 at s = 0. As the source has it,
    n_0 = n_b = nominal: the whole curve is moved to the inverter's speed. With a slip base n_b of its own the slip
    speed is kept, as by voltage over frequency.
    """

    kind: Literal["induction"]
    """Kind of motor."""
    peak_torque: PositiveMoment
    """Peak torque M_d [N m]."""
    peak_slip: Positive
    """Slip s_d at the peak torque."""
    a: Number
    """Coefficient a of the curve."""
    b: Number
    """Coefficient b of the curve."""
    synchronous_speed: Literal["nominal"] | Speed
    """Speed without slip [rad/s], or ``nominal``: the whole curve is moved to the nominal speed."""
    slip_base: Speed | None = None
    """What a slip of one is [rad/s]; the synchronous speed where it is left out."""
    braking: Literal["as printed", "mirrored"] = "as printed"
    """Above the synchronous speed: the published formula, or M(-s) = -M(s)."""

    def torque_at(self, speed: Values, nominal: float) -> Values:
        """Torque [N m]."""
        return self.curve(self._slip(speed, nominal)[0])

    def slope_at(self, speed: Values, nominal: float) -> Values:
        """dM/dn = -M'(s) / n_b, with M' = M_d (d - s d') / d^2 for M = M_d s / d."""
        slip, base = self._slip(speed, nominal)
        s = np.abs(slip) if self.braking == "mirrored" else slip
        gap, cubic = self.peak_slip - s, self.a - self.b * s**3
        denominator = s + gap**2 * cubic
        rise = 1.0 - 2.0 * gap * cubic - 3.0 * gap**2 * self.b * s**2
        return -self.peak_torque * (denominator - s * rise) / denominator**2 / base

    def curve(self, slip: Values) -> Values:
        """M(s) [N m]."""
        s = np.abs(slip) if self.braking == "mirrored" else slip
        torque = self.peak_torque * s / (s + (self.peak_slip - s) ** 2 * (self.a - self.b * s**3))
        return np.sign(slip) * torque if self.braking == "mirrored" else torque

    def _slip(self, speed: Values, nominal: float) -> tuple[Values, float]:
        zero = (nominal if self.synchronous_speed == "nominal" else self.synchronous_speed) or nominal
        base = self.slip_base or zero
        return (zero - speed) / base, base


class DirectCurrent(Table):
    """A direct-current motor; the nominal speed sets its voltage.

    M = (stall torque / no-load speed) (nominal - n).
    """

    kind: Literal["dc"]
    """Kind of motor."""
    stall_torque: PositiveMoment
    """At standstill and full voltage [N m]."""
    no_load_speed: PositiveSpeed
    """Speed without load at full voltage [rad/s]."""

    def torque_at(self, speed: Values, nominal: float) -> Values:
        """Torque [N m]."""
        return self.stall_torque / self.no_load_speed * (nominal - speed)

    def slope_at(self, speed: Values, nominal: float) -> Values:
        """dM/dn [N m s]."""
        return -self.stall_torque / self.no_load_speed + 0.0 * speed


class Constant(Table):
    """A motor of constant torque."""

    kind: Literal["constant"]
    """Kind of motor."""
    torque: Moment
    """Its torque [N m]."""

    def torque_at(self, speed: Values, nominal: float) -> Values:
        """Torque [N m]."""
        return self.torque + 0.0 * speed

    def slope_at(self, speed: Values, nominal: float) -> Values:
        """Zero."""
        return 0.0 * speed


class MeasuredMotor(Table):
    """A motor measured point by point.

    Between the points a monotone cubic, outside extrapolated by its tangent.
    """

    kind: Literal["table"]
    """Kind of motor."""
    speed: list[Speed]
    """Speeds of the points, increasing [rad/s]."""
    torque: list[Moment]
    """Torques at the points [N m]."""

    def _check(self) -> None:
        if len(self.speed) != len(self.torque) or len(self.speed) < 2 or not (np.diff(self.speed) > 0.0).all():
            raise DataError(
                f"speed has {len(self.speed)}, torque {len(self.torque)} values: expected as many, speeds increasing"
            )

    @cached_property
    def curve(self) -> "PchipInterpolator":
        """Torque [N m] over speed [rad/s], between the points."""
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(np.array(self.speed), np.array(self.torque))

    def torque_at(self, speed: Values, nominal: float) -> Values:
        """Torque [N m]."""
        inside = np.clip(speed, self.speed[0], self.speed[-1])
        return self.curve(inside) + self.curve(inside, 1) * (speed - inside)

    def slope_at(self, speed: Values, nominal: float) -> Values:
        """dM/dn [N m s]."""
        return self.curve(np.clip(speed, self.speed[0], self.speed[-1]), 1)

    def covers(self, speed: Values) -> bool:
        """Whether the points reach as far as these speeds."""
        return bool(np.min(speed) >= self.speed[0] and np.max(speed) <= self.speed[-1])


Motor = Induction | DirectCurrent | Constant | MeasuredMotor
"""Each gives ``torque_at`` and ``slope_at`` a speed."""

LAWS: Mapping[str, tuple[Callable[[Any], Any], Callable[[Any], Any]]] = {
    "constant": (lambda v: 1.0 + 0.0 * v, lambda v: 0.0 * v),
    "dry": (np.sign, lambda v: 0.0 * v),
    "viscous": (lambda v: v, lambda v: 1.0 + 0.0 * v),
    "quadratic": (lambda v: v * np.abs(v), lambda v: 2.0 * np.abs(v)),
}
"""Force of each kind of load at its joint's speed v, per its value, and its slope: against the joint's positive
direction whichever way it moves, against its motion, in proportion to its speed, to the square of that (a fan)."""


@dataclass(frozen=True)
class Load:
    """A load at a joint; its share of the crank's torque follows from the power F q'."""

    name: str
    kind: str
    """One of LAWS, or ``table``."""
    joint: int
    """Index of the coordinate it acts on."""
    value: float
    """F [N m, N], c of F = c v [N m s, N s/m], or c of F = c v^2 [N m s2, N s2/m2]."""
    curve: "PchipInterpolator | None" = None
    """F over the crank's angle in one turn, 0 to 2 pi, against the joint's positive direction [N m, N]."""

    def torque(self, phi: Values, gain: Values, rate: Values) -> Values:
        """Torque at the crank, at angle phi [rad], gain g [-, m] and rate of travel [rad/s], scalars or (n,), [N m].

        Negative where it resists.
        """
        if self.curve is not None:
            return -self.curve(np.mod(phi, 2.0 * np.pi)) * gain + 0.0 * rate
        return -self.value * LAWS[self.kind][0](gain * rate) * gain

    def slope(self, gain: Values, rate: Values) -> Values:
        """Derivative of that share by the rate, by gain [-, m] and rate [rad/s], scalars or (n,), [N m s]."""
        return 0.0 * gain * rate if self.curve is not None else -self.value * LAWS[self.kind][1](gain * rate) * gain**2


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
