"""Balance shafts: the unbalances that remove an order of an engine's force and moment, and what remains with them.

A vector of order k that turns forward is removed by a shaft that turns forward at k omega with unbalance -P / k^2; one
that turns backward by a shaft that turns backward. Forward at first order that shaft is the crankshaft itself. Force
and moment together need two unbalances a shaft; a force with a fixed place, or a couple alone, fewer.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Complexes, Floats
from ..rotors.rotor import Plane, Unbalance, correct_planes
from .engine import Engine
from .free_forces import FreeForces, force_scale
from .partial_balance import crank_angles, largest_over_turn

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
