"""Permissible residual unbalance of rigid rotors after ISO 21940-11, and trial masses.

Scope: rotors that are rigid at their service speed, in a constant (rigid) state, in bearings. Not for
linkages, whose shaking force does not turn with a shaft, and not for flexible rotors.
"""

import math
from dataclasses import dataclass
from typing import Annotated

from ..errors import DataError
from ..results import Key, micro, milli
from ..units import G0

GRADES = (0.4, 1.0, 2.5, 6.3, 16.0, 40.0, 100.0, 250.0, 630.0, 1600.0, 4000.0)
"""The standard's grades G = e_per omega [mm/s]."""
SCOPE = "ISO 21940-11 permissible unbalance: for rotors with rigid behaviour only, not for linkages or flexible rotors"
RIGID_SHARE = 0.7
"""A rotor is taken as rigid up to this share of its first critical speed: the usual rule of practice."""
LEAST_SHARE, LARGEST_SHARE = 0.3, 0.7
"""Limits of each bearing plane's share of the permissible unbalance, centre of mass between the bearings."""


@dataclass(frozen=True)
class Permissible:
    """Permissible residual unbalance of a rigid rotor."""

    grade: Annotated[float, Key("grade_mm_per_s", to=milli)]
    """Balance quality grade: e_per omega [m/s]."""
    mass: Annotated[float, Key("mass_kg")]
    """Mass of the rotor [kg]."""
    speed: Annotated[float, Key("speed_rad_per_s")]
    """Largest service speed [rad/s]."""

    @property
    def eccentricity(self) -> Annotated[float, Key("e_per_um", to=micro)]:
        """Permissible specific unbalance e_per = G / omega [m]."""
        return self.grade / self.speed

    @property
    def unbalance(self) -> Annotated[float, Key("U_per_gmm", to=micro)]:
        """U_per = m G / omega [kg m]; in g mm it is 9549.3 G m / n."""
        return self.mass * self.eccentricity

    def in_planes(self, to_first: float, to_second: float) -> tuple[float, float]:
        """Shares of two bearing planes [kg m], by the distances of the centre of mass from each [m].

        U_A = U_per L_B / L, each between 0.3 and 0.7 of U_per. Raises DataError for a centre of mass outside.
        """
        if not (to_first > 0.0 and to_second > 0.0):
            raise DataError(
                f"the centre of mass is {to_first:g} m and {to_second:g} m from the bearing planes: shares are only "
                "given for a centre of mass between them; an overhung rotor needs the standard itself"
            )
        share = to_second / (to_first + to_second)
        share = min(max(share, LEAST_SHARE), LARGEST_SHARE)
        return self.unbalance * share, self.unbalance * (1.0 - share)

    def reached(self, residual: float) -> float:
        """Grade that a residual unbalance [kg m] amounts to, e omega [m/s]."""
        return residual / self.mass * self.speed


def permissible(grade: float, mass: float, speed: float, critical: float | None = None) -> Permissible:
    """Permissible unbalance for a grade [m/s], a mass [kg], a speed [rad/s].

    Raises DataError for a rotor that is not rigid: faster than 0.7 of its first critical speed [rad/s].
    """
    for what, value in (("grade", grade), ("mass", mass), ("speed", speed)):
        if not 0.0 < value < math.inf:
            raise DataError(f"{what} is {value:g}: expected more than zero")
    if critical is not None and speed > RIGID_SHARE * critical:
        raise DataError(
            f"the speed is {speed / critical:.2f} of the first critical speed: ISO 21940-11 is for rigid rotors, here "
            f"up to {RIGID_SHARE:g}; a flexible rotor is balanced by influence coefficients at several speeds"
        )
    return Permissible(grade, mass, speed)


def trial_mass(mass: float, speed: float, radius: float, planes: int = 1, share: float = 0.1) -> float:
    """Trial mass whose centrifugal force is ``share`` of the weight on its plane [kg]: m_t r omega^2 = p m g0 / planes.

    Mass of the rotor [kg], speed of the trial run [rad/s], radius of the trial mass [m].
    """
    for what, value in (("mass", mass), ("speed", speed), ("radius", radius), ("planes", planes), ("share", share)):
        if not 0.0 < value < math.inf:
            raise DataError(f"{what} is {value:g}: expected more than zero")
    return share * mass * G0 / (planes * radius * speed**2)
