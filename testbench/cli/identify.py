"""``testbench identify``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.console import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option

from . import calibrations

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..identify import Identification, Value


@click.command(
    epilog="""\b
Examples:
  testbench ingest 09_double_pendulum_A0_061705.csv --rig two-joint-arm-a0 -o campaign
  testbench identify two-joint-arm-a0 campaign/09_double_pendulum_A0_061705.h5 --figure torque.png
  testbench identify two-joint-arm-a0 campaign/*.h5 --json
\b
Exit codes: 0 done, 3 done but doubtful for the reasons listed, 1 refused."""
)
@click.argument("mechanism", metavar="MECH")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--rig", help="A rig in place of the one stored with the runs.")
@click.option(
    "--figure", type=click.Path(path_type=Path), help="Draw measured and predicted torque (.png, .svg, .pdf)."
)
@json_option
def identify(mechanism: str, runs: tuple[Path, ...], rig: str | None, figure: Path | None, as_json: bool) -> int:
    """Inertial parameters and friction of MECH from the positions and torques of stored runs.

    What the record determines is found before solving. Cut-off and delay are chosen by the torque error on held-out
    stretches. Intervals (95 %) contain the answers at half and double that cut-off, and without the delay.
    """
    from balance.mechanism import Mechanism

    from .. import rig as rigs
    from ..identify import identify as identified
    from ..identify import joint_record
    from ..store import open_run

    model = Mechanism.load(mechanism)
    described = rigs.load(rig) if rig else None
    opened = [open_run(path) for path in runs]
    result = identified([joint_record(run, model, described) for run in opened], model)
    if figure is not None:
        _draw(result, figure)
    if as_json:
        from ..identify.document import document

        emit_json({**document(result), "calibrations": calibrations.document(opened, described)})
    else:
        print_result(result)
        calibrations.say(calibrations.held(opened, described))
    return EXIT_WITH_FINDINGS if result.doubts() else 0


def print_result(result: "Identification") -> None:
    """The tables for people."""
    about = f"{result.mechanism.name} from {', '.join(result.runs)} (origin {result.origin})"
    header = ["", "value", "unit", "95 % interval", *result.variants, "in MECH's file"]
    emit_table(f"Identified: {about}", header, [_row(value) for value in result.base_values()])
    emit_table("Friction and drives", header, [_row(value) for value in result.joint_values()])
    if result.mechanism.counter_sites and not result.undetermined_moments():
        rows = [
            [found.site, f"{found.position[0] * 1e3:.4g}", *_cells(found.mass, 3), *_cells(found.first_moment, 4)]
            for found in result.counter_masses()
        ]
        columns = ["site", "x [mm]", "mass [kg]", "95 % interval", "first moment [kg m]", "95 % interval"]
        emit_table("Counter-masses that would balance it", columns, rows)
    click.echo("\n".join(_notes(result)))


def _notes(result: "Identification") -> list[str]:
    """What stands below the tables: how much is unexplained, how it was chosen, what else it could be, the verdict."""
    chosen, observability = result.chosen, result.identified.observability
    shares = zip(result.joints, result.rms_ratio_in_band, result.rms_ratio, strict=True)
    side = "after" if chosen.delay >= 0 else "before"
    return [
        *(
            f"Torque of {joint} unexplained on held-out stretches: {below:.1%} below the cut-off, {raw:.1%} as recorded"
            for joint, below, raw in shares
        ),
        f"Cut-off {chosen.cutoff:.3g} Hz, torques logged {abs(chosen.delay) * 1e3:.3g} ms {side} the motion: chosen by "
        "the torque error on held-out stretches.",
        f"{observability.rank} combinations of {len(observability.names)} parameters are observable, condition "
        f"{observability.condition:.3g}. Intervals: delete-block jackknife over {result.identified.blocks} stretches, "
        "widened to contain the answers of the other columns.",
        "Smoothing torque and rates but not positions, as is often done, is biased and would have given: "
        + "; ".join(f"{value.name} {_listed(value.one_sided)}" for value in result.first_moments() if value.in_file),
        f"Verdict: {result.verdict}",
        *(f"  {doubt}" for doubt in result.doubts()),
    ]


def _listed(values: "Mapping[str, float]") -> str:
    return ", ".join(f"{value:.4f} ({label})" for label, value in values.items())


def _row(value: "Value") -> list[str]:
    shown = [f"{other:.4f}" for other in value.variants.values()]
    number, interval = _cells(value, 4)
    return [value.name, number, value.unit, interval, *shown, f"{value.in_file:.4f}"]


def _cells(value: "Value", decimals: int) -> tuple[str, str]:
    low, high = value.interval
    return f"{value.value:.{decimals}f}", f"{low:.{decimals}f} .. {high:.{decimals}f}"


def _draw(result: "Identification", path: Path) -> None:
    from balance.figures.drawing import save

    from ..identify.figure import draw

    save(draw(result), path)
