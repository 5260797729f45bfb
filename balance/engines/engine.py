"""An engine: cylinders of any bank angle and throw along one crankshaft.

The crankshaft is the z axis, x up, angles in the sense of rotation, from x to y. Throw i stands at theta + phi_i, the
axis of cylinder i at beta_i; its own crank angle, from its own top dead centre, is theta + phi_i - beta_i.

When the cylinders fire, and whether at equal distance.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..arrays import Floats
from ..errors import DataError
from ..rotors.rotor import Unbalance
from .slider_crank import Complexes, SliderCrank


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


_TURN = 360.0
_MOST_CYLINDERS = 16


@dataclass(frozen=True)
class Firing:
    """Firing angles over a working cycle."""

    order: tuple[int, ...]
    """Cylinders, counted from 1, in the order in which they fire."""
    angles_deg: tuple[float, ...]
    """Crank angle at which each of them fires, from the first [deg]."""
    intervals_deg: tuple[float, ...]
    """From each to the next, over the cycle [deg]."""

    @property
    def even(self) -> bool:
        """Whether all intervals are equal."""
        return max(self.intervals_deg) - min(self.intervals_deg) < 1e-6


def dead_centres(engine: Engine) -> list[float]:
    """Crank angle of each cylinder's top dead centre, 0 up to 360 [deg]: theta = beta - phi."""
    angles = [np.degrees(cylinder.bank - cylinder.throw) % _TURN for cylinder in engine.cylinders]
    return [0.0 if _TURN - angle < 1e-9 else float(angle) for angle in angles]


def firing(engine: Engine) -> Firing:
    """Firing angles in the engine's own order, or, where it has none, in the most even one.

    Each cylinder fires at its top dead centre, in a four-stroke engine in the first turn or in the second: of all
    choices the most even. Raises DataError for an order that does not fit into one cycle.
    """
    dead, doubled = dead_centres(engine), engine.strokes == 4
    if len(dead) > _MOST_CYLINDERS:
        raise DataError(f"{engine.name}: {len(dead)} cylinders: firing angles are found for up to {_MOST_CYLINDERS}")
    cycle = _TURN * (2 if doubled else 1)
    first = engine.firing_order[0] - 1 if engine.firing_order else 0
    turns = product((0.0, _TURN) if doubled else (0.0,), repeat=len(dead) - 1)
    choices = (_in_turn(dead, (*turn[:first], 0.0, *turn[first:]), first, cycle) for turn in turns)
    fitting = [choice for choice in choices if not engine.firing_order or _fires_in(choice, engine.firing_order)]
    if not fitting:
        raise DataError(
            f"{engine.name}: firing order {'-'.join(map(str, engine.firing_order))} does not fit into one cycle of "
            f"{cycle:g} deg: these throws and banks cannot fire so"
        )
    best = min(fitting, key=_unevenness)
    return _reordered(best, engine.firing_order) if engine.firing_order else best


def _fires_in(choice: Firing, order: Sequence[int]) -> bool:
    """Whether the cylinders fire in this order, those that fire at once in any."""
    angle = dict(zip(choice.order, choice.angles_deg, strict=True))
    return all(angle[a] <= angle[b] + 1e-6 for a, b in zip(order, order[1:], strict=False))


def _reordered(choice: Firing, order: tuple[int, ...]) -> Firing:
    return Firing(order, choice.angles_deg, choice.intervals_deg)


def _in_turn(dead: Sequence[float], turn: Sequence[float], first: int, cycle: float) -> Firing:
    """Firing angles in rising order, counted from cylinder ``first``."""
    angles = [(d + t - dead[first]) % cycle for d, t in zip(dead, turn, strict=True)]
    angles = [0.0 if cycle - angle < 1e-6 else angle for angle in angles]
    order = sorted(range(len(angles)), key=lambda i: (round(angles[i], 6), i))
    return _firing(tuple(i + 1 for i in order), [angles[i] for i in order], cycle)


def _unevenness(firing: Firing) -> float:
    return round(float(np.std(firing.intervals_deg)), 6)


def _firing(order: tuple[int, ...], angles: Sequence[float], cycle: float) -> Firing:
    following = [*angles[1:], angles[0] + cycle]
    intervals = tuple(b - a for a, b in zip(angles, following, strict=True))
    return Firing(order, tuple(a - angles[0] for a in angles), intervals)
