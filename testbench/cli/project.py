"""``testbench new``, ``check`` and ``plan``: the folder of a test of one's own machine, and what to do next."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.framework import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option, plain_text
from balance.results import document, table

from . import options
from .analyze import measure_options

if TYPE_CHECKING:
    from balance.input_files import Measured

    from ..next_run import Question
    from ..signal import Metric
    from ..signal.filters import Band


@click.command(
    epilog="""\b
Examples:
  testbench new my-test --from my-machine.xml
  testbench new my-test --from robot.urdf --loggers 1
  testbench new trial
\b
Exit codes: 0 done, 1 the mechanism cannot be read, or the folder is in use."""
)
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "--from", "mechanism", metavar="MECH", help="A mechanism file or a shipped one; parallelogram-6bar unless given."
)
@click.option(
    "--loggers",
    type=click.IntRange(1, 2),
    default=2,
    show_default=True,
    help="Of the accelerometer and the drives: one, or one each.",
)
def new(folder: Path, mechanism: str | None, loggers: int) -> None:
    """Write a FOLDER with all that a test needs: mechanism, motion, rig, plan, run table, and what to do next.

    It is valid as it is and runs on simulated logs; what the mechanism does not say is a guess, marked (guess).
    """
    from ..project import new_project

    files = new_project(folder, mechanism, loggers)
    click.echo(f"{plain_text(str(folder))}: {', '.join(map(plain_text, files))}. README.md says what to do next.")


@click.command(
    epilog="""\b
Examples:
  testbench check my-test
  testbench check . --json
\b
Exit codes: 0 nothing is missing, 3 something is, 1 no such folder."""
)
@click.argument("folder", type=click.Path(path_type=Path))
@json_option
def check(folder: Path, as_json: bool) -> int:
    """Say all that is missing in FOLDER, or contradicts: rig.toml, plan.toml, runs.csv, mechanism and motions."""
    from ..project import Problem, project_problems

    problems = project_problems(folder)
    if as_json:
        emit_json({"problems": [document(problem) for problem in problems]})
    elif not problems:
        click.echo(f"{plain_text(str(folder))}: nothing is missing and nothing contradicts.")
    else:
        click.echo(f"{plain_text(str(folder))}: {len(problems)} problem{'s' if len(problems) > 1 else ''}.")
        emit_table("Problems", *table(Problem, problems))
    return EXIT_WITH_FINDINGS if problems else 0


@click.group()
def plan() -> None:
    """Which run to make next."""


@plan.command(
    "next",
    epilog="""\b
Examples:
  testbench plan next campaign
  testbench plan next campaign --for reduction --payload 5 --motion x --axis x --axis y
  testbench plan next campaign --for first-moment
  testbench plan next campaign --for counter-mass --site counter_A0A --motion triangle --peak "2 g0" --peak "4 g0"
\b
Exit codes: 0 done, 1 refused: nothing that a run would show tells what is asked.""",
)
@click.argument("campaign", type=click.Path(path_type=Path))
@click.option(
    "--for",
    "question",
    type=click.Choice(["reduction", "first-moment", "counter-mass"]),
    default="reduction",
    show_default=True,
    help="What is to become surer: reductions, or the first moment or the mass that is missing at sites.",
)
@click.option("--payload", type=float, metavar="KG", help="Of the runs with this payload alone.")
@click.option("--site", multiple=True, help="At these sites alone; those named counter... unless given.")
@click.option(
    "--motion", multiple=True, help="Reductions of these alone; of first moments candidates besides the motions made."
)
@click.option("--peak", multiple=True, metavar="TEXT", help="The same of peak accelerations: '2 g0', '60 rad/s^2'.")
@click.option("--axis", multiple=True, type=click.Choice(["x", "y", "z"]), help="Reductions along these axes alone.")
@measure_options
@options.accept_option
@json_option
def next_run(
    campaign: Path,
    question: "Question",
    payload: float | None,
    site: tuple[str, ...],
    motion: tuple[str, ...],
    peak: tuple[str, ...],
    axis: tuple[str, ...],
    metric: "Metric",
    band: "Band | None",
    accept: tuple[str, ...],
    as_json: bool,
) -> None:
    """Which run narrows what is asked of CAMPAIGN most, and by how much: every candidate, the best first.

    Half widths are of 95 % intervals: now, and predicted with the candidate. Of a reduction a candidate is a repeat of
    a run with or without counter-masses; of a first moment it may be a run of another motion or acceleration, simulated
    on the bench of the rig that is stored with the runs to see what it would show.
    """
    options.refuse_unknown_codes(accept)
    if question == "reduction" and site:
        raise click.UsageError("--site is of first moments and counter-masses: give --for first-moment")
    if question != "reduction" and axis:
        raise click.UsageError("--axis is of reductions")
    from ..next_run import Proposal, next_for_first_moment, next_for_reduction
    from ..store import open_campaign
    from ..vibration.metrics import Measure

    runs, peaks = open_campaign(campaign).runs, [_peak(text) for text in peak]
    if question == "reduction":
        found = next_for_reduction(runs, Measure(metric, band), payload, motion, peaks, axis, accept)
    else:
        found = next_for_first_moment(runs, question, site, payload, motion, peaks)
    if as_json:
        emit_json(document(found))
        return
    click.echo(plain_text(found.verdict))
    emit_table(f"Next run, {campaign.name}, half widths in {found.unit}", *table(Proposal, found.proposals))
    for note in found.notes:
        click.echo(click.wrap_text(note, 110))


def _peak(text: str) -> "Measured[float]":
    """A peak acceleration of a point or of joints that turn."""
    from pydantic import TypeAdapter, ValidationError

    from ..rig.key_types import PeakAcceleration

    try:
        found: Measured[float] = TypeAdapter(PeakAcceleration).validate_python(text)
    except ValidationError as error:
        message = error.errors(include_url=False)[0]["msg"].removeprefix("Value error, ")
        raise click.UsageError(f"--peak {message}") from error
    return found
