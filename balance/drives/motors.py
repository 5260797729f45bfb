"""Motors as drive files state them: torque against speed, with the slope that Newton's method needs.

Torque M(n) is on the motor's shaft at speed n, the inverter or voltage being set to ``nominal``, both [rad/s].
"""

from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np

from ..arrays import Floats
from ..errors import DataError
from ..input_files import Number, Positive, Quantity, Table

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
