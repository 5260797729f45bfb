"""``testbench verify``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.console import EXIT_REFUSED, EXIT_WITH_FINDINGS, emit_json, emit_table, json_option

from .progress import progress
from .reading import plain

if TYPE_CHECKING:
    from ..store.campaign import FileState


@click.command(
    epilog="""\b
Examples:
  testbench verify campaign
  testbench verify campaign --json
\b
Exit codes: 0 every run is intact, 1 a run or record is damaged or missing, 3 there are files that are no runs."""
)
@click.argument("campaign", type=click.Path(path_type=Path))
@json_option
def verify(campaign: Path, as_json: bool) -> int:
    """Check every stored run, to the bit, against the digest that was written beside it; and the later records."""
    from ..store import open_campaign

    opened = open_campaign(campaign)
    with progress("verifying", sum(path.stat().st_size for path in opened.run_paths if path.is_file())) as done:
        files = [*opened.verify(done), *_records(campaign)]
    if as_json:
        emit_json({"campaign": campaign.resolve().name, "files": [file.as_dict() for file in files]})
    else:
        rows = [[plain(file.name), file.status, plain(file.message)] for file in files]
        emit_table(f"{plain(campaign.resolve().name)}: {len(files)} files", ["file", "status", "what"], rows)
    states = {file.status for file in files}
    if states & {"damaged", "missing"}:
        return EXIT_REFUSED
    return EXIT_WITH_FINDINGS if states - {"intact"} else 0


def _records(campaign: Path) -> "list[FileState]":
    """The records that cannot be used, which analyses refuse as well; and the files that no analysis looks at."""
    from ..calibration import stored
    from ..errors import StoreError
    from ..store import records
    from ..store.campaign import FileState

    try:
        if found := records.damaged(campaign):
            return [FileState(f"{records.FOLDER}/{name}", "damaged", message) for name, message in found.items()]
        stored.read(campaign)
    except StoreError as error:
        return [FileState(records.FOLDER, "damaged", str(error))]
    message = "no record by its name: nobody reads it; what it says does not hold"
    return [FileState(f"{records.FOLDER}/{name}", "extra", message) for name in records.others(campaign)]
