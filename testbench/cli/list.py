"""``testbench list``."""

from pathlib import Path

import click

from balance.cli.console import emit_json, emit_table, json_option

from .reading import plain
from .run_table import HEADER, document, row


@click.command(
    "list",
    epilog="""\b
Examples:
  testbench list campaign
  testbench list campaign --json""",
)
@click.argument("campaign", type=click.Path(path_type=Path))
@json_option
def list(campaign: Path, as_json: bool) -> None:
    """The runs of a campaign, with the conditions of each."""
    from ..store import open_campaign

    runs = open_campaign(campaign).runs
    if as_json:
        emit_json({"campaign": campaign.name, "runs": [document(run) for run in runs]})
        return
    emit_table(f"{plain(campaign.name)}: {len(runs)} runs", HEADER, [row(run) for run in runs])
