"""A measured turn or start held against the machine's equation of motion."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError
from .course import Course
from .turn import Turn

if TYPE_CHECKING:
    from balance.drives.machine import Machine
    from balance.drives.startup import StartUp
    from balance.drives.steady import Steady

_GRID = 720


@dataclass(frozen=True)
class Held:
    """A measured steady turn beside the computed one."""

    turn: Turn
    solution: "Steady"
    first_edge: float
    """Angle of the crank at the first edge [rad]."""
    aligned: bool
    """Whether that angle was found by laying the curves over each other; else it was given."""

    def computed(self, phi: Floats) -> Floats:
        """Computed speed at angles from the first edge [rad/s]."""
        return self.solution.rate(self.solution.machine.reduced.direction * self.first_edge + phi)

    def rms_difference(self) -> float:
        """Root mean square of measured less computed speed over a turn [rad/s]."""
        phi = 2.0 * np.pi * np.arange(_GRID) / _GRID
        return float(np.sqrt(np.mean((self.turn.speed(phi) - self.computed(phi)) ** 2)))


def machine_of(name: str, nominal: float, reading: str | None) -> "Machine":
    """The machine of a drive file at a nominal speed of its motor [rad/s].

    Raises AnalysisError where the file leaves open how the gearbox's torque is read and nothing is said of it.
    """
    from balance.drives.drive_files import load_drive

    drive = load_drive(name)
    if reading is None and drive.reading is None:
        raise AnalysisError(
            f"{drive.name} leaves open how the gearbox's torque is read: say --reading geared or ungeared"
        )
    drive = replace(drive, speeds=(nominal,), reading=reading or drive.reading)
    return drive.machines(drive.load_mechanism())[0]


def hold(turn: Turn, machine: "Machine", first_edge: float | None = None) -> Held:
    """The measured turn beside the machine's steady rotation; without ``first_edge`` [rad] the curves are aligned."""
    from balance.drives.steady import steady

    solution = steady(machine)
    aligned = first_edge is None
    angle = _alignment(turn, solution) if first_edge is None else first_edge
    return Held(turn, solution, angle, aligned)


def start_beside(machine: "Machine", turns: int, start: float) -> "StartUp":
    """The machine's computed start from standstill at a crank angle [rad]."""
    from balance.drives.startup import start_up

    return start_up(machine, turns, machine.reduced.direction * start)


def delay(measured: Course, computed: "StartUp") -> float:
    """Time to add to the computed start so that both end their first turn together [s]."""
    turn = computed.travel[0] + 2.0 * np.pi
    theirs = float(np.interp(turn, computed.travel, computed.time))
    return float(np.interp(2.0 * np.pi, measured.angle, measured.time)) - theirs


def _alignment(turn: Turn, solution: "Steady") -> float:
    """Angle of the first edge for which the curves differ least, by correlation over a turn [rad]."""
    phi = 2.0 * np.pi * np.arange(_GRID) / _GRID
    measured, computed = turn.speed(phi), solution.rate(phi)
    lag = np.fft.irfft(np.fft.rfft(computed) * np.conj(np.fft.rfft(measured)), _GRID)
    travel = float(phi[int(np.argmax(lag))])
    return float(np.mod(solution.machine.reduced.direction * travel, 2.0 * np.pi))
