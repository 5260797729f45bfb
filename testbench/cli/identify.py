"""``testbench identify``."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.console import EXIT_WITH_FINDINGS, emit_json, json_option

from . import calibrations, stored_runs

if TYPE_CHECKING:
    from ..identification import Identification


@click.command(
    epilog="""\b
Examples:
  testbench ingest 09_double_pendulum_A0_061705.csv --rig two-joint-arm-a0 -o campaign
  testbench identify two-joint-arm-a0 campaign/09_double_pendulum_A0_061705.h5 --figure torque.png
  testbench identify two-joint-arm-a0 campaign/first.h5 --validate campaign/second.h5 --json
  testbench identify parallelogram-6bar campaign/r0*.h5 --by both
\b
Exit codes: 0 done, 3 done with findings (gaps left out) or doubts, which are listed, 1 refused."""
)
@click.argument("mechanism", metavar="MECH")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--by",
    type=click.Choice(["torque", "wrench", "both"]),
    help="What tells: motor torques, force sensors, or both, weighted by their noise.  [default: torque, if any]",
)
@click.option(
    "--method",
    type=click.Choice(["ls", "iv", "oe"]),
    help="Least squares, instrumental variables, output error.  [default: iv; ls by force sensors alone]",
)
@click.option(
    "--validate",
    "separate",
    metavar="RUN",
    multiple=True,
    type=click.Path(path_type=Path),
    help="A run, or a campaign, that has no part in it, to hold the result against; give it again for more.",
)
@click.option(
    "--accept",
    multiple=True,
    type=click.Choice(["mechanism_differs"]),
    help="Identify though the rig of the runs is of another mechanism than MECH.",
)
@click.option("--rig", help="A rig in place of the one stored with the runs.")
@click.option(
    "--figure", type=click.Path(path_type=Path), help="Draw measured and predicted torque (.png, .svg, .pdf)."
)
@json_option
def identify(mechanism: str, runs: tuple[Path, ...], figure: Path | None, as_json: bool, **options: Any) -> int:  # noqa: ANN401
    """Inertial parameters and friction of MECH from the positions, torques and forces of stored runs.

    What the runs determine is found before solving, and what they do not is named. MECH comes bare: payload and
    counter-masses are those of the first run's conditions, what other runs mounted beyond them is taken off. Cut-off
    and delay are chosen by the torque error on held-out stretches. Intervals (95 %) contain the answers at half and
    double that cut-off, without the delay, and by the other methods.
    """

    from balance.loading.loading import load_mechanism

    from .. import rig as rigs
    from ..identification import identify as identified
    from ..identification.records import assemble
    from ..identification.validation import validate
    from ..runs.aligned_run import AlignedRun
    from ..runs.si_run import SIRun

    model = load_mechanism(mechanism)
    described = rigs.load(options["rig"]) if options["rig"] else None
    opened = stored_runs.opened(runs)
    bound = [AlignedRun(SIRun.of(run, described), model) for run in opened]
    taken = assemble(bound, options["by"], options["accept"])
    result = identified(taken.records, taken.mechanism, options["method"])
    others = stored_runs.opened(options["separate"])
    validation = None
    if others:
        separate = [AlignedRun(SIRun.of(run, described), model) for run in others]
        records = assemble([bound[0], *separate], taken.by, options["accept"]).records[1:]
        validation = validate(result, records)
    if figure is not None:
        _draw(result, figure)
    if as_json:
        from ..identification.document import identification_document

        found = {**identification_document(result, validation), "by": taken.by, "left_out": list(taken.notes)}
        emit_json({**found, "calibrations": calibrations.document(run.run for run in bound)})
    else:
        from .identified import print_result

        print_result(result, validation, taken.notes)
        calibrations.say(run.run for run in bound)
    odd = result.left_out or result.doubts()
    if validation is not None:
        odd = odd or validation.evidence.left_out or validation.doubts()
    return EXIT_WITH_FINDINGS if odd else 0


def _draw(result: "Identification", path: Path) -> None:
    from balance.figures.drawing import save

    from ..identification.figure import draw

    save(draw(result), path)
