"""Results of a log of encoder edges: the speed edge by edge, the comparison with a machine's equation of motion, JSON.

The speed edge by edge, start-up included, is the slope of local cubics of time over pulses. Keys carry their units.

Errors of an encoder disc: slots that are not at their even places.

They are estimated from a free run of the disc at nearly constant speed, or together with the steady turn where the disc
has another period than the crank.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from balance.arrays import Floats, Indices
from balance.errors import DataError
from balance.estimation.estimate import coverage_factor
from balance.results import Key, per_cent, plain, rpm

from ..errors import AnalysisError
from .encoder_edges import Edges, repetition
from .speed_fit import STEADY, SpeedEstimate, SteadySpeedFit, periodic_turn

if TYPE_CHECKING:
    from balance.drives.harmonic_balance import SteadyRotation
    from balance.drives.machine import Machine
    from balance.drives.time_integration import StartUp

COLUMNS = ("slot", "ahead_deg")
_ROUNDS = 8
"""Alternating estimates of the turn and the errors."""


@dataclass(frozen=True)
class PitchErrors:
    """Errors of a disc, slot 0 being that of the first edge."""

    ahead: Annotated[Floats, Key("ahead_deg", to=np.degrees)]
    """Angle by which each slot is ahead of its even place, mean zero, (pulses,) [rad of the encoder's shaft]."""
    error: Annotated[Floats, Key("half_width_deg", to=np.degrees)]
    """Half width of the 95 % interval of each, (pulses,) [rad]."""

    @property
    def rms(self) -> Annotated[float, Key("rms_percent_of_pitch", to=per_cent)]:
        """Root mean square of the errors over the pitch [-]."""
        return float(np.sqrt(np.mean(self.ahead**2)) * len(self.ahead) / (2.0 * np.pi))


def pitch_from_free_run(edges: Edges) -> PitchErrors:
    """Errors of the disc from a log of its shaft turning freely, at nearly constant speed.

    Each instant is compared with the mean of the turn of the disc about it, over which the errors cancel. A fluctuation
    that repeats every turn of this shaft would count as an error: the shaft must be uncoupled from the mechanism.
    Raises AnalysisError for lost edges or fewer than three turns.
    """
    pulses = edges.disc.pulses
    if edges.gaps:
        raise AnalysisError(f"{edges.name}: edges are lost: calibrate with a complete log")
    if len(edges.time) < 3 * pulses:
        raise AnalysisError(
            f"{edges.name}: {len(edges.time) / pulses:.1f} turns of the disc: expected 3 or more; take a longer log"
        )
    window = np.full(pulses + 1, 1.0 / pulses)
    window[[0, -1]] = 0.5 / pulses
    if pulses % 2:
        window = np.full(pulses, 1.0 / pulses)
    half = len(window) // 2
    middle = slice(half, len(edges.time) - half)
    late = edges.time[middle] - np.convolve(edges.time, window, "valid")
    rate = 2.0 * np.pi / np.gradient(np.convolve(edges.time, window, "valid")) / pulses
    return _by_slot(rate * late, edges.pulse[middle] % pulses, pulses)


def pitch_from_record(
    edges: Edges, harmonics: int | None = None, steady_within: float = STEADY
) -> tuple[PitchErrors, SteadySpeedFit]:
    """Errors of a disc that has another period than the crank, and the steady turn corrected for them.

    Both are estimated alternately. Raises AnalysisError where both have one period.
    """
    disc = edges.disc
    if not disc.pitch_is_separable:
        raise AnalysisError(
            f"{edges.name}: the disc turns {disc.ratio:g} times a turn of the crank: its errors repeat with the "
            "fluctuation and cannot be separated from it; calibrate the disc with a log of a free run (--calibrate)"
        )
    turn = periodic_turn(edges, harmonics, steady_within)
    ahead = np.zeros(disc.pulses)
    for _ in range(_ROUNDS):
        slot = turn.edges.pulse % disc.pulses
        rate = disc.ratio / turn.slope(turn.edges.angle)
        change = _by_slot(rate * turn.residual, slot, disc.pulses)
        ahead = ahead + change.ahead
        turn = periodic_turn(replace(edges, offset=ahead), turn.harmonics, steady_within)
    return PitchErrors(ahead, change.error), periodic_turn(replace(edges, offset=ahead), harmonics, steady_within)


def _by_slot(late: Floats, slot: "np.ndarray[Any, np.dtype[np.signedinteger[Any]]]", pulses: int) -> PitchErrors:
    """Mean of angles (n,) [rad] by slot, a late slot being ahead, and its interval from their scatter."""
    have = np.bincount(slot, minlength=pulses)
    if (have == 0).any():
        raise AnalysisError(f"slot {int(np.argmin(have))} of the disc does not appear in the log")
    mean = np.bincount(slot, late, pulses) / have
    spread = late - mean[slot]
    degrees_of_freedom = max(len(late) - pulses, 1)
    error = coverage_factor(degrees_of_freedom) * np.sqrt((spread**2).sum() / degrees_of_freedom / have)
    return PitchErrors(mean - mean.mean(), error)


def write_pitch_errors(pitch: PitchErrors, path: Path) -> None:
    """Write the errors of a disc as CSV, in the columns COLUMNS."""
    rows = [f"{k},{np.degrees(angle):.9g}" for k, angle in enumerate(pitch.ahead)]
    path.write_text("\n".join([",".join(COLUMNS), *rows, ""]), encoding="utf-8")


def read_pitch_errors(path: Path, pulses: int) -> Floats:
    """Errors of a disc with ``pulses`` slots from a CSV, (pulses,) [rad]. Raises DataError for another table."""
    import csv

    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file, strict=True))
        slots, ahead = [int(row["slot"]) for row in rows], [float(row["ahead_deg"]) for row in rows]
    except (csv.Error, UnicodeDecodeError, KeyError, ValueError, TypeError) as error:
        raise DataError(f"{path.name}: expected the columns {','.join(COLUMNS)} of numbers") from error
    if slots != list(range(pulses)) or not np.isfinite(ahead).all():
        raise DataError(f"{path.name}: {len(slots)} slots; expected slots 0 to {pulses - 1} in order, finite angles")
    return np.radians(ahead)


HALF_WIDTH = 4
"""Edges on each side of a local cubic."""
RPM = math.pi / 30.0
"""One revolution per minute [rad/s]."""
FAR_FROM_NOMINAL = 1.5
"""Factor between mean and nominal speed from which there is a finding: slip of a motor is less, a gearbox more."""
COARSE_CLOCK = 0.01
"""Step of the clock over the interval between edges from which there is a finding."""
_GRID = 720
"""Angles of a turn for comparing curves."""
_DEGREES = np.arange(361.0)


@dataclass(frozen=True)
class SpeedHistory:
    """Speed of the crank at edges, except at the ends of the log and next to gaps."""

    time: Annotated[Floats, Key("time_s")]
    """Instants of the edges, (n,) [s]."""
    angle: Annotated[Floats, Key("angle_deg_from_first_edge", to=np.degrees)]
    """Angle of the crank from the first edge, (n,) [rad]."""
    speed: Annotated[Floats, Key("speed_rpm", to=rpm)]
    """Speed of the crank, (n,) [rad/s]."""
    error: Annotated[Floats, Key("half_width_rpm", to=rpm)]
    """Half width of the 95 % interval, from the residual of the local cubics, (n,) [rad/s]."""


def speed_history(edges: Edges, half_width: int = HALF_WIDTH) -> SpeedHistory:
    """Speed wherever ``2 half_width + 1`` edges in a row have no gap; errors of the disc are neglected."""
    slope, rest = _cubic(half_width)
    pieces = [piece for piece in _pieces(edges) if len(piece) > 2 * half_width]
    middle = np.concatenate([piece[half_width:-half_width] for piece in pieces] or [np.empty(0, dtype=int)])
    per_pulse, residual = _weighted(edges, pieces, slope), _weighted(edges, pieces, rest)
    per_edge = 2.0 * np.pi / edges.disc.per_turn
    noise = float(np.median(np.abs(residual))) / 0.6745 / float(np.linalg.norm(rest)) if len(residual) else 0.0
    speed = per_edge / per_pulse
    error = coverage_factor() * noise * float(np.linalg.norm(slope)) * speed**2 / per_edge
    return SpeedHistory(edges.time[middle], edges.angle[middle], speed, error)


def _weighted(edges: Edges, pieces: list[Indices], weights: Floats) -> Floats:
    """Weighted sums of neighbouring instants, piece by piece."""
    sums = [np.convolve(edges.time[piece], weights[::-1], "valid") for piece in pieces]
    return np.concatenate(sums) if sums else np.empty(0)


def _pieces(edges: Edges) -> list[Indices]:
    """Indices of edges between gaps."""
    return np.split(np.arange(len(edges.time)), np.flatnonzero(np.diff(edges.pulse) > 1) + 1)


def _cubic(half_width: int) -> tuple[Floats, Floats]:
    """Weights of the slope and of the residual in the middle, (2 half_width + 1,) each [-]."""
    k = np.arange(-half_width, half_width + 1.0)
    inverse = np.linalg.pinv(np.vander(k, 4, increasing=True))
    rest = -inverse[0]
    rest[half_width] += 1.0
    return inverse[1], rest


@dataclass(frozen=True)
class JointFit:
    """A measured steady turn and the computed one."""

    turn: SteadySpeedFit
    solution: "SteadyRotation"
    first_edge: float
    """Angle of the crank at the first edge [rad]."""
    aligned: bool
    """Whether that angle was found by aligning both curves; else it was given."""

    def computed(self, phi: Floats) -> Floats:
        """Computed speed at angles (n,) [rad] from the first edge, (n,) [rad/s]."""
        return self.solution.rate(self.solution.machine.reduced.direction * self.first_edge + phi)

    def rms_difference(self) -> float:
        """Root mean square of measured less computed speed over a turn [rad/s]."""
        phi = 2.0 * np.pi * np.arange(_GRID) / _GRID
        return float(np.sqrt(np.mean((self.turn.speed(phi) - self.computed(phi)) ** 2)))


def drive_machine(name: str, nominal: float, reading: str | None) -> "Machine":
    """The machine of a drive file at a nominal speed of its motor [rad/s].

    ``reading`` is how the gearbox's torque is read. Raises AnalysisError where neither it nor the file says so.
    """
    from balance.drives.drive_files import load_drive

    drive = load_drive(name)
    if reading is None and drive.reading is None:
        raise AnalysisError(
            f"{drive.name} does not state how the gearbox's torque is read: give --reading geared or ungeared"
        )
    drive = replace(drive, speeds=(nominal,), reading=reading or drive.reading)
    return drive.machines(drive.load_mechanism())[0]


def joint_fit(turn: SteadySpeedFit, machine: "Machine", first_edge: float | None = None) -> JointFit:
    """The measured turn and the machine's steady rotation; without ``first_edge`` [rad] the curves are aligned."""
    from balance.drives.harmonic_balance import steady_rotation

    solution = steady_rotation(machine)
    aligned = first_edge is None
    angle = _alignment(turn, solution) if first_edge is None else first_edge
    return JointFit(turn, solution, angle, aligned)


def computed_start_up(machine: "Machine", turns: int, start: float) -> "StartUp":
    """The machine's computed start from standstill at a crank angle [rad]."""
    from balance.drives.time_integration import start_up

    return start_up(machine, turns, machine.reduced.direction * start)


def start_up_delay(measured: SpeedHistory, computed: "StartUp") -> float:
    """Time to add to the computed start so that both end their first turn together [s]."""
    turn = computed.travel[0] + 2.0 * np.pi
    theirs = float(np.interp(turn, computed.travel, computed.time))
    return float(np.interp(2.0 * np.pi, measured.angle, measured.time)) - theirs


def _alignment(turn: SteadySpeedFit, solution: "SteadyRotation") -> float:
    """Angle of the first edge for which the curves differ least, by correlation over a turn [rad]."""
    phi = 2.0 * np.pi * np.arange(_GRID) / _GRID
    measured, computed = turn.speed(phi), solution.rate(phi)
    lag = np.fft.irfft(np.fft.rfft(computed) * np.conj(np.fft.rfft(measured)), _GRID)
    travel = float(phi[int(np.argmax(lag))])
    return float(np.mod(solution.machine.reduced.direction * travel, 2.0 * np.pi))


def edges_document(record: Edges) -> dict[str, Any]:
    """The log as JSON: edges, clock, gaps."""
    step = record.clock_step
    return {
        "log": record.name,
        "edges": len(record.time),
        "pulses_per_disc_turn": record.disc.pulses,
        "disc_turns_per_crank_turn": record.disc.ratio,
        "crank_turns": float(record.angle[-1] / (2.0 * np.pi)),
        "motion_repeats_every_edges": repetition(record),
        "clock_step_us": None if step is None else step * 1e6,
        "lost_edges": plain(record.gaps),
    }


def turn_document(found: SteadySpeedFit, nominal: float | None) -> dict[str, Any]:
    """The steady turn with its 95 % intervals as JSON."""
    phi = np.radians(_DEGREES)
    return {
        "turns_used": found.turns,
        "turns_left_out": found.unsteady_turns,
        "harmonics": found.harmonics,
        "jitter_us": found.jitter * 1e6,
        "repeated_percent_of_pitch": 100.0 * found.repeated,
        "nominal_rpm": None if nominal is None else nominal / RPM,
        "fastest_rpm": _interval(found.fastest, RPM),
        "fastest_at_deg_from_first_edge": math.degrees(found.fastest_at),
        "slowest_rpm": _interval(found.slowest, RPM),
        "slowest_at_deg_from_first_edge": math.degrees(found.slowest_at),
        "mean_rpm": _interval(found.mean, RPM),
        "fluctuation": _interval(found.fluctuation(nominal), 1.0),
        "fluctuation_by": "mean speed over time" if nominal is None else "nominal speed",
        "turn": {
            "angle_deg_from_first_edge": _DEGREES.tolist(),
            "speed_rpm": (found.speed(phi) / RPM).tolist(),
            "half_width_rpm": (found.speed_error(phi) / RPM).tolist(),
        },
    }


def model_document(fit: JointFit, nominal: float) -> dict[str, Any]:
    """The comparison with the computed turn as JSON."""
    solution, found = fit.solution, fit.turn
    return {
        "mechanism": solution.machine.reduced.mechanism.name,
        "reading": solution.machine.reading,
        "motor_nominal_rpm": solution.machine.nominal / RPM,
        "first_edge_at_deg": math.degrees(fit.first_edge),
        "first_edge_found_by_alignment": fit.aligned,
        "fluctuation": solution.fluctuation(),
        "fluctuation_in_interval": found.fluctuation(nominal).contains(solution.fluctuation()),
        "fastest_rpm": solution.fastest[1] / RPM,
        "slowest_rpm": solution.slowest[1] / RPM,
        "mean_rpm": solution.mean_speed / RPM,
        "rms_difference_rpm": fit.rms_difference() / RPM,
        "turn": {
            "angle_deg_from_first_edge": _DEGREES.tolist(),
            "speed_rpm": (fit.computed(np.radians(_DEGREES)) / RPM).tolist(),
        },
    }


def start_up_document(computed: "StartUp", later: float) -> dict[str, Any]:
    """The computed start as JSON, shifted by ``later`` [s] so that its first turn ends with the measured one."""
    thin = slice(None, None, 6)
    return {
        "moved_by_s": later,
        "time_s": (computed.time[thin] + later).tolist(),
        "speed_rpm": (computed.speed[thin] / RPM).tolist(),
        "turns": [
            {"turn": t.number, "end_s": t.end + later, "fastest_rpm": t.fastest / RPM, "slowest_rpm": t.slowest / RPM}
            for t in computed.turns
        ],
    }


def speed_findings(record: Edges, found: SteadySpeedFit | None) -> list[str]:
    """Findings about a log and its steady turn."""
    odd = [f"lost edges bridged: {gap.text()}" for gap in record.gaps]
    interval, step = float(np.median(np.diff(record.time))), record.clock_step
    if step is not None and step > COARSE_CLOCK * interval:
        odd.append(
            f"the clock's step of {step * 1e6:g} us is {100 * step / interval:.1f} % of an interval between edges"
        )
    again = repetition(record) if found is not None else None
    if again is not None and (times := round(record.disc.per_turn / again)) > 1:
        odd.append(
            f"the motion repeats every {again} edges already, {times} times a turn of {record.disc.per_turn:g}: if the "
            f"disc has {record.disc.pulses / times:g} edges a turn, not {record.disc.pulses}, all speeds are {times} "
            "times as high; check --pulses"
        )
    if found is not None and found.repeated > 0.0:
        odd.append(
            f"slots of the disc are {100 * found.repeated:.2g} % of the pitch out of place: in the speed edge by edge "
            "that looks like fluctuation, the steady turn suppresses it; --pitch takes a calibration"
        )
    return odd


def nominal_speed_findings(found: SteadySpeedFit, nominal: float | None) -> list[str]:
    """A finding if the mean speed is far from the ``nominal`` one [rad/s], by which the fluctuation is divided."""
    times = 1.0 if nominal is None else found.mean.value / nominal
    if nominal is None or 1.0 / FAR_FROM_NOMINAL <= times <= FAR_FROM_NOMINAL:
        return []
    return [
        f"the mean speed of {found.mean.value / RPM:.4g} rpm is {times:.3g} times the nominal {nominal / RPM:.4g} rpm: "
        "the fluctuation is divided by the nominal speed; it must be the crank's, not the motor's: check --nominal, "
        "--ratio, --pulses"
    ]


def _interval(estimate: SpeedEstimate, unit: float) -> dict[str, float]:
    return {"value": estimate.value / unit, "low": estimate.low / unit, "high": estimate.high / unit}
