"""``testbench ingest``."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.console import EXIT_REFUSED, emit_json, emit_table, json_option

from . import reading
from .progress import progress

if TYPE_CHECKING:
    from ..ingest.outcome import Outcome
    from ..rig import Rig


@click.command(
    epilog="""\b
Examples:
  testbench ingest logs/*.csv --rig rig.toml --runs runs.csv -o campaign
  testbench ingest run_001.csv -o campaign --json
  testbench ingest torn.csv -o campaign --accept ragged_row
\b
Exit codes: 0 all stored, 3 stored with findings, 1 some file was refused (the others are stored)."""
)
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--rig", metavar="RIG", help="What is measured where: a rig file, kept with each run.")
@click.option("--runs", "sheet", type=click.Path(path_type=Path), help="The sheet of run conditions.")
@click.option(
    "-o", "--output", "campaign", required=True, type=click.Path(path_type=Path), help="The campaign's folder."
)
@click.option("--accept", multiple=True, metavar="CODE", help="Store in spite of findings of this code.")
@reading.text_options
@json_option
def ingest(
    files: tuple[Path, ...],
    rig: str | None,
    sheet: Path | None,
    campaign: Path,
    accept: tuple[str, ...],
    as_json: bool,
    **text: Any,  # noqa: ANN401
) -> int:
    """Read logs into HDF5, one file a run. A run is stored whole or not at all, and never changes.

    Where logs lie in the campaign's folder, a pattern may name its runs too: they are left alone.
    """
    from ..findings import MEANING
    from ..ingest.nolog import own_files

    if unknown := [code for code in accept if code not in MEANING]:
        raise click.UsageError(f"--accept {unknown[0]}: no such code; `testbench info FILE` names those of a file")
    reading.refuse_patterns(files)
    own = own_files(files, campaign)
    if own:
        message = (
            f"{campaign}: {len(own)} of the files given are the campaign's own runs and no logs; they are left alone"
        )
        click.echo(f"testbench: {reading.plain(message)}", err=True)
    outcomes = _ingest([file for file in files if file not in own], _rig(rig), sheet, campaign, accept, text)
    if as_json:
        emit_json({"runs": [outcome.as_dict() for outcome in outcomes]})
    else:
        _print(outcomes)
    for message in dict.fromkeys(outcome.message for outcome in outcomes if outcome.status == "refused"):
        click.echo(f"testbench: {reading.plain(message)}", err=True)
    if any(outcome.status == "refused" for outcome in outcomes):
        return EXIT_REFUSED
    return reading.exit_code([f for outcome in outcomes for f in outcome.findings], accept)


def _rig(name: str | None) -> "Rig | None":
    if name is None:
        return None
    from .. import rig

    return rig.load(name)


def _ingest(
    files: Sequence[Path],
    rig: "Rig | None",
    sheet: Path | None,
    campaign: Path,
    accept: Sequence[str],
    text: dict[str, Any],
) -> "list[Outcome]":
    from ..ingest import Ingest
    from ..ingest.elsewhere import OtherLogs
    from ..ingest.runsheet import plan

    runs, options = plan(files, sheet), reading.read_options(**text)
    others = OtherLogs(files if sheet is None else (), options)
    total = sum(path.stat().st_size for run in runs for path in run.files if path.is_file())
    with progress("reading", total) as done:
        work = Ingest(campaign, rig, options, frozenset(accept), done, others.holding)
        return [outcome for run in runs for outcome in work.run(run)]


def _print(outcomes: "Sequence[Outcome]") -> None:
    rows = [
        [reading.plain(o.source), o.file or "-", o.origin, o.status, str(sum(f.severity > 0 for f in o.findings))]
        for o in outcomes
    ]
    emit_table("Runs", ["log", "run", "origin", "status", "findings"], rows)
    for outcome in outcomes:
        reading.print_findings(outcome.source, (f for f in outcome.findings if f.severity > 0))
