"""Turns integrated in time, by a general solver: the independent referee of the harmonic balance."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, cast

import numpy as np
from scipy.integrate import solve_ivp

from ..arrays import Floats
from .errors import DriveError
from .machine import Machine
from .steady import Steady

if TYPE_CHECKING:
    from scipy.integrate import OdeSolution

Solver = Literal["RK45", "DOP853"]
RTOL = 1e-10
"""Relative tolerance of an integration unless asked otherwise."""
_PATIENCE = 200
"""Turns at nominal speed within which a turn must be done."""


@dataclass(frozen=True)
class Stretch:
    """An integrated piece of motion."""

    outcome: Literal["arrived", "turns back", "creeps"]
    time: float
    """At its end [s]."""
    state: Floats
    """Travel and speed at its end, (2,) [rad, rad/s]."""
    course: "OdeSolution"
    """Travel and speed at any instant."""
    evaluations: int
    """Of the equation of motion."""


def run_to(
    machine: Machine, time: float, state: Floats, target: float, rtol: float = RTOL, method: Solver = "DOP853"
) -> Stretch:
    """Integrate from ``time`` and ``state`` until the travel reaches ``target`` [rad], or the crank turns back."""

    def arrived(_time: float, state: Floats) -> float:
        return float(state[0]) - target

    def turned_back(_time: float, state: Floats) -> float:
        return float(state[1]) + 1e-9 * machine.nominal_crank

    arrived.terminal = turned_back.terminal = True  # type: ignore[attr-defined]
    arrived.direction, turned_back.direction = 1.0, -1.0  # type: ignore[attr-defined]
    limit = time + _PATIENCE * 2.0 * np.pi / machine.nominal_crank
    solved = solve_ivp(
        lambda _, state: [float(state[1]), machine.acceleration(float(state[0]), float(state[1]))],
        (time, limit), state, method, events=(arrived, turned_back), dense_output=True, rtol=rtol, atol=rtol,
    )  # fmt: skip
    hits = [len(times) > 0 for times in solved.t_events or []]
    outcome: Literal["arrived", "turns back", "creeps"] = (
        "arrived" if hits[0] else "turns back" if hits[1] else "creeps"
    )
    return Stretch(outcome, float(solved.t[-1]), solved.y[:, -1], cast("OdeSolution", solved.sol), solved.nfev)


def after_a_turn(machine: Machine, rate: float, rtol: float = RTOL) -> float:
    """Speed of the crank after one turn that starts at travel 0 with speed ``rate`` [rad/s]."""
    end = run_to(machine, 0.0, np.array([0.0, rate]), 2.0 * np.pi, rtol)
    if end.outcome != "arrived":
        raise DriveError(f"{machine.reduced.mechanism.name}: the crank {end.outcome} from {rate:.6g} rad/s at angle 0")
    return float(end.state[1])


def periodicity(solution: Steady, rtol: float = 1e-12) -> float:
    """How far the speed is off after a turn integrated from the steady solution, relative to it."""
    start = float(solution.rate(0.0))
    return abs(after_a_turn(solution.machine, start, rtol) - start) / start


def floquet(solution: Steady, share: float = 1e-4) -> float:
    """The Floquet factor by two disturbed turns: central difference of the speed after a turn."""
    start = float(solution.rate(0.0))
    ahead, behind = (after_a_turn(solution.machine, start * (1.0 + s), 1e-12) for s in (share, -share))
    return (ahead - behind) / (2.0 * share * start)
