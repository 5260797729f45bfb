"""An engine: cylinders of any bank angle and throw along one crankshaft.

The crankshaft is the z axis, x up, angles in the sense of rotation, from x to y. Throw i stands at theta + phi_i, the
axis of cylinder i at beta_i; its own crank angle, from its own top dead centre, is theta + phi_i - beta_i.
"""

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..rotors.rotor import Unbalance
from .slidercrank import Complexes, SliderCrank


@dataclass(frozen=True)
class Cylinder:
    """One cylinder and its crank mechanism."""

    at: float
    """Place along the crankshaft z [m]."""
    throw: float
    """Angle phi of its throw from the crankshaft's mark [rad]."""
    bank: float
    """Angle beta of its axis from x [rad]."""
    crank: SliderCrank


@dataclass(frozen=True)
class Engine:
    """Cylinders, crankshaft counterweights, and how it fires."""

    name: str
    cylinders: tuple[Cylinder, ...]
    counterweights: tuple[Unbalance, ...] = ()
    """Further masses on the crankshaft, at angles from its mark [kg m]; point masses at the crank radius."""
    strokes: int = 4
    """Strokes of a working cycle, 4 or 2."""
    firing_order: tuple[int, ...] = ()
    """Cylinders, counted from 1, in the order in which they fire; empty where that is not given."""
    speed: float | None = None
    """Speed of the crankshaft [rad/s]."""
    normalised: bool = False
    """Whether m r = 1 kg m and the spacing 1 m stand for sizes that are not given."""
    source: str = ""

    @property
    def middle(self) -> float:
        """Middle of the cylinders along the crankshaft [m]: moments are about it unless said otherwise."""
        places = [cylinder.at for cylinder in self.cylinders]
        return 0.5 * (min(places) + max(places))

    @property
    def in_line(self) -> bool:
        """Whether all cylinders stand in one plane with the crankshaft, on one side."""
        return len({round(cylinder.bank % (2 * np.pi), 9) for cylinder in self.cylinders}) == 1

    @property
    def counterweight_inertia(self) -> float:
        """Inertia of the counterweights about the crankshaft, U r each [kg m2]."""
        return sum(abs(weight.vector) for weight in self.counterweights) * self.cylinders[0].crank.radius

    def force(self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0) -> Complexes:
        """Exact shaking force at crank angles (n,) [rad], any speed [rad/s] and acceleration [rad/s2], (n,) [N]."""
        total: Complexes = np.zeros(np.shape(theta), dtype=complex)
        for _, force in self._forces(theta, omega, alpha):
            total = total + force
        return total

    def tilting(
        self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0, about: float = 0.0
    ) -> Complexes:
        """Exact sum of force times distance along the crankshaft from ``about`` [m], (n,) [N m].

        Its direction is that of the forces; the moment vector is a quarter turn ahead, M = e_z x this, as (-y, x).
        """
        total: Complexes = np.zeros(np.shape(theta), dtype=complex)
        for at, force in self._forces(theta, omega, alpha):
            total = total + (at - about) * force
        return total

    def rolling(self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0) -> Floats:
        """Exact shaking moment about the crankshaft's axis, in the sense of rotation, (n,) [N m]."""
        total = np.zeros(np.shape(theta)) - self.counterweight_inertia * np.asarray(alpha)
        for cylinder in self.cylinders:
            total = total + cylinder.crank.moment(theta + cylinder.throw - cylinder.bank, omega, alpha)
        return total

    def torque(self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0) -> Floats:
        """Torque on the crankshaft that the motion takes, without weight and gas, (n,) [N m]."""
        total = np.zeros(np.shape(theta)) + self.counterweight_inertia * np.asarray(alpha)
        for cylinder in self.cylinders:
            total = total + cylinder.crank.torque(theta + cylinder.throw - cylinder.bank, omega, alpha)
        return total

    def _forces(self, theta: Floats, omega: float | Floats, alpha: float | Floats) -> list[tuple[float, Complexes]]:
        """Places along the crankshaft and the exact forces there."""
        found = []
        for cylinder in self.cylinders:
            own = cylinder.crank.force(theta + cylinder.throw - cylinder.bank, omega, alpha)
            found.append((cylinder.at, own * np.exp(1j * cylinder.bank)))
        for weight in self.counterweights:
            turned = weight.vector * np.exp(1j * np.asarray(theta))
            found.append((weight.at, turned * (omega**2 - 1j * np.asarray(alpha))))
        return found
