"""Motors: torque against speed, with the slope that Newton's method and the Floquet factor need."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..arrays import Floats

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

Values = Floats | float
"""One number, or an array of them."""


class Motor(Protocol):
    """Torque M(n) on the motor's shaft at speed n, the inverter or voltage being set to ``nominal``, both [rad/s]."""

    def torque(self, speed: Values, nominal: float) -> Values:
        """Torque [N m]."""
        ...

    def slope(self, speed: Values, nominal: float) -> Values:
        """dM/dn [N m s]."""
        ...


@dataclass(frozen=True)
class Induction:
    """The induction motor's curve of the source: M = M_d s / (s + (s_d - s)^2 (a - b s^3)), slip s = (n_0 - n) / n_b.

    The published form is divided by s: 0/0 at s = 0. As the source has it, n_0 = n_b = nominal: the whole curve
    is moved to the inverter's speed. With a slip base n_b of its own the slip speed is kept, as by voltage over
    frequency.
    """

    peak_torque: float
    """M_d [N m]."""
    peak_slip: float
    """s_d [-]."""
    a: float
    b: float
    synchronous: float | None = None
    """n_0 [rad/s]; None: the nominal speed."""
    slip_base: float | None = None
    """n_b [rad/s]; None: n_0."""
    mirrored: bool = False
    """Whether braking (s < 0) mirrors driving, M(-s) = -M(s), in place of the published formula."""

    def torque(self, speed: Values, nominal: float) -> Values:
        """Torque [N m]."""
        return self.curve(self._slip(speed, nominal)[0])

    def slope(self, speed: Values, nominal: float) -> Values:
        """dM/dn = -M'(s) / n_b, with M' = M_d (d - s d') / d^2 for M = M_d s / d."""
        slip, base = self._slip(speed, nominal)
        s = np.abs(slip) if self.mirrored else slip
        gap, cubic = self.peak_slip - s, self.a - self.b * s**3
        denominator = s + gap**2 * cubic
        rise = 1.0 - 2.0 * gap * cubic - 3.0 * gap**2 * self.b * s**2
        return -self.peak_torque * (denominator - s * rise) / denominator**2 / base

    def curve(self, slip: Values) -> Values:
        """M(s) [N m]."""
        s = np.abs(slip) if self.mirrored else slip
        torque = self.peak_torque * s / (s + (self.peak_slip - s) ** 2 * (self.a - self.b * s**3))
        return np.sign(slip) * torque if self.mirrored else torque

    def _slip(self, speed: Values, nominal: float) -> tuple[Values, float]:
        zero = self.synchronous or nominal
        base = self.slip_base or zero
        return (zero - speed) / base, base


@dataclass(frozen=True)
class DirectCurrent:
    """A direct-current motor, M = (stall torque / no-load speed) (nominal - n): the nominal speed sets the voltage."""

    stall_torque: float
    """At standstill and full voltage [N m]."""
    no_load_speed: float
    """Without load and at full voltage [rad/s]."""

    def torque(self, speed: Values, nominal: float) -> Values:
        """Torque [N m]."""
        return self.stall_torque / self.no_load_speed * (nominal - speed)

    def slope(self, speed: Values, nominal: float) -> Values:
        """dM/dn [N m s]."""
        return -self.stall_torque / self.no_load_speed + 0.0 * speed


@dataclass(frozen=True)
class Constant:
    """A motor of constant torque."""

    value: float
    """[N m]"""

    def torque(self, speed: Values, nominal: float) -> Values:
        """Torque [N m]."""
        return self.value + 0.0 * speed

    def slope(self, speed: Values, nominal: float) -> Values:
        """Zero."""
        return 0.0 * speed


@dataclass(frozen=True)
class MeasuredMotor:
    """A motor measured point by point; between the points a monotone cubic, outside extrapolated by its tangent."""

    speeds: Floats
    """Increasing, (n,) [rad/s]."""
    torques: Floats
    """(n,) [N m]."""
    curve: "PchipInterpolator"

    @classmethod
    def through(cls, speeds: Floats, torques: Floats) -> "MeasuredMotor":
        """Through points (n,) [rad/s] and (n,) [N m], speeds increasing."""
        from scipy.interpolate import PchipInterpolator

        return cls(speeds, torques, PchipInterpolator(speeds, torques))

    def torque(self, speed: Values, nominal: float) -> Values:
        """Torque [N m]."""
        inside = np.clip(speed, self.speeds[0], self.speeds[-1])
        return self.curve(inside) + self.curve(inside, 1) * (speed - inside)

    def slope(self, speed: Values, nominal: float) -> Values:
        """dM/dn [N m s]."""
        return self.curve(np.clip(speed, self.speeds[0], self.speeds[-1]), 1)

    def covers(self, speed: Values) -> bool:
        """Whether the points reach as far as these speeds."""
        return bool(np.min(speed) >= self.speeds[0] and np.max(speed) <= self.speeds[-1])
