"""``testbench speed``."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.framework import Answer, Quantity, Word, argument, command, option
from balance.cli.options import FIGURE, draw
from balance.cli.printing import emit_findings, emit_table, say
from balance.results import document

if TYPE_CHECKING:
    from balance.arrays import Floats

    from ..rotating import Edges, SteadySpeedFit
    from ..rotating.speed_results import PitchErrors

_SPEED = Quantity("angular velocity", positive=True)
_FILE = click.Path(path_type=Path, dir_okay=False)


@command(
    epilog="""\b
LOG is a table with one column, the instants of the edges, its unit in the header (t_us, t (s)),
or a stored run of such a table. A log with lost edges is refused, each place named, unless
--bridge counts them; so is a log of a disc with missing lines. A pitch file has the columns
slot,ahead_deg (empty where the disc lacks the line); slot 0 is that of its log's first edge. A log
begins at any line: which one, the errors of single lines tell, or missing lines, or index pulses;
where they leave it open, or fit nowhere, nothing is given ("this calibration does not fit").

\b
Examples:
  testbench speed edges.csv --pulses 100
  testbench speed edges.csv --pulses 100 --drive inverted-slider-crank --reading ungeared --first-edge-at 0deg
  testbench speed motor.csv --pulses 100 --ratio 3.61 --nominal 76.45rpm --figure speed.png
  testbench speed free.csv --pulses 100 --calibrate pitch.csv
  testbench speed edges.csv --pulses 100 --pitch pitch.csv
  testbench speed start.csv --pulses 100 --drive inverted-slider-crank --reading geared --start-up 4
\b
Exit codes: 0 done, 3 done with findings, 1 refused."""
)
def speed(
    log: Path = argument("LOG"),
    pulses: int = option("Edges per turn of the disc.", click.IntRange(2), required=True, metavar="N"),
    ratio: float = option(
        "Turns of the disc per turn of the crank.", click.FloatRange(1e-3, 1e3), default=1.0, show_default=False
    ),
    nominal: float | None = option("Nominal speed of the crank, for the fluctuation.", _SPEED, metavar="N"),
    drive: str | None = option("Compare it with this drive file, such as inverted-slider-crank.", metavar="DRIVE"),
    reading: str | None = option("How the gearbox's torque is read.", Word(["geared", "ungeared"])),
    motor_speed: float | None = option("Nominal speed of the drive's motor [default: nearest].", _SPEED, metavar="N"),
    first_edge_at: float | None = option(
        "Angle of the crank at the first edge; else curves are aligned.", Quantity("angle"), metavar="ANGLE"
    ),
    start_up: int | None = option("The log begins at standstill.", click.IntRange(1, 200), metavar="TURNS"),
    bridge: bool = option("Count lost edges and go on, with findings."),
    harmonics: int | None = option("Harmonics of a turn [default: what the log supports].", click.IntRange(1)),
    steady_within: float = option(
        "Turns that differ less in duration are steady.", default=0.1, show_default=False, metavar="PERCENT"
    ),
    pitch: Path | None = option("Errors of the disc, from --calibrate.", _FILE),
    calibrate: Path | None = option("Write them, from a free run.", _FILE),
    index: Path | None = option("Instants of the disc's index pulses, on the clock of LOG.", _FILE),
    csv: Path | None = option("Write the speed edge by edge.", _FILE),
    figure: str | None = FIGURE,
) -> Answer:
    """Speed of a crank over a turn, and its fluctuation, from the instants of encoder edges in LOG.

    Pulses are timed, never counted in a window. Time over angle is fitted with a few harmonics, so jitter does not
    push the extremes apart; intervals (95 %) contain jitter, errors of the disc, changes from turn to turn, and the
    answers with one and two harmonics more. They hold for a concentric disc: what an eccentric one adds once a turn is
    no other than a fluctuation, and needs a calibration (from a free run, the shaft uncoupled), or a disc on another
    shaft than the crank's.
    """
    for name, value, least, most in (("ratio", ratio, 1e-3, 1e3), ("steady-within", steady_within, 1e-9, 50.0)):
        if not least <= value <= most:  # NaN is in no range of click's
            raise click.UsageError(f"--{name} is {value:g}: expected {least:g} to {most:g}")
    of_a_drive = {"reading": reading, "motor-speed": motor_speed, "first-edge-at": first_edge_at}
    if idle := [name for name, value in of_a_drive.items() if value is not None and not drive]:
        raise click.UsageError(f"--{idle[0]} goes with --drive")
    if pitch and calibrate:
        raise click.UsageError("--calibrate writes what --pitch reads: give one of them")
    if index and not (pitch or calibrate):
        raise click.UsageError("--index goes with --calibrate or --pitch")
    from .. import rotating
    from ..rotating import speed_results

    disc = rotating.Disc(pulses, ratio)
    errors = speed_results.read_pitch_errors(pitch, disc.pulses) if pitch else None
    edges = rotating.number_edges(log.name, rotating.read_edge_times(log), disc, bridge)
    pulse = rotating.read_edge_times(index) if index else None
    if calibrate:
        found = speed_results.pitch_from_free_run(edges, pulse)
        speed_results.write_pitch_errors(found, calibrate)
        text = f"Slots are {100 * found.rms:.3g} % of the pitch out of place (rms); written to {calibrate.name}"
        return Answer(speed_results.edges_document(edges) | {"pitch": document(found)}, lambda: say(text))
    edges, result, turn = _measured(edges, errors, pulse, harmonics, steady_within / 100.0, start_up is not None)
    result = speed_results.edges_document(edges) | {"origin": rotating.log_origin(log)} | result
    course = rotating.speed_history(edges)
    result |= {"findings": speed_results.speed_findings(edges, turn), "course": document(course)}
    mean = float(course.speed[-len(course.speed) // 2 :].mean()) if turn is None else turn.mean.value
    machine = speed_results.drive_machine(drive, motor_speed, reading, mean) if drive else None
    nominal = nominal or (machine.nominal_crank if machine else None)
    if turn is not None:
        result["steady"] = speed_results.turn_document(turn, nominal)
        result["findings"] += speed_results.nominal_speed_findings(turn, nominal)
    if machine is not None and turn is not None:
        fit = speed_results.joint_fit(turn, machine, first_edge_at)
        result["model"] = speed_results.model_document(fit, nominal or machine.nominal_crank)
    if machine is not None and start_up:
        run = speed_results.computed_start_up(machine, start_up, first_edge_at or 0.0)
        result["start_up"] = speed_results.start_up_document(run, speed_results.start_up_delay(course, run))
    if csv:
        import numpy as np

        from balance.table_files import write_csv_file

        write_csv_file(csv, {name: np.array(values) for name, values in result["course"].items()})
    draw(figure, "testbench.figures.rotating:draw_speed", result)
    return Answer(result, lambda: _print(result), bool(result["findings"]))


def _measured(
    edges: "Edges",
    errors: "PitchErrors | None",
    index: "Floats | None",
    harmonics: int | None,
    within: float,
    starts: bool,
) -> "tuple[Edges, dict[str, Any], SteadySpeedFit | None]":
    """The edges corrected for the disc's errors; what was found of these; the steady turn, None where a log that
    ``starts`` has none.
    """
    from .. import rotating
    from ..errors import AnalysisError
    from ..rotating import speed_results

    turn: SteadySpeedFit | None = None
    found: dict[str, Any] = {}
    try:
        if errors is not None:
            edges, place = speed_results.place_pitch_errors(edges, errors, within, index)
            found["calibration"] = document(place)
        turn = rotating.periodic_turn(edges, harmonics, within)
        if edges.disc.pitch_is_separable and edges.offset is None and turn.turns >= speed_results.TURNS_TO_SEPARATE:
            freed, turn = speed_results.pitch_from_record(edges, harmonics, within)
            found["pitch"] = document(freed)
    except AnalysisError as error:
        if not starts:
            raise
        found["not_steady"] = str(error)
    return edges, found, turn


def _print(result: dict[str, Any]) -> None:
    """The speed and its fluctuation in one sentence, then how they are known."""
    if "steady" in result:
        mean, fluctuation = (result["steady"][name] for name in ("mean_rpm", "fluctuation"))
        per_degree = result["steady"]["fluctuation_by_eccentricity_per_deg"]
        used, others = result["steady"]["turns_used"], result["steady"]["turns_left_out"]
        over = f"over {used} of {used + others} turns " * (others > used)
        say(
            f"{result['log']}: {over}{mean['value']:.3f} rpm [{mean['low']:.3f}, {mean['high']:.3f}], the speed "
            f"fluctuates by {fluctuation['value']:z.5f} [{fluctuation['low']:z.5f}, {fluctuation['high']:z.5f}] over a "
            "turn"
            + (
                "."
                if per_degree is None
                else f", if the disc is concentric (0.1 deg: {0.1 * per_degree:.2g} more or less)."
            )
        )
    step = result["clock_step_us"]
    clock = "finer than 1 ns" if step is None else f"in steps of {step:g} us"
    known = f"{result['edges']} edges, {result['crank_turns']:.2f} turns of the crank, clock {clock}"
    say(known if "steady" in result else f"{result['log']}: {known}")
    repeats, pulses = result["motion_repeats_every_edges"], result["pulses_per_disc_turn"]
    unproven = f"Nothing in the log proves {pulses} edges a turn of the disc: speeds are as right as --pulses."
    say(unproven if repeats is None else f"The motion repeats every {repeats} edges.")
    if "steady" in result:
        _print_turn(result["steady"], result.get("model"))
    if "not_steady" in result:
        say(result["not_steady"])
    if "start_up" in result:
        _print_start(result)
    if "calibration" in result:
        place = result["calibration"]
        say(f"The first edge is that of line {place['first_edge_is_line']} of the calibration, by {place['evidence']}.")
    if "pitch" in result:
        error = result["pitch"]["rms_percent_of_pitch"]
        say(f"Errors of the disc, estimated and corrected: {error:.2g} % of the pitch.")
    emit_findings(("Finding", finding) for finding in result["findings"])


def _print_turn(turn: dict[str, Any], model: dict[str, Any] | None) -> None:
    from balance.estimation.estimate import LEVEL_TEXT

    labels = {
        "fastest_rpm": "n_max [rpm]",
        "slowest_rpm": "n_min [rpm]",
        "mean_rpm": "mean [rpm]",
        "fluctuation": "fluctuation",
    }
    rows = []
    for key, label in labels.items():
        digits = 4 if key == "fluctuation" else 3
        values = [f"{turn[key][part]:.{digits + 1}f}" for part in ("value", "low", "high")]
        rows.append([label, *values, "-" if model is None else f"{model[key]:.{digits + 1}f}"])
    note = (
        f"Fluctuation by the {turn['fluctuation_by']}. {turn['harmonics']} harmonics; jitter "
        f"{turn['jitter_us']:.2f} us; {turn['turns_left_out']} turns not steady."
    )
    header = ["", "from edges", "from", f"to ({LEVEL_TEXT})", "computed"]
    emit_table(f"Steady turn of the crank, {turn['turns_used']} turns", header, rows, note)
    if model:
        how = "found by aligning the curves" if model["first_edge_found_by_alignment"] else "as given"
        say(
            f"Computed: {model['mechanism']}, motor at {model['motor_nominal_rpm']:.4g} rpm, {model['reading']}; "
            f"first edge at {model['first_edge_at_deg']:.2f} deg, {how}; curves differ by "
            f"{model['rms_difference_rpm']:.3g} rpm rms."
        )


def _print_start(result: dict[str, Any]) -> None:
    import numpy as np

    course, start = result["course"], result["start_up"]
    time, speed = np.array(course["time_s"]), np.array(course["speed_rpm"])
    begin, rows = -np.inf, []
    for turn in start["turns"]:
        inside = (time > begin) & (time <= turn["end_s"])
        measured = [f"{speed[inside].max():.2f}", f"{speed[inside].min():.2f}"] if inside.any() else ["-", "-"]
        rows.append([str(turn["turn"]), *measured, f"{turn['fastest_rpm']:.2f}", f"{turn['slowest_rpm']:.2f}"])
        begin = turn["end_s"]
    header = ["turn", "n_max [rpm]", "n_min [rpm]", "computed n_max", "computed n_min"]
    note = "Edge by edge: noise and errors of the disc push extremes apart. Both starts end turn 1 together."
    emit_table("Start-up", header, rows, note)
