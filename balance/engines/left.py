"""What is left of an engine's exact force and moment, once its counterweights and balance shafts turn with it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from .engine import Engine
from .orders import scale
from .peak import largest, turn
from .shafts import Shaft
from .slidercrank import Complexes

STAGES = {
    "before": "as described",
    "counterweights": "with the crankshaft's counterweights",
    "shafts": "and the balance shafts",
}
"""As it is; with the unbalances that belong on the crankshaft; and with the balance shafts."""
_SAMPLES = 360
ROUNDING = 1e-13
"""A sum this small beside those that it is the sum of is zero."""


@dataclass(frozen=True)
class Left:
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
class OverATurn:
    """All stages over one turn at constant speed."""

    theta: Floats
    """Crank angles, (n,) [rad]."""
    stages: Mapping[str, Left]


def over_a_turn(engine: Engine, shafts: Sequence[Shaft], omega: float, about: float) -> OverATurn:
    """Exact force and moment about a place [m] at constant speed [rad/s], by stage."""
    theta = np.append(turn(_SAMPLES), 2 * np.pi)
    on_crank = [shaft for shaft in shafts if shaft.is_crankshaft]
    added: dict[str, Sequence[Shaft]] = {"before": (), "counterweights": on_crank, "shafts": shafts}
    return OverATurn(theta, {stage: _left(engine, added[stage], theta, omega, about) for stage in STAGES})


def _left(engine: Engine, shafts: Sequence[Shaft], theta: Floats, omega: float, about: float) -> Left:
    def force(at: Floats) -> Complexes:
        return engine.force(at, omega) + omega**2 * _turning(shafts, at, None)

    def moment(at: Floats) -> Complexes:
        return engine.tilting(at, omega, about=about) + omega**2 * _turning(shafts, at, about)

    size, length = scale(engine, about)
    return Left(
        *_over(force, theta, ROUNDING * size * omega**2), *_over(moment, theta, ROUNDING * size * length * omega**2)
    )


def _over(vector: Callable[[Floats], Complexes], theta: Floats, least: float) -> tuple[Complexes, float]:
    """Values over a turn and the largest size; what is rounding error of the cylinders' sum is zero."""
    values, (top, _) = vector(theta), largest(lambda at: np.abs(vector(at)))
    return np.where(np.abs(values) > least, values, 0.0), top if top > least else 0.0


def _turning(shafts: Sequence[Shaft], theta: Floats, about: float | None) -> Complexes:
    """k^2 U e^(+-i k theta) of all unbalances, per omega^2; times z - about where that is given."""
    total: Complexes = np.zeros(np.shape(theta), dtype=complex)
    for shaft in shafts:
        turned = shaft.order**2 * np.exp((1j if shaft.forward else -1j) * shaft.order * np.asarray(theta))
        for u in shaft.unbalances:
            total = total + u.vector * turned * (1.0 if about is None else u.at - about)
    return total
