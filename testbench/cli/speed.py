"""``testbench speed``."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.framework import Answer, Word, emit_table, label, say
from balance.cli.options import FIGURE, Quantity, argument, command, draw, option
from balance.results import document

if TYPE_CHECKING:
    from ..rotating import Disc, Edges, SteadySpeedFit

_SPEED = Quantity("angular velocity", positive=True)
_FILE = click.Path(path_type=Path, dir_okay=False)


@command(
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
    bridge: bool = option("Count lost edges and go on, with findings."),
    harmonics: int | None = option("Harmonics of a turn [default: what the log supports].", click.IntRange(1)),
    steady_within: float = option(
        "Turns that differ less in duration are steady.", default=0.1, show_default=False, metavar="PERCENT"
    ),
    pitch: Path | None = option("Errors of the disc, from --calibrate.", _FILE),
    calibrate: Path | None = option("Write them, from a free run.", _FILE),
    csv: Path | None = option("Write the speed edge by edge.", _FILE),
    figure: str | None = FIGURE,
) -> Answer:
    """Speed of a crank over a turn, and its fluctuation, from the instants of encoder edges in LOG.

    Pulses are timed, never counted in a window. Time over angle is fitted with a few harmonics, so jitter does not
    push the extremes apart; intervals (95 %) contain jitter, errors of the disc, changes from turn to turn, and the
    answers with one and two harmonics more. A slow error of the disc (an eccentric one) needs a calibration.
    """
    for name, value, least, most in (("ratio", ratio, 1e-3, 1e3), ("steady-within", steady_within, 1e-9, 50.0)):
        if not least <= value <= most:  # NaN is in no range of click's
            raise click.UsageError(f"--{name} is {value:g}: expected {least:g} to {most:g}")
    of_a_drive = {"reading": reading, "motor-speed": motor_speed, "first-edge-at": first_edge_at}
    if idle := [name for name, value in of_a_drive.items() if value is not None and not drive]:
        raise click.UsageError(f"--{idle[0]} goes with --drive")
    from .. import rotating
    from ..rotating import speed_results

    disc = rotating.Disc(pulses, ratio)
    offset = speed_results.read_pitch_errors(pitch, disc.pulses) if pitch else None
    edges = rotating.number_edges(log.name, rotating.read_edge_times(log), disc, bridge, offset)
    if calibrate:
        found = speed_results.pitch_from_free_run(edges)
        speed_results.write_pitch_errors(found, calibrate)
        text = f"Slots are {100 * found.rms:.3g} % of the pitch out of place (rms); written to {calibrate.name}"
        return Answer(speed_results.edges_document(edges) | {"pitch": document(found)}, lambda: say(text))
    turn, of_disc = _measured(edges, disc, harmonics, steady_within / 100.0)
    machine = _machine(drive, motor_speed, reading, turn.mean.value) if drive else None
    nominal = nominal or (machine.nominal_crank if machine else None)
    odd = speed_results.speed_findings(edges, turn) + speed_results.nominal_speed_findings(turn, nominal)
    result = speed_results.edges_document(edges) | {"origin": rotating.log_origin(log)} | of_disc
    result |= {"findings": odd, "course": document(rotating.speed_history(edges))}
    result["steady"] = speed_results.turn_document(turn, nominal)
    if machine is not None:
        fit = speed_results.joint_fit(turn, machine, first_edge_at)
        result["model"] = speed_results.model_document(fit, nominal or machine.nominal_crank)
    if csv:
        import numpy as np

        from balance.table_files import write_csv_file

        write_csv_file(csv, {name: np.array(values) for name, values in result["course"].items()})
    draw(figure, "testbench.figures.rotating:draw_speed", result)
    further = ("", "steady", "model", "pitch")
    return Answer(result, lambda: _print(result), findings=odd, further=further)


def _measured(
    edges: "Edges", disc: "Disc", harmonics: int | None, within: float
) -> "tuple[SteadySpeedFit, dict[str, Any]]":
    """The steady turn, and the errors of the disc where they are found with it."""
    from .. import rotating
    from ..rotating import speed_results

    turn = rotating.periodic_turn(edges, harmonics, within)
    if not disc.pitch_is_separable or edges.offset is not None or turn.turns < 3:
        return turn, {}
    freed, turn = speed_results.pitch_from_record(edges, harmonics, within)
    return turn, {"pitch": document(freed)}


def _machine(name: str, motor_speed: float | None, reading: str | None, mean: float) -> Any:  # noqa: ANN401
    from balance.drives.drive_files import load_drive

    from ..rotating import speed_results

    drive = load_drive(name)
    nearest = min(drive.speeds, key=lambda nominal: abs(nominal / drive.ratio - mean))
    return speed_results.drive_machine(name, motor_speed or nearest, reading)


def _print(result: dict[str, Any]) -> None:
    """The speed and its fluctuation in one sentence, then the steady turn, and what shows the edges a turn."""
    from balance.estimation.estimate import LEVEL_TEXT

    turn, model = result["steady"], result.get("model")
    mean, fluctuation = turn["mean_rpm"], turn["fluctuation"]
    say(
        f"{result['log']}: {mean['value']:.3f} rpm [{mean['low']:.3f}, {mean['high']:.3f}], the speed fluctuates "
        f"by {fluctuation['value']:z.5f} [{fluctuation['low']:z.5f}, {fluctuation['high']:z.5f}] over a turn."
    )
    rows = []
    for key in ("fastest_rpm", "slowest_rpm", "mean_rpm", "fluctuation"):
        digits = 5 if key == "fluctuation" else 4
        values = [f"{turn[key][part]:.{digits}f}" for part in ("value", "low", "high")]
        rows.append([label(key), *values, "-" if model is None else f"{model[key]:.{digits}f}"])
    header = ["", "from edges", "from", f"to ({LEVEL_TEXT})", "computed"]
    remark = f"Fluctuation by the {turn['fluctuation_by']}."
    emit_table(f"Steady turn of the crank, {turn['turns_used']} turns", header, rows, remark)
    repeats, pulses = result["motion_repeats_every_edges"], result["pulses_per_disc_turn"]
    unproven = f"Nothing in the log proves {pulses} edges a turn of the disc: speeds are as right as --pulses."
    say(unproven if repeats is None else f"The motion repeats every {repeats} edges.")
