"""``testbench plan``: what to do at the bench next."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.framework import emit_json, emit_table, json_option, plain_text
from balance.results import document, table

if TYPE_CHECKING:
    from ..next_run import Question


@click.group()
def plan() -> None:
    """Which run to make next."""


@plan.command(
    "next",
    epilog="""\b
Examples:
  testbench plan next campaign --for first-moment
  testbench plan next campaign --for counter-mass --site counter_A0A --motion triangle --peak 2 --peak 4
\b
Exit codes: 0 done, 1 refused: nothing that a run would show tells what is asked.""",
)
@click.argument("campaign", type=click.Path(path_type=Path))
@click.option(
    "--for",
    "question",
    type=click.Choice(["first-moment", "counter-mass"]),
    default="first-moment",
    show_default=True,
    help="What is to become surer: the first moment or the mass that is missing at sites.",
)
@click.option("--payload", type=float, metavar="KG", help="Of the runs with this payload alone.")
@click.option("--site", multiple=True, help="At these sites alone; those named counter... unless given.")
@click.option("--motion", multiple=True, help="Candidates besides the motions made; else shipped ones like them.")
@click.option("--peak", multiple=True, type=float, metavar="G0", help="Candidates besides the peak accelerations made.")
@json_option
def next_run(
    campaign: Path,
    question: "Question",
    payload: float | None,
    site: tuple[str, ...],
    motion: tuple[str, ...],
    peak: tuple[float, ...],
    as_json: bool,
) -> None:
    """Which run narrows what is asked of CAMPAIGN most, and by how much: every candidate, the best first.

    Half widths are of 95 % intervals: now, and predicted with the candidate. A candidate is a repeat, or a run of
    another motion or acceleration, simulated on the bench of the rig stored with the runs to see what it would show.
    """
    from ..next_run import Proposal, next_for_first_moment
    from ..store import open_campaign

    found = next_for_first_moment(open_campaign(campaign).runs, question, site, payload, motion, peak)
    if as_json:
        emit_json(document(found))
        return
    click.echo(plain_text(found.verdict))
    emit_table(f"Next run, {campaign.name}, half widths in {found.unit}", *table(Proposal, found.proposals))
    for note in found.notes:
        click.echo(click.wrap_text(note, 110))
