"""``testbench list``."""

from pathlib import Path

import click

from balance.cli.console import EXIT_REFUSED, emit_json, emit_table, json_option

from . import stored_runs
from .reading import plain
from .run_table import HEADER, document, row


@click.command(
    "list",
    epilog="""\b
Examples:
  testbench list campaign
  testbench list campaign --json
\b
Exit codes: 0 done, 1 some run cannot be opened (the others are listed).""",
)
@click.argument("campaign", type=click.Path(path_type=Path))
@json_option
def list(campaign: Path, as_json: bool) -> int:
    """The runs of a campaign, with the conditions of each."""
    from ..store import open_campaign

    runs, refused = stored_runs.each(open_campaign(campaign).run_paths)
    if as_json:
        documents = [*map(document, runs), *(one.as_dict() for one in refused)]
        emit_json({"campaign": campaign.resolve().name, "runs": documents})
    else:
        emit_table(f"{plain(campaign.resolve().name)}: {len(runs)} runs", HEADER, [row(run) for run in runs])
    stored_runs.say(refused)
    return EXIT_REFUSED if refused else 0
