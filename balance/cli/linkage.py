"""``balance linkage``."""

from math import isnan
from typing import TYPE_CHECKING

import click

from . import options
from .console import EXIT_WITH_FINDINGS, emit_json, json_option
from .rotor.given import Quantity

if TYPE_CHECKING:
    from ..linkages.description import Linkage
    from ..linkages.method import Balance
    from ..linkages.printed import Comparison
    from ..linkages.verification import Verification


@click.command(
    epilog="""\b
Examples:
  balance linkage two-levels                    a shipped example: copy it from datasets/linkages and change it
  balance linkage pantograph --equations --figure pantograph.png
  balance linkage mine.toml --speed 300rpm --variation 0.5 --csv mine.csv
  balance linkage mine.toml --force-only --json

\b
A linkage is a TOML file; every quantity has a unit, positions are sums of named lengths:
  drive = "A0"                                  driven joint, on the ground
  speed = "50 rpm"
  swing = ["20 deg", "80 deg"]                  only where it makes no full turns
  gravity = ["0 m/s^2", "-9.81 m/s^2"]          optional, for the drive torque
  turns_with = [["5", "2"]]                     optional: parallel links of a parallelogram; checked
  [lengths]
  L2 = "0.18 m"
  [links.2]
  mass = "0.47 kg"
  centre = ["L2/2", "0 m"]                      in the frame of the link
  inertia = "1.68e-3 kg m^2"                    about its own centre
  counter_mass = { at = ["-L2/4", "0 m"], bar = "L2/2" }       or { radius = "45 mm" }, on whatever side is needed;
                                                its inertia by bar, radius_of_gyration or inertia, else none;
                                                several in a list, each with a name
  gear_counter_mass = { ... }                   optional: against gears, else at the same places
  [links.7]
  fixed_to = "2"                                one body with link 2; also at = [...], angle = "..."
  [joints]
  A0 = { ground = ["0 m", "0 m"], 2 = ["0 m", "0 m"] }
  P = { kind = "prismatic", ground = { point = ["0 m", "0 m"], along = "0 deg" }, 4 = { ... } }
  [reduction]                                   optional: chosen for the least counter-mass
  3 = "A"
  [two_point]                                   optional: 3 shaped as two point masses, no gear
  3 = { joints = ["A", "B"], reshaped = "3" }
  [gears]                                       Z on the body, Z* of the counter-gear
  z3 = { body = "3", teeth = [40, 20], counter = { mass = "1 kg" }, wheel = { mass = "0.3 kg", inertia = "..." } }
                                                also joint = "B", where it is not the reduction joint;
                                                disc = { mass = "6 kg", diameter = "1 m" }, by its pitch diameter;
                                                counter = { radius_of_gyration = "...", at = [...], on = "CARRIER" }
  [start]                                       about how each body stands: chooses the assembly branch
  2 = "60 deg"

\b
Exit code 3: balanced, but not simulated, or what the source prints differs."""
)
@click.argument("linkage", metavar="LINKAGE")
@click.option(
    "--speed",
    type=Quantity("angular velocity"),
    metavar="SPEED",
    help="Mean speed of the driven joint, with unit [default: as described].",
)
@click.option(
    "--variation",
    type=click.FloatRange(0.0, 0.95, min_open=True),
    default=0.3,
    show_default=True,
    help="Amplitude of the varying speed, as a share of its mean.",
)
@click.option("--force-only", is_flag=True, help="Counter-masses only, no gears.")
@click.option("--equations", "with_equations", is_flag=True, help="Also print the equations in symbols.")
@click.option("--csv", type=click.Path(dir_okay=False), metavar="FILE", help="Write the time series as CSV.")
@click.option(
    "--mjcf",
    type=click.Path(dir_okay=False),
    metavar="FILE",
    help="Write the balanced linkage as MJCF, gears as joint equalities (for MuJoCo).",
)
@options.figure_option
@json_option
def linkage(
    linkage: str,
    speed: float | None,
    variation: float,
    force_only: bool,
    with_equations: bool,
    csv: str | None,
    mjcf: str | None,
    figure: str | None,
    as_json: bool,
) -> None:
    """Balance a planar linkage completely: counter-masses for the force, gears for the moment.

    LINKAGE is a TOML file or a shipped one: dwell, knife, pantograph, sewing-machine, dwell-short,
    dwell-short-two-point (the six of the source), two-levels. Verified by dynamics at constant and varying input speed.
    """
    from ..linkages.document import document
    from ..linkages.linkage_files import load_linkage
    from ..linkages.method import balance
    from ..linkages.printed import compare
    from ..linkages.verification import verify

    if speed == 0.0 or isnan(variation):
        raise click.UsageError(f"--{'speed' if speed == 0.0 else 'variation'}: expected a number other than zero")
    described = load_linkage(linkage)
    result = balance(described, gears=False if force_only else None)
    check = verify(result, speed, variation) if described.is_placed else None
    comparison = None if force_only else compare(result)
    _write(result, check, csv, mjcf, figure)
    if as_json:
        emit_json(document(result, check, comparison))
    else:
        _print(result, check, comparison, with_equations)
    if check is None or (comparison and any(row.verdict == "differs" for row in comparison.rows)):
        raise click.exceptions.Exit(EXIT_WITH_FINDINGS)


def _write(
    result: "Balance", check: "Verification | None", csv: str | None, mjcf: str | None, figure: str | None
) -> None:
    """Files asked for. Raises ModelError where there is nothing simulated to write."""
    from ..errors import ModelError

    if check is None:
        if csv or mjcf or figure:
            raise ModelError(f"{result.linkage.name}: {unplaced(result.linkage)}, so there is nothing to draw or write")
        return
    if mjcf:
        from pathlib import Path

        from ..linkages.model import mjcf as text_of

        text = text_of(result, "complete" if result.moment else "force", couplings=True)
        Path(mjcf).write_text(text + "\n", encoding="utf-8")
    if csv:
        _write_csv(check, csv)
    if figure:
        from ..figures.drawing import save
        from ..figures.linkages import draw_stages

        save(draw_stages(check, result.linkage.title), figure)


def _write_csv(check: "Verification", path: str) -> None:
    from ..table_files import write_csv_file

    columns = {}
    for name, run in (("constant", check.constant), ("varying", check.varying)):
        columns[f"time_{name}_s"] = run.trajectory.time
        for stage in run.responses:
            columns |= {f"{name}_{stage}_{column}": values for column, values in run.series(stage).items()}
    write_csv_file(path, columns)


def _print(
    result: "Balance", check: "Verification | None", comparison: "Comparison | None", with_equations: bool
) -> None:
    from . import linkage_tables as tables

    tables.counter_masses(result)
    tables.gears(result)
    if with_equations:
        tables.equations(result)
    if check is None:
        click.echo(f"Not simulated: {unplaced(result.linkage)}.")
    else:
        tables.dynamics(check)
    if comparison:
        tables.printed(comparison, check)


def unplaced(linkage: "Linkage") -> str:
    """Which joints have no place on the ground."""
    names = [j.name for j in linkage.joints.values() if any(end.point is None for end in j.ends)]
    return f"where {', '.join(names)} {'is' if len(names) == 1 else 'are'} on the ground is not given"
