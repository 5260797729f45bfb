"""How the answer depends on the solver: harmonics of the balance, tolerance of integrators from standstill."""

from dataclasses import dataclass

import numpy as np

from .harmonic_balance import steady_rotation
from .machine import Machine
from .time_integration import Solver, start_up

METHODS: tuple[Solver, ...] = ("RK45", "DOP853")
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8)


@dataclass(frozen=True)
class Trial:
    """One solver's answer."""

    solver: str
    setting: str
    fluctuation: float
    """Coefficient of speed fluctuation, by the nominal speed."""
    evaluations: int | None = None
    """Of the equation of motion; None for the harmonic balance."""


def by_harmonics(machine: Machine, counts: tuple[int, ...] = (4, 8, 16, 24, 48, 96)) -> list[Trial]:
    """Harmonic balance with more and more harmonics."""
    return [
        Trial("harmonic balance", f"{count} harmonics", steady_rotation(machine, (count,)).fluctuation())
        for count in counts
    ]


def by_tolerance(machine: Machine, turns: int) -> list[Trial]:
    """Integration from standstill, the last of ``turns`` turns read off the solver's own steps, looser to tighter."""
    trials = []
    for method in METHODS:
        for rtol in TOLERANCES:
            run = start_up(machine, turns, 0.0, rtol, method)
            spread = run.turns[-1].fastest - run.turns[-1].slowest
            trials.append(Trial(method, f"rtol {rtol:g}", spread / machine.nominal_crank, run.evaluations))
    return trials


def scatter(trials: list[Trial], truth: float) -> float:
    """Largest deviation of the trials from the converged answer, relative to it."""
    return float(max(abs(np.array([trial.fluctuation for trial in trials]) - truth)) / truth)
