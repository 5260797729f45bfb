"""``testbench recover``."""

from pathlib import Path

import click

from balance.cli.console import EXIT_REFUSED, EXIT_WITH_FINDINGS, emit_json, emit_table, json_option

from .reading import plain


@click.command(
    epilog="""\b
Examples:
  testbench recover campaign
  testbench recover campaign --json
\b
Exit codes: 0 nothing to do, or nothing was lost; 3 recovered, with the losses that are listed;
1 something could not be saved."""
)
@click.argument("campaign", type=click.Path(path_type=Path))
@json_option
def recover(campaign: Path, as_json: bool) -> int:
    """Save what ingests had acknowledged before they were stopped.

    It becomes a run of its own, NAME.recovered, which says what is lost; no stored run is touched. If the log is
    still at hand, ingest it again: then nothing is lost at all, and `testbench analyze` leaves NAME.recovered out.
    """
    from ..recovery import recover as save

    found = save(campaign)
    if as_json:
        emit_json({"campaign": campaign.resolve().name, "recovered": [one.as_dict() for one in found]})
    elif found:
        rows = [[plain(one.run), one.status, plain(one.file or "-"), plain(one.message)] for one in found]
        emit_table(
            f"{plain(campaign.resolve().name)}: {len(found)} left by stopped ingests",
            ["run", "status", "file", "what"],
            rows,
        )
    else:
        click.echo(f"{plain(campaign.resolve().name)}: no ingest was stopped; nothing to do")
    states = {one.status for one in found}
    if states & {"failed", "empty"}:
        return EXIT_REFUSED
    return EXIT_WITH_FINDINGS if "recovered" in states else 0
