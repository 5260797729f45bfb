"""Free forces and moments of an engine by orders, as vectors that turn with and against the crankshaft.

The force of order k along a cylinder at beta is the real part of a turning vector; it is half of it turning forward
and half backward. Per omega^2, with a = m r c_k (see ``slider_crank``):
forward P_k = 1/2 sum a e^(i (k phi - (k - 1) beta)), backward N_k = 1/2 sum conj(a) e^(-i (k phi - (k + 1) beta)),
F_k = omega^2 (P_k e^(i k theta) + N_k e^(-i k theta)): an ellipse of half-axes |P| + |N| and ||P| - |N||. What turns
with the crankshaft (rotating masses, counterweights) is in P_1. Moments are the same sums times z.

A vector of order k that turns forward is removed by a balance shaft that turns forward at k omega with unbalance
-P / k^2; one that turns backward by a shaft that turns backward. Forward at first order that shaft is the crankshaft
itself. Force and moment together need two unbalances a shaft; a force with a fixed place, or a couple alone, fewer.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..arrays import Complexes, Floats
from ..errors import DataError
from ..rotors.rotor import Plane, Unbalance, correct_planes
from .engine import Engine
from .slider_crank import crank_angles, exact_series, largest_over_turn, second_order

Series = Literal["second-order", "exact"]
STAGES = {
    "before": "as described",
    "counterweights": "with the crankshaft's counterweights",
    "first_order_shafts": "and a backward shaft of first order",
    "shafts": "and shafts of second order",
}
"""The engine as it is; with the unbalances that belong on the crankshaft; with the shaft that turns against it at its
speed; and with those at twice its speed."""
_SAMPLES = 360
"""Crank angles of a turn that are kept."""
_ROUNDING = 1e-13
"""Share of its terms' size below which a sum is rounding error."""


@dataclass(frozen=True)
class RotatingVector:
    """One order of a force [kg m] or of a moment [kg m2], per omega^2."""

    order: int
    forward: complex
    """Turns at order times the crankshaft's speed, with it."""
    backward: complex
    """Turns as fast against it."""

    @property
    def largest(self) -> float:
        """Long half-axis of the ellipse."""
        return abs(self.forward) + abs(self.backward)

    @property
    def least(self) -> float:
        """Short half-axis; zero where the force swings in one plane."""
        return abs(abs(self.forward) - abs(self.backward))

    @property
    def direction(self) -> float:
        """Angle of the long half-axis from x [rad]."""
        return float(np.angle(self.forward) + np.angle(self.backward)) / 2.0

    def at(self, theta: Floats) -> Complexes:
        """Value at crank angles (n,) [rad], per omega^2, (n,) [kg m] or [kg m2]."""
        return self.forward * np.exp(1j * self.order * theta) + self.backward * np.exp(-1j * self.order * theta)


@dataclass(frozen=True)
class FreeForces:
    """Free force and moment of one order."""

    force: RotatingVector
    moment: RotatingVector
    """About ``about``, in the direction of the forces: see Engine.tilting."""
    about: float
    """[m]"""

    @property
    def place(self) -> float | None:
        """Where the resultant acts along the crankshaft, z = M / F [m]; None for a couple, or where it moves.

        The place is fixed where forward and backward part act at one z.
        """
        pairs = [(self.force.forward, self.moment.forward), (self.force.backward, self.moment.backward)]
        size, largest = self.force.largest, self.moment.largest
        if size <= 0.0:
            return None
        acting = [(f, m) for f, m in pairs if abs(f) > 1e-9 * size]
        silent = [m for f, m in pairs if abs(f) <= 1e-9 * size]
        places = [m / f for f, m in acting]
        scale = max(largest / size, 1e-12)
        if any(abs(z - places[0]) > 1e-9 * scale or abs(z.imag) > 1e-9 * scale for z in places):
            return None
        if any(abs(m) > 1e-9 * largest for m in silent):
            return None
        return self.about + places[0].real


def free_forces(
    engine: Engine, orders: int = 8, kind: Series = "exact", about: float | None = None
) -> list[FreeForces]:
    """Free forces and moments of orders 1 to ``orders`` about a place [m], by default the middle.

    ``kind``: the exact motion, or its usual approximation by first and second order.
    """
    if orders < 1:
        raise DataError(f"orders 1 to {orders}: expected one order at least")
    point = engine.middle if about is None else about
    size, length = force_scale(engine, point)
    free = []
    for k in range(1, (2 if kind == "second-order" else orders) + 1):
        force, moment = _sums(engine, k, kind, point)
        free.append(FreeForces(_clean(k, force, size), _clean(k, moment, size * length), point))
    return free


def force_scale(engine: Engine, about: float) -> tuple[float, float]:
    """Unbalance of all cylinders if they acted in phase [kg m], and the longest arm about a place [m]."""
    size = sum(c.crank.reciprocating_mass * c.crank.radius + abs(c.crank.rotating_unbalance) for c in engine.cylinders)
    return size, max((abs(c.at - about) for c in engine.cylinders), default=0.0)


def _sums(engine: Engine, k: int, kind: Series, about: float) -> tuple[list[complex], list[complex]]:
    """Forward and backward part of the force, and of the moment."""
    force, moment = np.zeros(2, dtype=complex), np.zeros(2, dtype=complex)
    for cylinder in engine.cylinders:
        crank, phi, beta = cylinder.crank, cylinder.throw, cylinder.bank
        coefficients = exact_series(crank, k) if kind == "exact" else second_order(crank)
        a = crank.reciprocating_mass * crank.radius * coefficients[k]
        forward = 0.5 * a * np.exp(1j * (k * phi - (k - 1) * beta))
        if k == 1:
            forward = forward + crank.rotating_unbalance * np.exp(1j * phi)
        parts = np.array([forward, 0.5 * a.conjugate() * np.exp(-1j * (k * phi - (k + 1) * beta))])
        force, moment = force + parts, moment + (cylinder.at - about) * parts
    for weight in engine.counterweights if k == 1 else ():
        force[0] += weight.vector
        moment[0] += (weight.at - about) * weight.vector
    return [complex(x) for x in force], [complex(x) for x in moment]


def _clean(order: int, parts: list[complex], size: float) -> RotatingVector:
    """Sums that are rounding error of their terms are zero."""
    forward, backward = (0j if abs(part) <= 1e-13 * size else part for part in parts)
    return RotatingVector(order, forward, backward)


def cylinder_sums(engine: Engine, order: int) -> dict[str, tuple[float, float]]:
    """The textbook's sums of an in-line engine: (sum cos k phi, sum sin k phi), and those weighted by z [m].

    F_k = m r omega^2 c_k (S_c cos k theta - S_s sin k theta); z counts from the first cylinder.
    """
    phi = np.array([c.throw - c.bank for c in engine.cylinders])
    z = np.array([c.at - engine.cylinders[0].at for c in engine.cylinders])
    cosine, sine = np.cos(order * phi), np.sin(order * phi)
    rounding = 1e-12 * len(phi) * max(1.0, float(np.abs(z).max()))

    def clean(value: float) -> float:
        return value if abs(value) > rounding else 0.0

    return {
        "force": (clean(float(cosine.sum())), clean(float(sine.sum()))),
        "moment": (clean(float(z @ cosine)), clean(float(z @ sine))),
    }


@dataclass(frozen=True)
class Shaft:
    """A shaft parallel to the crankshaft."""

    order: int
    forward: bool
    """Whether it turns with the crankshaft; at order times its speed."""
    unbalances: tuple[Unbalance, ...]
    """In its planes, at angles from x when the crankshaft's mark is at x, in the sense in which the crankshaft turns,
    of shafts that turn backward too [kg m]."""

    @property
    def is_crankshaft(self) -> bool:
        """Forward at first order: counterweights on the crankshaft do it."""
        return self.forward and self.order == 1


def balance_shafts(free: Sequence[FreeForces], first: float, last: float) -> list[Shaft]:
    """Shafts that remove the given orders, each with unbalances at ``first`` and ``last`` [m].

    Where one unbalance is enough, it is in the place of the resultant. Two equal shafts that turn against each other
    must be at equal height on both sides, or they add a moment about the crankshaft's axis.
    """
    needed = []
    for order in free:
        for forward in (True, False):
            force, moment = (part.forward if forward else part.backward for part in (order.force, order.moment))
            if force or moment:
                unbalances = _unbalances(order, force, moment, (first, last))
                needed.append(Shaft(order.force.order, forward, tuple(unbalances)))
    return needed


def _unbalances(order: FreeForces, force: complex, moment: complex, ends: tuple[float, float]) -> list[Unbalance]:
    """By the two-plane correction of a rotor that has force and moment, both per omega^2."""
    k, span = order.force.order, abs(ends[1] - ends[0])
    size = max(abs(force), abs(moment) / span) if span else abs(force)
    place = moment / force if abs(force) > 1e-12 * size else None
    if place is not None and abs(place.imag) <= 1e-9 * max(abs(place), span):
        return [Unbalance("1", -force / k**2, order.about + place.real)]
    pair = [Unbalance("force", force, order.about), Unbalance("+", moment, order.about + 1.0)]
    pair.append(Unbalance("-", -moment, order.about))
    correction = correct_planes(pair, [Plane("1", ends[0]), Plane("2", ends[1])])
    planes = zip(correction.planes, correction.vectors, strict=True)
    return [Unbalance(plane.name, vector / k**2, plane.at) for plane, vector in planes]


@dataclass(frozen=True)
class ResidualForces:
    """Force [N] and moment [N m] of one stage, over a turn and at their largest."""

    force: Complexes
    """x + iy, (n,) [N]."""
    largest_force: float
    """[N]."""
    moment: Complexes
    """Force times distance along the crankshaft, in the direction of the force, (n,) [N m]."""
    largest_moment: float
    """[N m]."""


@dataclass(frozen=True)
class ResidualOverTurn:
    """All stages over one turn at constant speed."""

    theta: Floats
    """Crank angles, (n,) [rad]."""
    stages: Mapping[str, ResidualForces]


def residual_over_turn(engine: Engine, shafts: Sequence[Shaft], omega: float, about: float) -> ResidualOverTurn:
    """Exact force and moment about a place [m] at constant speed [rad/s], by stage."""
    theta = np.append(crank_angles(_SAMPLES), 2 * np.pi)
    size, length = force_scale(engine, about)
    least = _ROUNDING * size * omega**2

    def residual(mounted: Sequence[Shaft]) -> ResidualForces:
        def force(at: Floats) -> Complexes:
            return engine.force(at, omega) + omega**2 * shaft_vectors(mounted, at)

        def moment(at: Floats) -> Complexes:
            return engine.tilting(at, omega, about=about) + omega**2 * shaft_vectors(mounted, at, about)

        return ResidualForces(*_over(force, theta, least), *_over(moment, theta, least * length))

    on_crank = [shaft for shaft in shafts if shaft.is_crankshaft]
    first_order = [shaft for shaft in shafts if shaft.order == 1]
    return ResidualOverTurn(theta, dict(zip(STAGES, map(residual, ((), on_crank, first_order, shafts)), strict=True)))


def _over(vector: Callable[[Floats], Complexes], theta: Floats, least: float) -> tuple[Complexes, float]:
    """Values over a turn and the largest modulus; what is rounding error of the cylinders' sum is zero."""
    values, (top, _) = vector(theta), largest_over_turn(lambda at: np.abs(vector(at)))
    return np.where(np.abs(values) > least, values, 0.0), top if top > least else 0.0


def shaft_vectors(shafts: Sequence[Shaft], theta: Floats, about: float | None = None) -> Complexes:
    """Sum of k^2 U e^(+-i k theta) over all unbalances at crank angles (n,) [rad], per omega^2, (n,) [kg m].

    With ``about`` [m] each is times its distance from there, (n,) [kg m2].
    """
    total: Complexes = np.zeros(np.shape(theta), dtype=complex)
    for shaft in shafts:
        turned = shaft.order**2 * np.exp((1j if shaft.forward else -1j) * shaft.order * np.asarray(theta))
        for u in shaft.unbalances:
            total = total + u.vector * turned * (1.0 if about is None else u.at - about)
    return total
