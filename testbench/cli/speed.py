"""``testbench speed``."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.framework import Answer, Word, answering, emit_findings, emit_table
from balance.cli.options import Quantity, draw, figure_option
from balance.results import document

if TYPE_CHECKING:
    from ..rotating import Disc, Edges, SpeedHistory, SteadySpeedFit

_SPEED = Quantity("angular velocity", positive=True)
_OF_A_DRIVE = ("reading", "motor_speed", "first_edge_at")
"""Options that have no effect without a drive to compare with."""


@click.command(
    epilog="""\b
LOG is a table with one column, the instants of the edges, its unit in the header (t_us, t (s)),
or a stored run of such a table. A log with lost edges is refused, each place named, unless
--bridge counts them. A pitch file has the columns slot,ahead_deg; slot 0 is that of the first edge.

\b
Examples:
  testbench speed edges.csv --pulses 100
  testbench speed edges.csv --pulses 100 --drive inverted-slider-crank --reading ungeared --first-edge-at 0deg
  testbench speed motor.csv --pulses 100 --ratio 3.61 --nominal 76.45rpm --figure speed.png
  testbench speed free.csv --pulses 100 --calibrate pitch.csv
  testbench speed start.csv --pulses 100 --drive inverted-slider-crank --reading geared --start-up 4
\b
Exit codes: 0 done, 3 done with findings, 1 refused."""
)
@click.argument("log", metavar="LOG", type=click.Path(path_type=Path))
@click.option("--pulses", type=click.IntRange(2), required=True, metavar="N", help="Edges per turn of the disc.")
@click.option("--ratio", type=click.FloatRange(1e-3, 1e3), default=1.0, help="Turns of the disc per turn of the crank.")
@click.option("--nominal", type=_SPEED, metavar="N", help="Nominal speed of the crank, for the fluctuation.")
@click.option("--drive", metavar="DRIVE", help="Compare it with this drive file, such as inverted-slider-crank.")
@click.option("--reading", type=Word(["geared", "ungeared"]), help="How the gearbox's torque is read.")
@click.option("--motor-speed", type=_SPEED, metavar="N", help="Nominal speed of the drive's motor [default: nearest].")
@click.option(
    "--first-edge-at",
    type=Quantity("angle"),
    metavar="ANGLE",
    help="Angle of the crank at the first edge; else curves are aligned.",
)
@click.option("--start-up", type=click.IntRange(1, 200), metavar="TURNS", help="The log begins at standstill.")
@click.option("--bridge", is_flag=True, help="Count lost edges and go on, with findings.")
@click.option("--harmonics", type=click.IntRange(1), help="Harmonics of a turn [default: what the log supports].")
@click.option(
    "--steady-within", type=float, default=0.1, metavar="PERCENT", help="Turns that differ less in duration are steady."
)
@click.option("--pitch", type=click.Path(path_type=Path, dir_okay=False), help="Errors of the disc, from --calibrate.")
@click.option("--calibrate", type=click.Path(path_type=Path, dir_okay=False), help="Write them, from a free run.")
@click.option("--csv", type=click.Path(path_type=Path, dir_okay=False), help="Write the speed edge by edge.")
@figure_option
@answering
def speed(log: Path, **options: Any) -> Answer:  # noqa: ANN401
    """Speed of a crank over a turn, and its fluctuation, from the instants of encoder edges in LOG.

    Pulses are timed, never counted in a window. Time over angle is fitted with a few harmonics, so jitter does not
    push the extremes apart; intervals (95 %) contain jitter, errors of the disc, changes from turn to turn, and the
    answers with one and two harmonics more. A slow error of the disc (an eccentric one) needs a calibration.
    """
    for name, least, most in (("ratio", 1e-3, 1e3), ("steady_within", 1e-9, 50.0)):
        if not least <= options[name] <= most:  # NaN is in no range of click's
            option = "--" + name.replace("_", "-")
            raise click.UsageError(f"{option} is {options[name]:g}: expected {least:g} to {most:g}")
    idle = [name for name in _OF_A_DRIVE if options[name] is not None and not options["drive"]]
    if idle:
        raise click.UsageError(f"--{idle[0].replace('_', '-')} goes with --drive")
    from .. import rotating
    from ..rotating import pitch_error, speed_results

    disc = rotating.Disc(options["pulses"], options["ratio"])
    offset = pitch_error.read_pitch_errors(options["pitch"], disc.pulses) if options["pitch"] else None
    edges = rotating.number_edges(log.name, rotating.read_edge_times(log), disc, options["bridge"], offset)
    if options["calibrate"]:
        found = pitch_error.pitch_from_free_run(edges)
        pitch_error.write_pitch_errors(found, options["calibrate"])
        text = f"Slots are {100 * found.rms:.3g} % of the pitch out of place (rms); written to"
        known = speed_results.edges_document(edges) | {"pitch": document(found)}
        return Answer(known, lambda: click.echo(f"{text} {options['calibrate'].name}"))
    result = _study(log, edges, disc, options)
    if options["csv"]:
        import numpy as np

        from balance.table_files import write_csv_file

        write_csv_file(options["csv"], {name: np.array(values) for name, values in result["course"].items()})
    draw(options["figure"], "testbench.figures.rotating:draw_speed", result)
    return Answer(result, lambda: _print(result), bool(result["findings"]))


def _study(log: Path, edges: "Edges", disc: "Disc", options: dict[str, Any]) -> dict[str, Any]:
    from .. import rotating
    from ..errors import AnalysisError
    from ..rotating import pitch_error, speed_results

    result = speed_results.edges_document(edges) | {"origin": rotating.log_origin(log)}
    turn, freed, within = None, None, options["steady_within"] / 100.0
    try:
        turn = rotating.periodic_turn(edges, options["harmonics"], within)
        if disc.pitch_is_separable and edges.offset is None and turn.turns >= 3:
            freed, turn = pitch_error.pitch_from_record(edges, options["harmonics"], within)
    except AnalysisError as error:
        if not options["start_up"]:
            raise
        result["not_steady"] = str(error)
    course = rotating.speed_history(edges)
    result["findings"] = speed_results.speed_findings(edges, turn)
    result["course"] = document(course)
    if freed:
        result["pitch"] = document(freed)
    _against_the_model(result, turn, course, options)
    return result


def _against_the_model(
    result: dict[str, Any], turn: "SteadySpeedFit | None", course: "SpeedHistory", options: dict[str, Any]
) -> None:
    """Add the steady turn and, where a drive is named, the solution of its equation of motion."""
    from ..rotating import speed_results

    mean = float(course.speed[-len(course.speed) // 2 :].mean()) if turn is None else turn.mean.value
    machine = _machine(options, mean) if options["drive"] else None
    nominal, angle = options["nominal"] or (machine.nominal_crank if machine else None), options["first_edge_at"]
    if turn is not None:
        result["steady"] = speed_results.turn_document(turn, nominal)
        result["findings"] += speed_results.nominal_speed_findings(turn, nominal)
    if machine is not None and turn is not None:
        fit = speed_results.joint_fit(turn, machine, angle)
        result["model"] = speed_results.model_document(fit, nominal or machine.nominal_crank)
    if machine is not None and options["start_up"]:
        run = speed_results.computed_start_up(machine, options["start_up"], angle or 0.0)
        result["start_up"] = speed_results.start_up_document(run, speed_results.start_up_delay(course, run))


def _machine(options: dict[str, Any], mean: float) -> Any:  # noqa: ANN401
    from balance.drives.drive_files import load_drive

    from ..rotating import speed_results

    drive = load_drive(options["drive"])
    nearest = min(drive.speeds, key=lambda nominal: abs(nominal / drive.ratio - mean))
    return speed_results.drive_machine(options["drive"], options["motor_speed"] or nearest, options["reading"])


def _print(result: dict[str, Any]) -> None:
    step = result["clock_step_us"]
    clock = "finer than 1 ns" if step is None else f"in steps of {step:g} us"
    click.echo(
        f"{result['log']}: {result['edges']} edges, {result['crank_turns']:.2f} turns of the crank, clock {clock}"
    )
    repeats, pulses = result["motion_repeats_every_edges"], result["pulses_per_disc_turn"]
    unproven = f"Nothing in the log proves {pulses} edges a turn of the disc: speeds are as right as --pulses."
    click.echo(unproven if repeats is None else f"The motion repeats every {repeats} edges.")
    if "steady" in result:
        _print_turn(result["steady"], result.get("model"))
    if "not_steady" in result:
        click.echo(result["not_steady"])
    if "start_up" in result:
        _print_start(result)
    if "pitch" in result:
        error = result["pitch"]["rms_percent_of_pitch"]
        click.echo(f"Errors of the disc, estimated and corrected: {error:.2g} % of the pitch.")
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
        click.echo(
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
