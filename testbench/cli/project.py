"""``testbench new``, ``check`` and ``plan``: the folder of a test of one's own machine, and what to do next."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.framework import Answer, Read, Word, argument, command, option
from balance.cli.printing import emit_table, plain_text, say
from balance.results import document, table

from . import options
from .analyze import BAND, METRIC

if TYPE_CHECKING:
    from balance.input_files import Measured

    from ..next_run import Question
    from ..signal import Metric
    from ..signal.filters import Band
    from ..trimming import Source


@command(
    epilog="""\b
Examples:
  testbench new my-test --from my-machine.xml
  testbench new my-test --from robot.urdf --loggers 1
  testbench new trial
\b
Exit codes: 0 done, 1 the mechanism cannot be read, or the folder is in use."""
)
def new(
    folder: Path = argument(),
    mechanism: str | None = option(
        "A mechanism file or a shipped one; parallelogram-6bar unless given.", None, "--from", metavar="MECH"
    ),
    loggers: int = option(
        "1: one logger for accelerometer and drives; 2: one for each.", click.IntRange(1, 2), default=2
    ),
) -> None:
    """Write a FOLDER with all that a test needs: mechanism, motion, rig, plan, run table, and what to do next.

    It is valid as it is and runs on simulated logs; what the mechanism does not say is a guess, marked (guess).
    """
    from ..project import new_project

    files = new_project(folder, mechanism, loggers)
    names = ", ".join(map(plain_text, files))
    say(f"{plain_text(str(folder))}: {len(files)} files, {names}; README.md says what to do next.")


@command(
    epilog="""\b
Examples:
  testbench check my-test
  testbench check my-test logs/*.csv
  testbench check . --json
\b
Exit codes: 0 nothing is missing, 3 something is, 1 no such folder."""
)
def check(folder: Path = argument(), logs: tuple[Path, ...] = argument("[LOG]...", required=False)) -> Answer:
    """List all that is missing or contradicts in FOLDER: rig.toml, plan.toml, the run table (runs.csv, else
    runs.xlsx), mechanism and motions; with LOGS also which of them the run table does not name, and the reverse.
    Headers of the logs, given or in FOLDER, are held against the rig; what `ingest` refuses in a run table is listed.
    """
    from ..project import Problem, project_problems

    found = project_problems(folder, logs)
    problems, notes = ([one for one in found if one.is_note is wanted] for wanted in (False, True))

    def show() -> None:
        number = f"{len(problems)} problem{'s' * (len(problems) > 1)}"
        say(f"{plain_text(str(folder))}: {number if problems else 'complete, no contradiction'}.")
        for title, rows in (("Problems", problems), ("Notes: for simulated logs alone", notes)):
            if rows:
                emit_table(title, *table(Problem, rows))

    return Answer({"problems": problems, "notes": notes}, show, bool(problems))


@click.group()
def plan() -> None:
    """Which run to make next."""


def _payload(text: str) -> tuple[str, float]:
    """A mass, with or without its unit, and the name before it."""
    from balance.units import si

    name, _, mass = text.rpartition("=")
    try:
        return name.strip(), float(mass)
    except ValueError:
        return name.strip(), si(mass, "mass")


def _peak(text: str) -> "Measured[float]":
    """A peak acceleration of a point or of joints that turn."""
    from ..rig.key_types import PEAK_ACCELERATION

    found: Measured[float] = PEAK_ACCELERATION.parse(text)
    return found


@command(
    "next",
    group=plan,
    epilog="""\b
Examples:
  testbench plan next campaign
  testbench plan next campaign --for reduction --payload 5 --motion x --axis x --axis y
  testbench plan next campaign --payload tool=1.5kg
  testbench plan next campaign --for first-moment
  testbench plan next campaign --for counter-mass --site counter_A0A --motion triangle --peak "2 g0" --peak "4 g0"
\b
Exit codes: 0 done, 1 refused: nothing that a run would show tells what is asked.""",
)
def next_run(
    campaign: Path = argument(),
    question: "Question" = option(
        "What is to become surer: reductions, or the first moment or the mass that is missing at sites.",
        Word(["reduction", "first-moment", "counter-mass"]),
        "--for",
        default="reduction",
    ),
    payload: tuple[tuple[str, float], ...] = option(
        "Of the runs with this payload alone; where several bodies or sites carry one, with its name.",
        Read("payload", _payload),
        metavar="[NAME=]KG",
    ),
    site: tuple[str, ...] = option("At these sites alone; those named counter... unless given."),
    motion: tuple[str, ...] = option(
        "Reductions of these alone; of first moments candidates besides the motions made."
    ),
    peak: "tuple[Measured[float], ...]" = option(
        "These peak accelerations alone, such as '2 g0' or '60 rad/s^2'.",
        Read("peak", _peak),
        metavar="TEXT",
        multiple=True,
    ),
    axis: tuple[str, ...] = option("Reductions along these axes alone.", Word(["x", "y", "z"])),
    sources: "tuple[Source, ...]" = option(
        "First moments by force sensors, motor torques, or the base's vibration with the base that the rig states; "
        "give it again for several.  [default: what the rig has]",
        Word(["wrench", "torque", "vibration"]),
        "--from",
        multiple=True,
    ),
    metric: "Metric" = METRIC,
    band: "Band | None" = BAND,
    accept: tuple[str, ...] = options.ACCEPT,
) -> Answer:
    """Which run narrows what is asked of CAMPAIGN most, and by how much: every candidate, the best first.

    Half widths are of 95 % intervals: now, and predicted with the candidate. Of a reduction a candidate is a repeat of
    a run with or without counter-masses; of a first moment it may be a run of another motion or acceleration, simulated
    on the bench of the rig that is stored with the runs to see what it would show.
    """
    if question == "reduction" and site:
        raise click.UsageError("--site is of first moments and counter-masses: give --for first-moment")
    if question != "reduction" and axis:
        raise click.UsageError("--axis is of reductions")
    if question == "reduction" and sources:
        raise click.UsageError("--from is of first moments and counter-masses: give --for first-moment")
    from ..front_door import plan_next
    from ..next_run import Proposal
    from ..store import open_campaign

    runs = open_campaign(campaign)
    found = plan_next(runs, question, dict(payload), motion, peak, axis, site, metric, band, accept, sources)

    def show() -> None:
        say(plain_text(found.verdict))
        emit_table(f"Next run, {campaign.name}, half widths in {found.unit}", *table(Proposal, found.proposals))
        for note in found.notes:
            say(note)

    return Answer(document(found), show)
