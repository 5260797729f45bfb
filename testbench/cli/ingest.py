"""``testbench ingest`` and ``testbench watch``: logs into stored runs."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.framework import EXIT_REFUSED, EXIT_WITH_FINDINGS, JSON, Answer, Word, argument, command, option
from balance.cli.options import SCHEDULER, progress
from balance.cli.printing import Detail, complain, emit_json, emit_table, plain_text, say
from balance.results import first_of, table

from . import options

if TYPE_CHECKING:
    from ..ingestion.ingest import Ingest, Outcome
    from ..ingestion.watch_folder import Watch
    from ..readers import ReadOptions


def _known_codes(context: click.Context, parameter: click.Parameter, codes: tuple[str, ...]) -> tuple[str, ...]:
    """The codes; one that is no finding's is a wrong command line."""
    from ..recording import MEANING

    if unknown := [code for code in codes if code not in MEANING]:
        raise click.UsageError(f"--accept {unknown[0]}: no such code; `testbench info FILE` names those of a file")
    return codes


def _codes(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """What the shell completes after ``--accept``."""
    from ..recording import MEANING

    return [code for code in sorted(MEANING) if code.startswith(incomplete)]


_ACCEPT = option(
    "Store in spite of findings of this code.", metavar="CODE", callback=_known_codes, shell_complete=_codes
)
_CAMPAIGN = option("The campaign's folder.", None, "-o", "--output", required=True)
_RIG = option("What is measured where: a rig file, kept with each run.", metavar="RIG")


@command(
    epilog="""\b
Examples:
  testbench ingest logs/*.csv --rig rig.toml --runs runs.csv -o campaign
  testbench ingest run_001.csv -o campaign --json
  testbench ingest torn.csv -o campaign --accept ragged_row --by "A. Kaya" --reason "the cable was pulled"
\b
Exit codes: 0 all stored, 3 stored with findings, 1 some file was refused (the others are stored)."""
)
@options.text_options
def ingest(
    files: tuple[Path, ...] = argument(required=True),
    rig: str | None = _RIG,
    run_table: Path | None = option("The run table.", None, "--runs"),
    campaign: Path = _CAMPAIGN,
    accept: tuple[str, ...] = _ACCEPT,
    by: str | None = options.BY,
    reason: str | None = options.REASON,
    scheduler: str | None = SCHEDULER,
    *,
    reading: "ReadOptions",
) -> Answer:
    """Read logs into HDF5, one file a run. A run is stored whole or not at all, and never changes.

    Where logs lie in the campaign's folder, a pattern may name its runs too: they are left alone.
    """
    from ..ingestion.log_sources import own_files
    from ..ingestion.planned_runs import other_run_tables

    _refuse_patterns(files)
    own = own_files(files, campaign)
    if own:
        complain(
            f"{campaign}: {len(own)} of the files given are the campaign's own runs and no logs; they are left alone"
        )
    logs = [file for file in files if file not in own]
    tables = other_run_tables(logs, run_table)
    for other, why in tables.items():
        complain(f"{other}: {why}")
    logs = [file for file in logs if file not in tables]
    work = _work(campaign, rig, accept, options.acceptance(accept, by, reason), reading)
    outcomes = _ingest(logs, work, run_table, scheduler)
    reasons: dict[str, dict[str, None]] = {}  # each once, with the runs that were refused for it
    for outcome in outcomes:
        if outcome.status == "refused":
            name, mark, why = outcome.message.partition(_FOR_FINDINGS)
            reasons.setdefault(mark + why, {})[name] = None
    refused = [first_of(names, 12) + why for why, names in reasons.items()]
    code = EXIT_REFUSED if refused else options.exit_code([f for one in outcomes for f in one.findings], accept)
    return Answer({"runs": outcomes}, lambda: _print(outcomes), refused=refused, code=code)


_FOR_FINDINGS = ": refused for "
"""In what is said of a run that is refused for findings of its logs; it is said once, on its own."""


def _refuse_patterns(files: Iterable[Path]) -> None:
    """Raise RecordingError for patterns such as ``*.csv`` that the shell passed on because no file matches them."""
    from ..errors import RecordingError
    from ..readers.registry import no_such_file

    for file in files:
        if any(sign in str(file) for sign in "*?") and not file.exists():
            raise RecordingError(no_such_file(file))


def _work(
    campaign: Path, rig: str | None, accept: Sequence[str], person: dict[str, str] | None, reading: "ReadOptions"
) -> "Ingest":
    """What reads logs into a campaign, by the options of both commands."""
    from ..ingestion import Ingest

    described = None
    if rig is not None:
        from ..rig import load_rig

        described = load_rig(rig)
    return Ingest(campaign, described, reading, frozenset(accept), person)


def _ingest(files: Sequence[Path], work: "Ingest", run_table: Path | None, scheduler: str | None) -> "list[Outcome]":
    from ..ingestion.log_sources import SiblingLogs
    from ..ingestion.planned_runs import plan_runs

    runs = plan_runs(files, run_table)
    others = SiblingLogs(files if run_table is None else (), work.reading)
    total = sum(path.stat().st_size for run in runs for path in run.files if path.is_file())
    work = replace(work, sibling_log=others.holding)
    work.reading.add_logs(files)
    if scheduler is None:
        with progress("reading", total) as done:
            work = replace(work, progress=done)
            return [outcome for run in runs for outcome in work.run(run)]
    from balance.task_pool import task_pool

    with task_pool(scheduler) as pool:
        found = dict(pool.results(work.run, runs))
    return [outcome for place in range(len(runs)) for outcome in found[place]]


_MOST_ROWS = 12
"""Logs up to which each has its row; of more, those with findings or not stored have, and all with ``--all``."""


def _print(outcomes: "Sequence[Outcome]") -> None:
    from ..ingestion.ingest import Outcome

    counts = Counter(outcome.status.replace("_", " ") for outcome in outcomes)
    odd = [one for one in outcomes if one.status != "stored" or any(f.severity > 0 for f in one.findings)]
    runs = len({one.file for one in outcomes if one.file})
    title = f"Logs: {', '.join(f'{count} {status}' for status, count in counts.items()) or 'none'}"
    title += f" in {runs} run{'s' * (runs > 1)}" if runs else ""
    say(f"{title}{'' if odd or not outcomes else ', without findings'}.")
    shown = outcomes if Detail.everything or len(outcomes) <= _MOST_ROWS else odd
    if shown:
        emit_table("", *table(Outcome, shown, "source", "file", "origin", "status", "findings"))
    found = [
        (outcome.source, finding)
        for outcome in outcomes
        for finding in outcome.findings
        if finding.severity > 0 and not (finding.code == "not_stored" and _FOR_FINDINGS in finding.message)
    ]
    options.print_reading_findings("Findings", found)


@command(
    epilog="""\b
Examples:
  testbench watch incoming -o campaign --rig rig.toml
  testbench watch incoming -o campaign --rig rig.toml --runs runs.csv
  testbench watch incoming -o campaign --once --json
\b
With --runs, files that the run table names are ingested with its conditions, once all files of a run are there; others
wait until it names them (--unnamed store: are stored without conditions). The run table is read again when it changes.
\b
Exit codes of --once: 0 all stored, 3 stored with findings, still growing or waiting, 1 some file was refused."""
)
@options.text_options
def watch(
    folder: Path = argument(),
    campaign: Path = _CAMPAIGN,
    rig: str | None = _RIG,
    run_table: Path | None = option("The run table; it may change.", None, "--runs"),
    unnamed: str = option(
        "What becomes of files that the run table does not name.", Word(["wait", "store"]), default="wait"
    ),
    accept: tuple[str, ...] = _ACCEPT,
    by: str | None = options.BY,
    reason: str | None = options.REASON,
    once: bool = option("One pass over what is there, then stop."),
    live: bool = option("Also levels and findings of logs that still grow, and the reduction so far."),
    settle: str = option("How long a file must not have changed.", default="2s", metavar="TIME"),
    as_json: bool = JSON,
    *,
    reading: "ReadOptions",
) -> int:
    """Ingest what arrives in FOLDER, each log once, also after a crash. What is refused is said, and the next comes."""
    from balance.units import parse

    from ..errors import RecordingError
    from ..ingestion.watch_folder import Watch, WatchedRunTable, knows_all_writers

    if live and once:
        raise click.UsageError("--live follows logs while they grow: leave out --once")
    if as_json and not once:
        raise click.UsageError("--json prints one document at the end: it needs --once")
    if not folder.is_dir():
        what = "is a file" if folder.exists() else "no such folder"
        raise RecordingError(f"{folder}: {what}; expected a folder that logs arrive in")
    if campaign.is_dir() and folder.samefile(campaign):
        raise RecordingError(
            f"{folder}: is the campaign's folder too: its runs would arrive as logs; name another (-o)"
        )
    work = _work(campaign, rig, accept, options.acceptance(accept, by, reason), reading)
    watching = Watch(folder, work, parse(settle, "time"))
    watching.store_unnamed = unnamed == "store"
    if run_table is not None:
        watching.run_table = WatchedRunTable(run_table, watching.settle_s)
    if not once:
        click.echo(f"watching {plain_text(str(watching.folder))}; Ctrl-C ends it", err=True)
        if not knows_all_writers():
            click.echo(
                "whether a process still writes a log is known of this user's alone, if at all: a log is stored once "
                "it has rested; if it grows later, its run is marked incomplete until its next version is stored",
                err=True,
            )
        _say(watching.forever(_live(watching) if live else lambda: None), quiet=False)
    return _last_pass(watching, accept, as_json)


def _last_pass(watching: "Watch", accept: tuple[str, ...], as_json: bool) -> int:
    """One pass over what is there, what is left for later, and the exit code."""
    from ..ingestion.watch_folder import knows_all_writers

    outcomes = [o for o in _say(watching.once(), quiet=as_json) if o.status != "waiting"]
    if as_json:
        growing = [path.name for path in watching.growing]
        waiting = [{"file": path.name, "reason": reason} for path, reason in watching.waiting.items()]
        writing = {path.name: process for path, process in watching.writing.items()}
        known = {"growing": growing, "writing": writing, "writers_known": knows_all_writers()}
        emit_json({"runs": outcomes, **known, "waiting": waiting})
    for path in watching.growing:
        writer = watching.writing.get(path)
        why = "still grows" if writer is None else f"process {writer} has it open for writing"
        complain(f"{path.name}: {why}; left for later")
    if any(outcome.status == "refused" for outcome in outcomes):
        return EXIT_REFUSED
    kept = [f for o in outcomes if o.status == "stored" for f in o.findings]
    return max(options.exit_code(kept, accept), EXIT_WITH_FINDINGS if watching.growing or watching.waiting else 0)


def _live(watching: "Watch") -> Callable[[], None]:
    """Prints levels, clipping and dead channels of each log that grew since last, then the reduction so far."""
    from balance.errors import CounterpoiseError

    from ..front_door import analyze
    from ..quality.log_description import describe_log
    from .analyze import print_reductions
    from .logs import print_description

    shown: dict[Path, int] = {}
    campaign, analyzed = watching.ingest.folder, 0

    def show() -> None:
        nonlocal analyzed
        for path in watching.growing:
            try:
                size = path.stat().st_size
                if shown.get(path) != size:
                    shown[path] = size
                    print_description(describe_log(path, watching.ingest.reading.options(path)), stats=True)
            except (CounterpoiseError, OSError) as error:
                click.echo(f"{plain_text(path.name)}: so far {plain_text(str(error))}")
        stored = len(list(campaign.glob("*.h5")))
        if stored != analyzed:
            analyzed = stored
            try:
                print_reductions(campaign, analyze(campaign))
            except CounterpoiseError as error:
                say("\n".join(map(plain_text, f"No reduction yet: {error}".splitlines())))

    return show


def _say(outcomes: "Iterable[Outcome]", quiet: bool) -> "list[Outcome]":
    """Print each outcome when it comes; refusals to stderr."""
    reported = []
    for outcome in outcomes:
        reported.append(outcome)
        if outcome.status == "refused":
            complain(outcome.message)
        elif outcome.status == "waiting":
            complain(f"{outcome.source}: {outcome.message}")
        elif not quiet:
            name = plain_text(outcome.source)
            say(f"{name}: {outcome.status.replace('_', ' ')} as {plain_text(outcome.file or '-')}")
            odd = (one for one in outcome.findings if one.severity > 0 and one.code != "already_stored")
            options.print_reading_findings(name, (("", one) for one in odd))
    return reported
