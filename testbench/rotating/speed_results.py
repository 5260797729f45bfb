"""Results of a log of encoder edges: the speed edge by edge, the comparison with a machine's equation of motion, JSON.

The speed edge by edge, start-up included, is the slope of local cubics of time over pulses. Keys carry their units.

Errors of an encoder disc: slots that are not at their even places.

They are estimated from a free run of the disc at nearly constant speed, or together with the steady turn where the disc
has another period than the crank. A log begins at any line of its disc: which one, the errors of single lines tell, or
lines that are missing, or an index pulse.
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
from .encoder_edges import Edges, repetition, worn_text
from .speed_fit import MOST_HARMONICS, STEADY, SpeedEstimate, SteadySpeedFit, periodic_turn, time_regressor

if TYPE_CHECKING:
    from balance.drives.harmonic_balance import SteadyRotation
    from balance.drives.machine import Machine
    from balance.drives.time_integration import StartUp

COLUMNS = ("slot", "ahead_deg", "half_width_deg", "lines_from_index")
"""Of a file of errors; the first two are required. A line that is missing has an empty ``ahead_deg``."""
_ROUNDS = 8
"""Alternating estimates of the turn and the errors."""
_OTHER_PLACES = 1e-3
"""Odds of all other places of a calibration together, against the best one, up to which that is taken [-]."""
TURNS_TO_SEPARATE = 3
"""Turns of the crank from which a log tells errors of a disc on another shaft."""
_SAME_LINE = 0.25
"""Lines by which an index pulse may come elsewhere."""


def _degrees(angles: Floats) -> list[float | None]:
    return [None if math.isnan(angle) else math.degrees(angle) for angle in angles]


@dataclass(frozen=True)
class PitchErrors:
    """Errors of a disc, slot 0 being that of the first edge of the log they are from."""

    ahead: Annotated[Floats, Key("ahead_deg", to=_degrees)]
    """Angle by which each slot is ahead of its even place, mean zero, NaN where the disc lacks the line, (pulses,) [rad
    of the encoder's shaft]."""
    error: Annotated[Floats, Key("half_width_deg", to=_degrees)]
    """Half width of the 95 % interval of each, NaN as above, (pulses,) [rad]."""
    index: Annotated[float | None, Key("index_at_line")] = None
    """Where the index pulse comes, in lines from slot 0 [-]; None without one."""

    @property
    def rms(self) -> Annotated[float, Key("rms_percent_of_pitch", to=per_cent)]:
        """Root mean square of the errors over the pitch [-]."""
        return float(np.sqrt(np.nanmean(self.ahead**2)) * len(self.ahead) / (2.0 * np.pi))


def pitch_from_free_run(edges: Edges, index: Floats | None = None) -> PitchErrors:
    """Errors of the disc from a log of its shaft turning freely, at nearly constant speed.

    Each instant is compared with the mean of the turn of the disc about it, over which the errors cancel. A missing
    line is thought between its neighbours for that mean, and has no error. A fluctuation that repeats every turn of
    this shaft would count as an error: the shaft must be uncoupled from the mechanism. ``index`` are the instants (n,)
    [s] of the index pulse. Raises AnalysisError for fewer than three turns.
    """
    pulses, number = edges.disc.pulses, np.arange(edges.pulse[-1] + 1)
    if len(number) < 3 * pulses:
        raise AnalysisError(
            f"{edges.name}: {len(number) / pulses:.1f} turns of the disc: expected 3 or more; take a longer log"
        )
    time = np.interp(number, edges.pulse, edges.time)
    window = np.full(pulses + 1, 1.0 / pulses)
    window[[0, -1]] = 0.5 / pulses
    if pulses % 2:
        window = np.full(pulses, 1.0 / pulses)
    half = len(window) // 2
    middle = slice(half, len(time) - half)
    late = time[middle] - np.convolve(time, window, "valid")
    rate = 2.0 * np.pi / np.gradient(np.convolve(time, window, "valid")) / pulses
    have = np.isin(number[middle], edges.pulse)
    found = _by_slot((rate * late)[have], number[middle][have] % pulses, pulses)
    return found if index is None else replace(found, index=_index_line(edges, index))


def _index_line(edges: Edges, index: Floats) -> float:
    """Where the index pulses (n,) [s] come, in lines from the slot of the first edge [-]."""
    inside = index[(index >= edges.time[0]) & (index <= edges.time[-1])]
    turn = 2.0 * np.pi * np.interp(inside, edges.time, edges.pulse) / edges.disc.pulses
    middle = float(np.angle(np.exp(1j * turn).mean())) if len(inside) else 0.0
    off = np.abs(np.angle(np.exp(1j * (turn - middle)))).max(initial=0.0) * edges.disc.pulses / (2.0 * np.pi)
    if not len(inside) or off > _SAME_LINE:
        places = f"come up to {off:.2g} lines apart" if len(inside) else "are not within the log of the edges"
        raise AnalysisError(
            f"{edges.name}: the index pulses {places}: expected one a turn of the disc at the same line, on the clock "
            "of the edges; check --index, --pulses"
        )
    return middle % (2.0 * np.pi) * edges.disc.pulses / (2.0 * np.pi)


@dataclass(frozen=True)
class PitchPlace:
    """Where the errors of a disc fit a log."""

    line: Annotated[int, Key("first_edge_is_line")]
    """Slot of the calibration that the log's first edge is of [-]."""
    evidence: Annotated[str, Key()]
    """What tells: errors of single lines, missing lines, or the index pulse."""
    others: Annotated[float, Key("odds_of_other_places_by_single_lines")]
    """Odds of all other places and of no errors, together, against this place [-]."""


def place_pitch_errors(
    edges: Edges, pitch: PitchErrors, steady_within: float = STEADY, index: Floats | None = None
) -> tuple[Edges, PitchPlace]:
    """The edges corrected for a disc's errors, turned to where they fit the log, and where that is.

    All places are compared by what repeats each turn of the disc beyond the harmonics of the crank, its size unknown:
    odds of (squares / squares)^(freedom / 2). Lines missing from the calibration must lack in the log. Of several
    places one is taken where all others, and no errors at all, have odds below _OTHER_PLACES together; missing lines
    and an index pulse (instants (n,) [s]) decide where nothing contradicts them as clearly. Raises AnalysisError else.
    """
    turn = periodic_turn(edges, None, steady_within)
    cost = _place_costs(turn, pitch.ahead)
    possible, evidence = np.isfinite(cost[:-1]), "missing lines"
    if index is not None:
        if pitch.index is None:
            raise _misfit(edges, f"it has no column {COLUMNS[3]}: give --index when calibrating, too, or leave it out")
        shift = pitch.index - _index_line(edges, index)
        if abs(shift - round(shift)) > _SAME_LINE:
            raise _misfit(edges, f"its index pulse comes {abs(shift - round(shift)):.2g} lines elsewhere between lines")
        first, evidence = round(shift) % len(possible), "index pulse"
        if possible.any() and not possible[first]:
            raise _misfit(edges, f"by the index pulse its line {first} comes first, and lines that it lacks have edges")
        possible &= np.arange(len(possible)) == first
    if not possible.any():
        raise _misfit(edges, "lines that it lacks have edges here, wherever it is put")
    best, decided = int(np.argmin(np.where(possible, cost[:-1], np.inf))), possible.sum() == 1
    if decided:  # errors of single lines, mostly jitter of the calibration, may be less than they are said to be
        cost = _place_costs(turn, pitch.ahead, at_most=True)
    odds = np.exp(0.5 * np.minimum(cost[best] - np.delete(cost, best), 700.0))
    if decided:
        if odds.max() * _OTHER_PLACES > 1.0:
            raise _misfit(edges, f"by {evidence} its line {best} comes first, by the errors of single lines not")
    elif odds.sum() > _OTHER_PLACES:
        raise _misfit(
            edges,
            "whichever of its lines comes first, its errors of single lines are not in this log, or jitter hides them"
            if odds[-1] > _OTHER_PLACES
            else f"line {best} comes first, or one of {int((odds > _OTHER_PLACES).sum())} others; jitter hides which",
        )
    else:
        evidence = "errors of single lines"
    offset, width = np.roll(pitch.ahead, -best), np.nan_to_num(np.roll(pitch.error, -best))
    if edges.disc.pitch_is_separable and turn.turns >= TURNS_TO_SEPARATE:
        own, _ = pitch_from_record(edges, None, steady_within)
        if np.nanmean((own.ahead - offset) ** 2 / (own.error**2 + width**2)) > 1.0:
            raise _misfit(edges, "the log itself shows other errors: nothing is needed but to leave --pitch out")
    return replace(edges, offset=offset), PitchPlace(best, evidence, float(odds.sum()))


def _misfit(edges: Edges, why: str) -> AnalysisError:
    return AnalysisError(
        f"{edges.name}: this calibration does not fit: {why}. It must be of this disc, turning the same way; calibrate "
        "again, with --index in both logs where the disc has an index pulse, take longer logs, or leave --pitch out"
    )


def _place_costs(turn: SteadySpeedFit, ahead: Floats, at_most: bool = False) -> Floats:
    """Minus twice the log likelihood of a steady turn for each slot of errors (P,) [rad] as that of its first edge,
    infinite where edges are at missing lines, and last for no errors, (P + 1,). ``at_most``: or a share of the errors.

    What counts is the residual summed by slot, in which jitter averages out; an error moves an instant by slope times
    error, of which harmonics of the crank take their part. As many are left to the crank as its edges carry: what its
    motion may be tells nothing.
    """
    used, pulses = turn.edges, turn.edges.disc.pulses
    slot, slope = used.pulse % pulses, turn.slope(used.angle) / used.disc.ratio
    most = max(1, min(MOST_HARMONICS, int(used.disc.per_turn // 4)))
    basis = np.linalg.qr(time_regressor(used.angle, most))[0]
    time = used.time - used.time[0]

    def by_slot(values: Floats) -> Floats:
        return np.bincount(slot, values, pulses).astype(float)

    have, late, rate = np.bincount(slot, minlength=pulses), by_slot(time - basis @ (basis.T @ time)), by_slot(slope)
    count = np.maximum(have, 1)
    waves = np.stack([by_slot(column) for column in basis.T], axis=1)
    moving = np.stack([by_slot(slope * column) for column in basis.T], axis=1)
    freedom = (have > 0).sum() - float((waves**2 / count[:, None]).sum())

    def costs(errors: Floats) -> Floats:
        known = np.nan_to_num(errors)
        change = rate * known - known @ moving @ waves.T
        size, common = (change**2 / count).sum(axis=1), (late * change / count).sum(axis=1)
        share = np.clip(common / np.maximum(size, 1e-40), 0.0, 1.0) if at_most else 1.0
        squares = (late**2 / count).sum() - share * (2.0 * common - share * size)
        cost = max(freedom, 0.0) * np.log(np.maximum(squares, 1e-40))
        return np.where((np.isnan(errors) & (have > 0)).any(axis=1), np.inf, cost)

    parts = np.array_split(np.arange(pulses), -(-pulses // 256))
    by_place = [costs(ahead[(np.arange(pulses) + part[:, None]) % pulses]) for part in parts]
    return np.concatenate([*by_place, costs(np.zeros((1, pulses)))])


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
    count = np.bincount(slot, minlength=pulses)
    have = np.where(count > 0, count, np.nan)
    mean = np.bincount(slot, late, pulses) / have
    spread = late - mean[slot]
    degrees_of_freedom = max(len(late) - int((count > 0).sum()), 1)
    error = coverage_factor(degrees_of_freedom) * np.sqrt((spread**2).sum() / degrees_of_freedom / have)
    return PitchErrors(mean - np.nanmean(mean), error)


def write_pitch_errors(pitch: PitchErrors, path: Path) -> None:
    """Write the errors of a disc as CSV, in the columns COLUMNS."""
    columns: list[Any] = [range(len(pitch.ahead)), _degrees(pitch.ahead), _degrees(pitch.error)]
    if pitch.index is not None:
        columns.append([k - pitch.index for k in columns[0]])
    rows = [",".join("" if cell is None else f"{cell:.9g}" for cell in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([",".join(COLUMNS[: len(columns)]), *rows, ""]), encoding="utf-8")


def read_pitch_errors(path: Path, pulses: int) -> PitchErrors:
    """Errors of a disc with ``pulses`` slots from a CSV of the columns COLUMNS. Raises DataError for another table."""
    import csv

    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file, strict=True))
        slots, cells = [int(row[COLUMNS[0]]) for row in rows], [row[COLUMNS[1]].strip() for row in rows]
        ahead = {slot: float(cell) for slot, cell in zip(slots, cells, strict=True) if cell}
        error = [float(row.get(COLUMNS[2]) or "nan") for row in rows]
        index = -float(rows[0][COLUMNS[3]]) if rows and COLUMNS[3] in rows[0] else None
    except (csv.Error, UnicodeDecodeError, KeyError, ValueError, TypeError, AttributeError) as wrong:
        raise DataError(f"{path.name}: expected the columns {','.join(COLUMNS[:2])} of numbers") from wrong
    if slots != list(range(pulses)) or not ahead or not np.isfinite([*ahead.values(), index or 0.0]).all():
        raise DataError(f"{path.name}: {len(slots)} slots; expected slots 0 to {pulses - 1} in order, finite angles")
    return PitchErrors(np.radians([ahead.get(k, np.nan) for k in slots]), np.radians(error), index)


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


def drive_machine(name: str, nominal: float | None, reading: str | None, mean: float = 0.0) -> "Machine":
    """The machine of a drive file at a nominal speed of its motor [rad/s].

    Without ``nominal`` it is the file's nearest to a ``mean`` speed of the crank [rad/s]. ``reading`` is how the
    gearbox's torque is read. Raises AnalysisError where neither it nor the file says so.
    """
    from balance.drives.drive_files import load_drive

    drive = load_drive(name)
    if reading is None and drive.table.gearbox.reading is None:
        raise AnalysisError(
            f"{drive.name} does not state how the gearbox's torque is read: give --reading geared or ungeared"
        )
    nearest = min(drive.table.speeds, key=lambda speed: abs(speed / drive.table.gearbox.ratio - mean))
    return drive.machines(drive.load_mechanism(), (nominal or nearest,), reading)[0]


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
        "missing_lines": list(record.worn),
    }


def turn_document(found: SteadySpeedFit, nominal: float | None) -> dict[str, Any]:
    """The steady turn with its 95 % intervals as JSON.

    An eccentric disc whose lines are ahead by e sin(angle) adds up to 2 e to the fluctuation, which no log of a disc on
    the crank's own shaft tells from it.
    """
    phi, disc = np.radians(_DEGREES), found.edges.disc
    unknown = found.edges.offset is None and not disc.pitch_is_separable
    per_degree = math.radians(2.0) * (found.mean.value / nominal if nominal else 1.0)
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
        "fluctuation_by_eccentricity_per_deg": per_degree if unknown else None,
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
    odd = [worn_text(record.worn)] * bool(record.worn) + [f"lost edges bridged: {gap.text()}" for gap in record.gaps]
    interval, step = float(np.median(np.diff(record.time))), record.clock_step
    if step is not None and step > COARSE_CLOCK * interval:
        odd.append(
            f"the clock's step of {step * 1e6:g} us is {100 * step / interval:.1f} % of an interval between edges"
        )
    if found is not None and found.unsteady_turns > found.turns:
        whole = (record.angle[-1] - record.angle[0]) / (record.time[-1] - record.time[0])
        odd.append(
            f"{found.turns} of {found.turns + found.unsteady_turns} turns are used, the most in a row that are steady; "
            f"the mean over the whole log is {whole / RPM:.3f} rpm; --steady-within takes turns that differ more"
        )
    again = repetition(record) if found is not None else None
    if again is not None and (times := round(record.disc.per_turn / again)) > 1:
        odd.append(
            f"the motion repeats every {again} edges already, {times} times a turn of {record.disc.per_turn:g}: if the "
            f"disc has {record.disc.pulses / times:g} edges a turn, not {record.disc.pulses}, all speeds are {times} "
            "times as high; check --pulses"
        )
    if found is not None and 2 * (found.harmonics + 1) >= found.edges.disc.per_turn:
        odd.append(
            f"{found.edges.disc.per_turn:g} edges a turn do not show harmonic {found.harmonics + 1} of the turn: how "
            "far it changes the speeds is not in their intervals; a disc of more edges shows it"
        )
    if found is not None and found.repeated > 0.0:
        beyond = (
            "; --pitch takes a calibration" if record.offset is None else " beyond the calibration; calibrate again"
        )
        odd.append(
            f"slots of the disc are {100 * found.repeated:.2g} % of the pitch out of place: in the speed edge by edge "
            f"that looks like fluctuation, the steady turn suppresses it line by line{beyond}"
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
