"""The flywheel that a wanted coefficient of speed fluctuation asks for."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.optimize import brentq

from ..results import Key
from . import DriveError
from .harmonic_balance import steady_rotation
from .machine import Machine


@dataclass(frozen=True)
class Flywheel:
    """A flywheel on the crank's or the motor's shaft."""

    inertia: Annotated[float, Key("inertia_kgm2")]
    """About its own shaft; zero where none is needed [kg m2]."""
    side: Annotated[str, Key()]
    """``crank`` or ``motor``."""
    fluctuation: Annotated[float, Key()]
    """Coefficient of speed fluctuation with it."""
    wanted: Annotated[float, Key("wanted_fluctuation")]
    """Coefficient of speed fluctuation that was asked for."""


def flywheel_for(
    machine: Machine, wanted: float, definition: str = "nominal", side: str = "crank", near: float | None = None
) -> Flywheel:
    """The smallest flywheel that brings the fluctuation down to ``wanted``, the motor's own answer included.

    Of the fastest steady rotation, or of that next to a speed of the crank ``near`` [rad/s].
    Raises DriveError where even 1e6 times the machine's own inertia does not.
    """
    if not 0.0 < wanted < 2.0:
        raise DriveError(f"wanted coefficient of fluctuation is {wanted:g}: expected a number between 0 and 2")

    def excess(inertia: float) -> float:
        return steady_rotation(machine.with_flywheel(inertia, side), near=near).fluctuation(definition) - wanted

    without = excess(0.0)
    if without <= 0.0:
        return Flywheel(0.0, side, without + wanted, wanted)
    own = float(np.mean(machine.inertia(np.linspace(0.0, 2.0 * np.pi, 64)))) / (
        machine.ratio**2 if side == "motor" else 1
    )
    low, high = 0.0, own
    while excess(high) > 0.0:
        low, high = high, 4.0 * high
        if high > 1e6 * own:
            raise DriveError(f"no flywheel up to {high:.3g} kg m2 brings the fluctuation down to {wanted:g}")
    inertia = float(brentq(excess, low, high, xtol=1e-12 * own, rtol=1e-12))
    return Flywheel(inertia, side, excess(inertia) + wanted, wanted)


def flywheel_estimate(machine: Machine, wanted: float) -> float:
    """The textbook's whole inertia dE / (omega^2 delta), dE the swing of weight's potential energy alone [kg m2].

    Motor and variable inertia are left out: an estimate to compare the solution with.
    """
    energy = machine.reduced.potential(np.linspace(0.0, 2.0 * np.pi, 100_000))
    return float(np.ptp(energy)) / (machine.nominal_crank**2 * wanted)
