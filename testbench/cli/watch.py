"""``testbench watch``."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.console import EXIT_REFUSED, EXIT_WITH_FINDINGS, emit_json, json_option

from . import reading

if TYPE_CHECKING:
    from ..ingest.outcome import Outcome
    from ..ingest.watch import Watch


@click.command(
    epilog="""\b
Examples:
  testbench watch incoming -o campaign --rig rig.toml
  testbench watch incoming -o campaign --rig rig.toml --runs runs.csv
  testbench watch incoming -o campaign --once --json
\b
With --runs, files that the sheet names are ingested with its conditions, once all files of a run are there; others wait
until it names them (--unnamed store: are stored without conditions). The sheet is read again when it changes.
\b
Exit codes of --once: 0 all stored, 3 stored with findings, still growing or waiting, 1 some file was refused."""
)
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", "campaign", required=True, type=click.Path(path_type=Path), help="The campaign's folder."
)
@click.option("--rig", metavar="RIG", help="What is measured where: a rig file, kept with each run.")
@click.option("--runs", "sheet", type=click.Path(path_type=Path), help="The sheet of run conditions; it may change.")
@click.option(
    "--unnamed",
    type=click.Choice(["wait", "store"]),
    default="wait",
    show_default=True,
    help="What becomes of files that the sheet does not name.",
)
@click.option("--accept", multiple=True, metavar="CODE", help="Store in spite of findings of this code.")
@click.option("--once", is_flag=True, help="One pass over what is there, then stop.")
@click.option(
    "--settle", default="2s", show_default=True, metavar="TIME", help="How long a file must not have changed."
)
@reading.text_options
@json_option
def watch(
    folder: Path,
    campaign: Path,
    rig: str | None,
    sheet: Path | None,
    unnamed: str,
    accept: tuple[str, ...],
    once: bool,
    settle: str,
    as_json: bool,
    **text: Any,  # noqa: ANN401
) -> int:
    """Ingest what arrives in FOLDER, each log once, also after a crash. What is refused is said, and the next comes."""
    from ..errors import RecordingError
    from ..findings import MEANING

    if unknown := [code for code in accept if code not in MEANING]:
        raise click.UsageError(f"--accept {unknown[0]}: no such code; `testbench info FILE` names those of a file")
    if as_json and not once:
        raise click.UsageError("--json prints one document at the end: it needs --once")
    if not folder.is_dir():
        what = "is a file" if folder.exists() else "no such folder"
        raise RecordingError(f"{folder}: {what}; expected a folder that logs arrive in")
    if campaign.is_dir() and folder.samefile(campaign):
        raise RecordingError(
            f"{folder}: is the campaign's folder too: its runs would arrive as logs; name another (-o)"
        )
    watching = _watching(folder, campaign, rig, accept, settle, text)
    watching.store_unnamed = unnamed == "store"
    if sheet is not None:
        from ..ingest.watchedsheet import WatchedSheet

        watching.sheet = WatchedSheet(sheet, watching.settle_s)
    if not once:
        click.echo(f"watching {reading.plain(str(folder))}; Ctrl-C ends it", err=True)
        _say(watching.forever(), quiet=False)
    outcomes = [o for o in _say(watching.once(), quiet=as_json) if o.status != "waiting"]
    if as_json:
        growing = [path.name for path in watching.growing]
        waiting = [{"file": path.name, "reason": reason} for path, reason in watching.waiting.items()]
        emit_json({"runs": [outcome.as_dict() for outcome in outcomes], "growing": growing, "waiting": waiting})
    for path in watching.growing:
        click.echo(f"testbench: {reading.plain(path.name)}: still grows; left for later", err=True)
    if any(outcome.status == "refused" for outcome in outcomes):
        return EXIT_REFUSED
    kept = [f for o in outcomes if o.status == "stored" for f in o.findings]
    return max(reading.exit_code(kept, accept), EXIT_WITH_FINDINGS if watching.growing or watching.waiting else 0)


def _watching(
    folder: Path, campaign: Path, rig: str | None, accept: Iterable[str], settle: str, text: dict[str, Any]
) -> "Watch":
    from balance.quantities import parse

    from .. import rig as rigs
    from ..ingest import Ingest
    from ..ingest.watch import Watch

    work = Ingest(campaign, None if rig is None else rigs.load(rig), reading.read_options(**text), frozenset(accept))
    return Watch(folder, work, parse(settle, "time"))


def _say(outcomes: "Iterable[Outcome]", quiet: bool) -> "list[Outcome]":
    """Print each outcome when it comes; refusals to stderr."""
    told = []
    for outcome in outcomes:
        told.append(outcome)
        if outcome.status == "refused":
            click.echo(f"testbench: {reading.plain(outcome.message)}", err=True)
        elif outcome.status == "waiting":
            click.echo(f"testbench: {reading.plain(outcome.source)}: {reading.plain(outcome.message)}", err=True)
        elif not quiet:
            name = reading.plain(outcome.source)
            click.echo(f"{name}: {outcome.status.replace('_', ' ')} as {reading.plain(outcome.file or '-')}")
            reading.print_findings(name, (f for f in outcome.findings if f.severity > 0 and f.code != "already_stored"))
    return told
