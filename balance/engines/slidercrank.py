"""One slider-crank, exactly: what it exerts on its base at any speed and acceleration of its crank.

Plane of the cylinder: x along the cylinder's axis away from the crank, y a quarter turn on in the sense of rotation;
vectors are complex numbers x + iy. theta = 0 is the crank along x, the top dead centre of a cylinder without offset.
Pin B = r e^(i theta), piston C = s + i e with s = r cos theta + sqrt(l^2 - w^2), w = r sin theta - e; the rod leans by
-asin(w / l). Shaking force F = -sum m d2p/dt2, moment M = -dL/dt about the crank's axis, weight excluded.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..errors import DataError

Complexes = NDArray[np.complexfloating]
"""Array of vectors as complex numbers."""


@dataclass(frozen=True)
class SliderCrank:
    """Crank, connecting rod and piston."""

    radius: float
    """Crank radius r [m]."""
    rod_length: float
    """Connecting rod l, pin to pin [m]."""
    crank_mass: float = 0.0
    """[kg]"""
    crank_centre: float = 0.0
    """Centre of mass of the crank along its throw; negative is opposite the pin [m]."""
    crank_inertia: float = 0.0
    """Of the crank about its own centre of mass [kg m2]."""
    rod_mass: float = 0.0
    """[kg]"""
    rod_centre: float = 0.0
    """Centre of mass of the rod from the crank pin l_B [m]."""
    rod_inertia: float = 0.0
    """Of the rod about its own centre of mass [kg m2]."""
    piston_mass: float = 0.0
    """Piston, pin and all that only slides [kg]."""
    offset: float = 0.0
    """Distance e of the cylinder's axis from the crank's, towards y [m]."""

    def __post_init__(self) -> None:
        """Refuse what cannot turn right round."""
        if not self.radius > 0.0 or not self.rod_length > self.radius + abs(self.offset):
            raise DataError(
                f"crank {self.radius:g} m, rod {self.rod_length:g} m, offset {self.offset:g} m: expected a rod longer "
                "than crank and offset together, or the crank cannot turn right round"
            )

    @property
    def ratio(self) -> float:
        """Lambda = r / l."""
        return self.radius / self.rod_length

    @property
    def rotating(self) -> float:
        """Rotating unbalance: crank, and the rod's mass at the pin m l_C / l, times their radii [kg m]."""
        at_pin = self.rod_mass * (self.rod_length - self.rod_centre) / self.rod_length
        return self.crank_mass * self.crank_centre + at_pin * self.radius

    @property
    def reciprocating_mass(self) -> float:
        """Piston, and the rod's mass at the piston m l_B / l [kg]."""
        return self.piston_mass + self.rod_mass * self.rod_centre / self.rod_length

    def force(self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0) -> Complexes:
        """Shaking force at crank angles (n,) [rad], speed [rad/s] and acceleration [rad/s2], (n,) [N]."""
        points = self._points(theta)
        rate: Complexes = np.zeros(np.shape(theta), dtype=complex)
        for mass, _, first, second in points:
            rate = rate + mass * (first * alpha + second * omega**2)
        return -rate

    def moment(self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0) -> Floats:
        """Shaking moment about the crank's axis, in the sense of rotation, (n,) [N m].

        M = -sum m Im(conj(p) d2p/dt2) - I chi'' of the rod - I alpha of the crank; the rod's true inertia is in it.
        """
        found = -self.crank_inertia * np.asarray(alpha) - self.rod_inertia * self._rod_angular(theta, omega, alpha)
        for mass, place, first, second in self._points(theta):
            found = found - mass * (place.conj() * (first * alpha + second * omega**2)).imag
        return np.asarray(found)

    def torque(self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0) -> Floats:
        """Torque on the crank that this motion takes, without weight and gas, (n,) [N m].

        Q = J alpha + 1/2 dJ/dtheta omega^2 with J = sum m |dp/dtheta|^2 + I (dchi/dtheta)^2.
        """
        lean, lean_rate = self._lean(theta)
        found = self.crank_inertia * np.asarray(alpha) + self.rod_inertia * lean * (lean * alpha + lean_rate * omega**2)
        for mass, _, first, second in self._points(theta):
            found = found + mass * (first.conj() * (first * alpha + second * omega**2)).real
        return np.asarray(found)

    def reciprocation(self, theta: Floats) -> Floats:
        """Exact -s'' / r: the reciprocating force for m r omega^2 = 1 at constant speed, (n,)."""
        return -self._slide(theta)[2] / self.radius

    def _slide(self, theta: Floats) -> tuple[Floats, Floats, Floats]:
        """Piston's place along the axis and its derivatives by theta, (n,) [m]."""
        sine, cosine = self.radius * np.sin(theta), self.radius * np.cos(theta)
        w = sine - self.offset
        q = np.sqrt(self.rod_length**2 - w**2)
        return cosine + q, -sine - w * cosine / q, -cosine - (cosine**2 - w * sine) / q - (w * cosine) ** 2 / q**3

    def _lean(self, theta: Floats) -> tuple[Floats, Floats]:
        """First and second derivative of the rod's angle chi = -asin(w / l) by theta, (n,)."""
        sine, cosine = self.radius * np.sin(theta), self.radius * np.cos(theta)
        w = sine - self.offset
        q = np.sqrt(self.rod_length**2 - w**2)
        return -cosine / q, sine / q - w * cosine**2 / q**3

    def _rod_angular(self, theta: Floats, omega: float | Floats, alpha: float | Floats) -> Floats:
        lean, lean_rate = self._lean(theta)
        return np.asarray(lean * alpha + lean_rate * omega**2)

    def _points(self, theta: Floats) -> list[tuple[float, Complexes, Complexes, Complexes]]:
        """Mass, place and its derivatives by theta of the three centres of mass: crank, rod, piston."""
        turned = np.exp(1j * np.asarray(theta))
        pin = self.radius * turned, 1j * self.radius * turned, -self.radius * turned
        place, first, second = self._slide(theta)
        piston = place + 1j * self.offset, first + 0j, second + 0j
        share = self.rod_centre / self.rod_length
        rod = [(1.0 - share) * b + share * c for b, c in zip(pin, piston, strict=True)]
        crank = [self.crank_centre / self.radius * b for b in pin]
        return [
            (self.crank_mass, crank[0], crank[1], crank[2]),
            (self.rod_mass, rod[0], rod[1], rod[2]),
            (self.piston_mass, *piston),
        ]
