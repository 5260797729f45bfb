"""``testbench verify``."""

from pathlib import Path

import click

from balance.cli.console import EXIT_REFUSED, EXIT_WITH_FINDINGS, emit_json, emit_table, json_option

from .progress import progress
from .reading import plain


@click.command(
    epilog="""\b
Examples:
  testbench verify campaign
  testbench verify campaign --json
\b
Exit codes: 0 every run is intact, 1 a run is damaged or missing, 3 there are files that are no runs."""
)
@click.argument("campaign", type=click.Path(path_type=Path))
@json_option
def verify(campaign: Path, as_json: bool) -> int:
    """Check every stored run, to the bit, against the digest that was written beside it."""
    from ..store import open_campaign

    opened = open_campaign(campaign)
    with progress("verifying", sum(path.stat().st_size for path in opened.run_paths)) as done:
        files = opened.verify(done)
    if as_json:
        emit_json({"campaign": campaign.name, "files": [file.as_dict() for file in files]})
    else:
        rows = [[plain(file.name), file.status, plain(file.message)] for file in files]
        emit_table(f"{plain(campaign.name)}: {len(files)} files", ["file", "status", "what"], rows)
    states = {file.status for file in files}
    if states & {"damaged", "missing"}:
        return EXIT_REFUSED
    return EXIT_WITH_FINDINGS if states - {"intact"} else 0
