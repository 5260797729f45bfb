"""An engine: cylinders of any bank angle and throw along one crankshaft; its exact forces, and when it fires.

The crankshaft is the z axis, x up, angles in the sense of rotation, from x to y. Throw i is at theta + phi_i, the axis
of cylinder i at beta_i; its own crank angle, from its own top dead centre, is theta + phi_i - beta_i.
"""

from dataclasses import dataclass
from itertools import pairwise, product
from typing import Annotated

import numpy as np

from ..arrays import Complexes, Floats
from ..errors import DataError
from ..results import Key
from ..rotors.rotor import Unbalance
from .slider_crank import SliderCrank

_TURN = 360.0
_MOST_CYLINDERS = 16
"""Whose firing angles are searched for."""


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
    """Cylinders, counted from 1, in the order in which they fire; empty where it is not given."""
    speed: float | None = None
    """Speed of the crankshaft [rad/s]."""
    normalised: bool = False
    """Whether sizes are not given: then m r = 1 kg m and the spacing is 1 m."""
    source: str = ""

    @property
    def middle(self) -> float:
        """Middle of the cylinders along the crankshaft [m]: moments are about it by default."""
        places = [cylinder.at for cylinder in self.cylinders]
        return 0.5 * (min(places) + max(places))

    @property
    def in_line(self) -> bool:
        """Whether all cylinders are in one plane with the crankshaft, on one side of it."""
        return len({round(cylinder.bank % (2 * np.pi), 9) for cylinder in self.cylinders}) == 1

    @property
    def counterweight_inertia(self) -> float:
        """Inertia of the counterweights about the crankshaft, U r each [kg m2]."""
        return sum(abs(weight.vector) for weight in self.counterweights) * self.cylinders[0].crank.radius

    def force(self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0) -> Complexes:
        """Exact shaking force at crank angles (n,) [rad], speed [rad/s] and acceleration [rad/s2], (n,) [N]."""
        forces = [force for _, force in self._forces(theta, omega, alpha)]
        return np.asarray(sum(forces, np.zeros(np.shape(theta), dtype=complex)))

    def tilting(
        self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0, about: float = 0.0
    ) -> Complexes:
        """Exact sum of force times distance along the crankshaft from ``about`` [m], (n,) [N m].

        At crank angles (n,) [rad], speed [rad/s] and acceleration [rad/s2]. Its direction is that of the forces; the
        moment vector is a quarter turn ahead, M = e_z x this, as (-y, x).
        """
        moments = [(at - about) * force for at, force in self._forces(theta, omega, alpha)]
        return np.asarray(sum(moments, np.zeros(np.shape(theta), dtype=complex)))

    def rolling(self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0) -> Floats:
        """Exact shaking moment about the crankshaft's axis, in the sense of rotation, (n,) [N m]; see ``force``."""
        total = np.zeros(np.shape(theta)) - self.counterweight_inertia * np.asarray(alpha)
        for cylinder in self.cylinders:
            total = total + cylinder.crank.moment(theta + cylinder.throw - cylinder.bank, omega, alpha)
        return total

    def torque(self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0) -> Floats:
        """Torque on the crankshaft that the motion needs, without weight and gas, (n,) [N m]; see ``force``."""
        total = np.zeros(np.shape(theta)) + self.counterweight_inertia * np.asarray(alpha)
        for cylinder in self.cylinders:
            total = total + cylinder.crank.torque(theta + cylinder.throw - cylinder.bank, omega, alpha)
        return total

    def _forces(self, theta: Floats, omega: float | Floats, alpha: float | Floats) -> list[tuple[float, Complexes]]:
        """Places along the crankshaft and the exact forces there."""
        forces = []
        for cylinder in self.cylinders:
            own = cylinder.crank.force(theta + cylinder.throw - cylinder.bank, omega, alpha)
            forces.append((cylinder.at, own * np.exp(1j * cylinder.bank)))
        for weight in self.counterweights:
            turned = weight.vector * np.exp(1j * np.asarray(theta))
            forces.append((weight.at, turned * (omega**2 - 1j * np.asarray(alpha))))
        return forces


@dataclass(frozen=True)
class Firing:
    """Firing angles over a working cycle."""

    order: Annotated[tuple[int, ...], Key()]
    """Cylinders, counted from 1, in the order in which they fire."""
    angles_deg: Annotated[tuple[float, ...], Key()]
    """Crank angle at which each of them fires, from the first [deg]."""
    intervals_deg: Annotated[tuple[float, ...], Key()]
    """From each to the next, over the cycle [deg]."""

    @property
    def even(self) -> Annotated[bool, Key()]:
        """Whether all intervals are equal."""
        return max(self.intervals_deg) - min(self.intervals_deg) < 1e-6


def dead_centres(engine: Engine) -> list[float]:
    """Crank angle of each cylinder's top dead centre, 0 up to 360 [deg]: theta = beta - phi + asin(e / (r + l))."""
    angles = [np.degrees(one.bank - one.throw + one.crank.dead_centre) % _TURN for one in engine.cylinders]
    return [0.0 if _TURN - angle < 1e-9 else float(angle) for angle in angles]


def firing(engine: Engine) -> Firing:
    """Firing angles in the engine's own order, or, where it has none, in the most even one.

    Each cylinder fires at its top dead centre, in a four-stroke engine in the first turn or in the second: of all
    choices the most even. Raises DataError for an order that does not fit into one cycle.
    """
    dead, turns = dead_centres(engine), (0.0, _TURN) if engine.strokes == 4 else (0.0,)
    if len(dead) > _MOST_CYLINDERS:
        raise DataError(f"{engine.name}: {len(dead)} cylinders: firing angles are found for up to {_MOST_CYLINDERS}")
    cycle, order = _TURN * len(turns), engine.firing_order
    first = order[0] - 1 if order else 0
    choices = []
    for turn in product(*((0.0,) if i == first else turns for i in range(len(dead)))):
        angles = [(d + t - dead[first]) % cycle for d, t in zip(dead, turn, strict=True)]
        angles = [0.0 if cycle - angle < 1e-6 else angle for angle in angles]
        if any(angles[a - 1] > angles[b - 1] + 1e-6 for a, b in pairwise(order)):
            continue
        rising = sorted(range(len(angles)), key=lambda i: (round(angles[i], 6), i))
        fired = tuple(angles[i] - angles[rising[0]] for i in rising)
        intervals = tuple(b - a for a, b in pairwise([*fired, cycle]))
        choices.append(Firing(order or tuple(i + 1 for i in rising), fired, intervals))
    if not choices:
        raise DataError(
            f"{engine.name}: firing order {'-'.join(map(str, order))} does not fit into one cycle of {cycle:g} deg: "
            "these throws and banks cannot fire in that order; correct firing_order, throws or banks"
        )
    return min(choices, key=lambda choice: round(float(np.std(choice.intervals_deg)), 6))
