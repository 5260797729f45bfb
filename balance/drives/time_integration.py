"""The machine integrated in time by a general solver: start-up from standstill, and a check of the harmonic balance.

A steady solution repeats after an integrated turn. How far the answer depends on harmonics and tolerances is shown by
solving with several of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, cast

import numpy as np
from scipy.integrate import solve_ivp

from ..arrays import Floats, parabola_peak
from ..results import Key, rpm
from . import DriveError
from .harmonic_balance import SteadyRotation, steady_rotation, steady_rotations
from .machine import Machine

if TYPE_CHECKING:
    from scipy.integrate import OdeSolution
    from scipy.integrate._ivp.ivp import OdeResult

Solver = Literal["RK45", "DOP853"]
RTOL = 1e-10
"""Relative tolerance of an integration by default."""
_COARSE = 1e-6
"""Where it is only asked whether the crank comes round."""
_PATIENCE = 200
"""Turns at nominal speed within which a turn must be done."""
_SAMPLES = 720
"""Instants of a turn that are kept."""
SOLVERS: tuple[Solver, ...] = ("RK45", "DOP853")
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
"""Relative tolerances of the study of solvers."""


def run_to(
    machine: Machine, time: float, state: Floats, target: float, rtol: float = RTOL, method: Solver = "DOP853"
) -> tuple[Literal["arrived", "turns back", "creeps"], "OdeResult"]:
    """Integrate from ``time`` [s] and ``state``, travel and speed (2,) [rad, rad/s], until travel ``target`` [rad].

    Or until the crank turns back, or creeps.
    """

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
    return "arrived" if hits[0] else "turns back" if hits[1] else "creeps", solved


def after_a_turn(machine: Machine, rate: float, rtol: float = RTOL) -> float:
    """Speed of the crank after one turn that starts at travel 0 with speed ``rate`` [rad/s]."""
    outcome, solved = run_to(machine, 0.0, np.array([0.0, rate]), 2.0 * np.pi, rtol)
    if outcome != "arrived":
        raise DriveError(f"{machine.reduced.mechanism.name}: the crank {outcome} from {rate:.6g} rad/s at angle 0")
    return float(solved.y[1, -1])


def periodicity(solution: SteadyRotation, rtol: float = 1e-12) -> float:
    """How far the speed is off after a turn integrated from the steady solution, relative to it."""
    start = float(solution.rate(0.0))
    return abs(after_a_turn(solution.machine, start, rtol) - start) / start


@dataclass(frozen=True)
class Turn:
    """One turn of the crank."""

    number: Annotated[int, Key("turn", "turn", "d")]
    end: Annotated[float, Key("end_s", "ends at [s]", ".4f")]
    """Time at which it ends [s]."""
    fastest: Annotated[float, Key("fastest_rpm", "n_max [rpm]", ".3f", to=rpm)]
    """Largest speed in it [rad/s]."""
    slowest: Annotated[float, Key("slowest_rpm", "n_min [rpm]", ".3f", to=rpm)]
    """Smallest speed in it [rad/s]."""


@dataclass(frozen=True)
class StartUp:
    """A start from standstill."""

    time: Floats
    """(n,) [s]."""
    travel: Floats
    """Travel of the crank, (n,) [rad]."""
    speed: Floats
    """Speed of the crank, (n,) [rad/s]."""
    turns: tuple[Turn, ...]
    evaluations: int
    """Of the equation of motion."""

    def settled(self, fastest: float, slowest: float, within: float) -> int | None:
        """First turn whose extremes are within ``within`` [rad/s] of those of the steady state; None if none is."""
        near = (t for t in self.turns if max(abs(t.fastest - fastest), abs(t.slowest - slowest)) <= within)
        return next((turn.number for turn in near), None)


def start_up(
    machine: Machine, turns: int = 8, start: float = 0.0, rtol: float = RTOL, method: Solver = "DOP853"
) -> StartUp:
    """Start from standstill at the crank's travel ``start`` [rad], and run for a number of turns.

    Raises DriveError, naming the angle, where the motor cannot move the crank, or does not bring it round.
    """
    name, direction = machine.reduced.mechanism.name, machine.reduced.direction
    pull = float(machine.motor_torque(0.0))
    net = float(machine.torque(start, 1e-12 * machine.nominal_crank)) - float(machine.reduced.potential_slope(start))
    if not net > 0.0:
        raise DriveError(
            f"{name} does not start at {np.degrees(direction * start):g} deg: "
            f"{pull:.4g} N m of the motor at the crank against {pull - net:.4g} N m; start it elsewhere"
        )
    state, time, done, evaluations = np.array([start, 0.0]), 0.0, [], 0
    pieces: list[tuple[Floats, Floats]] = []
    for number in range(1, turns + 1):
        outcome, solved = run_to(machine, time, state, start + 2.0 * np.pi * number, rtol, method)
        instants = np.linspace(time, float(solved.t[-1]), _SAMPLES + 1)
        time, state = float(solved.t[-1]), solved.y[:, -1]
        if outcome != "arrived":
            angle = np.degrees(direction * float(state[0])) % 360.0
            raise DriveError(
                f"{name} does not come round in its start-up: the crank {outcome} at {angle:.1f} deg after "
                f"{time:.3g} s; the motor is too weak or starts in the wrong place"
            )
        course = cast("OdeSolution", solved.sol)(instants)
        evaluations += solved.nfev
        both = (course[1], -course[1])
        fastest, least = (parabola_peak(speed, int(np.argmax(speed)))[1] for speed in both)
        done.append(Turn(number, time, fastest, -least))
        pieces.append((instants[:-1], course[:, :-1]))
    course = np.hstack([piece for _, piece in pieces] + [state[:, None]])
    return StartUp(np.r_[*(t for t, _ in pieces), time], course[0], course[1], tuple(done), evaluations)


def reached_from_rest(solutions: Sequence[SteadyRotation], start: float = 0.0) -> SteadyRotation | None:
    """Which of all steady rotations of a machine, the fastest first, a start from standstill ends in.

    Courses of the kinetic energy over the travel never cross: a crank that comes round once from rest is below the
    slowest steady rotation and gains on each turn, up to that. None where that one is unstable. Raises DriveError,
    naming the angle, where the crank does not come round.
    """
    start_up(solutions[0].machine, 1, start, _COARSE)
    return solutions[-1] if solutions[-1].is_stable else None


def rotations_from_rest(
    machine: Machine, start: float
) -> tuple[list[SteadyRotation], SteadyRotation | None, str | None]:
    """All steady rotations, that in which a start at travel ``start`` [rad] ends, and why there is none of either."""
    solutions: list[SteadyRotation] = []
    try:
        solutions = steady_rotations(machine)
        return solutions, reached_from_rest(solutions, start), None
    except DriveError as error:
        return solutions, None, str(error)


@dataclass(frozen=True)
class SolverTrial:
    """One solver's answer."""

    solver: str
    setting: str
    fluctuation: float
    """Coefficient of speed fluctuation, by the nominal speed."""
    evaluations: int | None = None
    """Of the equation of motion; None for the harmonic balance."""


def by_harmonics(machine: Machine, counts: tuple[int, ...] = (4, 8, 16, 24, 48, 96)) -> list[SolverTrial]:
    """Harmonic balance with more and more harmonics."""
    return [
        SolverTrial("harmonic balance", f"{count} harmonics", steady_rotation(machine, (count,)).fluctuation())
        for count in counts
    ]


def by_tolerance(machine: Machine, turns: int) -> list[SolverTrial]:
    """Integration from standstill, the last of ``turns`` turns read off the solver's own steps, looser to tighter."""
    trials = []
    for method in SOLVERS:
        for rtol in TOLERANCES:
            run = start_up(machine, turns, 0.0, rtol, method)
            spread = run.turns[-1].fastest - run.turns[-1].slowest
            trials.append(SolverTrial(method, f"rtol {rtol:g}", spread / machine.nominal_crank, run.evaluations))
    return trials


def solver_scatter(trials: list[SolverTrial], truth: float) -> float:
    """Largest deviation of the trials from the converged answer, relative to it."""
    return float(max(abs(np.array([trial.fluctuation for trial in trials]) - truth)) / truth)
