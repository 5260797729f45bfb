"""Commands on a campaign: ``list``, ``verify``, ``ledger``, ``remove``, ``recover``, ``archive``, ``export``."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.framework import EXIT_REFUSED, Answer, Word, argument, command, option
from balance.cli.options import progress
from balance.cli.printing import emit_table, plain_text, say
from balance.results import document, table

from . import options

if TYPE_CHECKING:
    from ..export import Exported
    from ..store import Run
    from ..store.campaign import FileState

ARCHIVE_COLUMNS = ("run", "status", "float64_bytes", "sample_bytes", "ratio", "whole_numbers", "channels")
TARGETS = ("csv", "parquet", "mat", "uff", "sep005", "ro-crate")


@command(
    epilog="""\b
Examples:
  testbench export campaign/r001.h5 --to csv -o tables
  testbench export campaign --to parquet -o tables --physical
  testbench export campaign --to csv --physical --resample "1 kHz" -o joined   (after testbench align)
  testbench export campaign --to ro-crate --licence CC-BY-4.0 -o crate
\b
SEP005 defines objects in memory and no file: testbench.export.sep005(testbench.open_run("r001.h5"))
Exit codes: 0 done, 3 done with losses, which are listed, 1 some run was refused (the others are exported)."""
)
def export(
    stored: Path = argument("RUN|CAMPAIGN"),
    to: str = option("The form to write.", Word(TARGETS), required=True),
    output: Path = option("The folder to write into.", None, "-o", "--output", required=True),
    licence: str | None = option("Licence of the runs, such as CC-BY-4.0: for ro-crate.", metavar="NAME|URL"),
    physical: bool = option("Values in SI, by the calibration that holds, and not as recorded."),
    resample: str | None = option(
        "All loggers of a run in one table on one clock, at this rate: csv or parquet.", metavar="RATE"
    ),
) -> Answer:
    """Write stored runs in another form: values as recorded, with units, time and provenance. Overwrites nothing."""
    if to == "sep005":
        raise click.UsageError("SEP005 defines no file: use testbench.export.sep005(run) in Python")
    if licence and to != "ro-crate":
        raise click.UsageError("--licence is for --to ro-crate")
    if resample and to not in ("csv", "parquet"):
        raise click.UsageError("--resample makes one table: --to csv or parquet")
    if physical and to == "ro-crate":
        raise click.UsageError("a crate holds the runs as they are stored: --physical is for the other forms")
    runs: list[Run]
    refused: list[options.NotOpened] = []
    if to == "ro-crate":  # a crate describes a whole campaign, so that it takes all of it or nothing
        from ..export import ro_crate
        from ..front_door import runs_of
        from ..store import Campaign

        runs = runs_of(stored)
        folder = stored if stored.is_dir() else stored.parent
        written = [ro_crate.export_crate(Campaign(folder), list(runs), output, licence)]
    else:
        from ..export import export as write
        from ..export import export_joined
        from ..runs.si_run import physical as in_si

        runs, refused = options.openable_runs([stored])
        with progress("exporting", sum(run.path.stat().st_size for run in runs)) as done:

            def exported(run: "Run") -> "list[Exported]":
                given = in_si(run) if physical else run
                files = [export_joined(given, resample, to, output)] if resample else write(given, to, output)
                done(run.path.stat().st_size)
                return files

            each, failed = options.each_run(runs, exported)
        written, refused = [one for files in each for one in files], [*refused, *failed]
    applied = options.calibrations(runs) if physical else []
    losses = [loss for one in written for loss in one.losses]

    def show() -> None:
        say(f"{len(written)} files in {plain_text(str(output))}, {len(losses)} losses.")
        for one in written:
            say(plain_text(str(one.file)))
        for loss in losses:
            say(f"  lost: {plain_text(loss)}")
        options.print_calibrations(applied)

    known = {"physical": physical, "calibrations": applied, "ledgers": options.ledgers(runs), "refused": refused}
    return Answer({"to": to, "files": written, **known}, show, bool(losses), refused=refused)


@command(
    epilog="""\b
Examples:
  testbench archive campaign -o archive
  testbench archive campaign/r001.h5 campaign/r002.h5 -o archive --json
\b
For tests that are over: such runs take less room, and are read a little more slowly. The archive is a campaign like
any other: verify, list, analyze, export read it as it is. An archived run names the SHA-256 of the run that it was
made of; the originals are left where they are.
Exit codes: 0 done, 1 some run was refused (the others are archived)."""
)
def archive(
    stored: tuple[Path, ...] = argument("RUN|CAMPAIGN...", required=True),
    output: Path = option("The folder of the archive.", None, "-o", "--output", required=True),
) -> Answer:
    """Store runs anew, small, and the same to the bit. Overwrites nothing; needs no HDF5 plugin to be read.

    Numbers of fixed decimals are kept as whole numbers, others as they are; both are compressed. Each channel is read
    back and compared before a run has its name.
    """
    from ..store import append_only_records
    from ..store.archive import Archived
    from ..store.archive import archive as make
    from ..store.ledger import enter_found

    runs, unopened = options.openable_runs(stored)
    for folder in dict.fromkeys(run.path.parent for run in runs):
        # an archive without its records would be calibrated otherwise: none is made then
        append_only_records.read_records(folder)
    total = sum(8 * len(group.channels) * group.samples for run in runs for group in run.groups)
    with progress("archiving", total) as advance:
        done, failed = options.each_run(runs, lambda run: make(run, output, advance))
    refused = [*unopened, *failed]
    for folder in dict.fromkeys(run.path.parent for run in runs):
        if done:
            append_only_records.copy(folder, output)
    if done:
        enter_found(output)
    return Answer(
        {"archive": output.name, "runs": [*done, *refused]},
        lambda: (
            emit_table(f"{output.name}: {len(done)} runs", *table(Archived, done, *ARCHIVE_COLUMNS)) if done else None
        ),
        refused=refused,
    )


def _run_table(runs: "Sequence[Run]", states: Mapping[str, str]) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the table of runs."""
    from ..recording import payload_text, peak_text

    columns: dict[str, Callable[[Run], str]] = {
        "run": lambda run: run.name,
        "origin": lambda run: run.origin,
        "payload": lambda run: payload_text(run.conditions) or "-",
        "counter-masses kg": lambda run: _masses(run.conditions.get("counter_masses")),
        "motion": lambda run: run.conditions.get("motion", "-"),
        "peak": lambda run: peak_text(run.conditions) or "-",
        "repeat": lambda run: str(run.conditions.get("repeat", "-")),
        "start": lambda run: "-" if run.start_time is None else run.start_time.time,
        "samples": lambda run: ", ".join(str(group.samples) for group in run.groups),
        "findings": lambda run: str(sum(finding.severity > 0 for finding in run.findings)),
    }
    if any(states.values()):
        columns["log"] = lambda run: states[run.path.name] or "-"
    return list(columns), [[cell(run) for cell in columns.values()] for run in runs]


def _masses(masses: dict[str, float] | None) -> str:
    return "-" if masses is None else ", ".join(f"{site} {mass:g}" for site, mass in masses.items()) or "none"


@command(
    "list",
    epilog="""\b
Examples:
  testbench list campaign
  testbench list campaign --json
\b
Exit codes: 0 done, 1 some run cannot be opened (the others are listed).""",
)
def list_runs(campaign: Path = argument()) -> Answer:
    """The runs of a campaign, with the conditions of each."""
    from ..store import open_campaign
    from ..store.campaign import CONTINUES
    from ..store.ledger import read_ledger

    runs, refused = options.openable_runs(open_campaign(campaign).run_paths)
    ledger = read_ledger(campaign)
    lacking = [finding.message for finding in ledger.lacking]
    # Of each run whether its log has grown since: ``incomplete``, or ``superseded by`` its next version.
    found = {run.path.name: "" for run in runs} | dict.fromkeys(ledger.grown, "incomplete")
    later = {run.provenance[CONTINUES]: run.name for run in runs if CONTINUES in run.provenance}
    states = found | {file: f"superseded by {name}" for file, name in later.items()}
    described = [document(run) | ({"log": states[run.path.name]} if states[run.path.name] else {}) for run in runs]
    return Answer(
        {"campaign": campaign.resolve().name, "runs": [*described, *refused], "not_stored": lacking},
        lambda: emit_table(f"{campaign.resolve().name}: {len(runs)} runs", *_run_table(runs, states)),
        findings=lacking,
        refused=refused,
    )


@command(
    epilog="""\b
Examples:
  testbench recover campaign
  testbench recover campaign --json
\b
Exit codes: 0 nothing to do, or nothing was lost; 3 recovered, with the losses that are listed;
1 something could not be saved."""
)
def recover(campaign: Path = argument()) -> Answer:
    """Save what ingests had acknowledged before they were stopped.

    It becomes a run of its own, NAME.recovered, which says what is lost; no stored run is touched. If the log is
    still at hand, ingest it again: then nothing is lost at all, and `testbench analyze` leaves NAME.recovered out.
    """
    from ..ingestion.recovered_runs import recover as save
    from ..store.crash_recovery import Recovery

    found, name = save(campaign), campaign.resolve().name

    def show() -> None:
        if found:
            title = f"{name}: {len(found)} left by stopped ingests"
            emit_table(title, *table(Recovery, found, "run", "status", "file", "message"))
        else:
            say(f"{plain_text(name)}: 0 ingests were stopped; nothing to do")

    states = {one.status for one in found}
    code = EXIT_REFUSED if states & {"failed", "empty"} else 0
    return Answer({"campaign": name, "recovered": found}, show, "recovered" in states, code=code)


@command(
    epilog="""\b
Examples:
  testbench verify campaign
  testbench verify campaign --json
\b
Exit codes: 0 every run is intact, 1 a run or record, or the ledger, is damaged or missing, 3 there are files that are
no runs or not in the ledger."""
)
def verify(campaign: Path = argument()) -> Answer:
    """Check every stored run, to the bit, against the digest that was written beside it; and the later records.

    Against the ledger it finds what is missing, exchanged, or there without having been entered.
    """
    from ..store import Campaign, open_campaign
    from ..store.campaign import FileState, existing
    from ..store.ledger import FILE

    opened = Campaign(existing(campaign)) if (campaign / FILE).exists() else open_campaign(campaign)
    with progress("verifying", sum(path.stat().st_size for path in opened.run_paths if path.is_file())) as done:
        files = list({file.name: file for file in (*opened.verify(done), *_records(campaign))}.values())
    name, counts = campaign.resolve().name, Counter(file.status for file in files)

    def show() -> None:
        say(f"{name}: {', '.join(f'{n} files {status}' for status, n in counts.items())}.")
        emit_table("Files", *table(FileState, files))

    code = EXIT_REFUSED if counts.keys() & {"damaged", "missing"} else 0
    return Answer({"campaign": name, "files": files}, show, bool(counts.keys() - {"intact", "absent"}), code=code)


def _records(campaign: Path) -> "list[FileState]":
    """The records that cannot be used, which analyses refuse as well; and the files that no analysis looks at."""
    from ..errors import StoreError
    from ..runs import calibration_history
    from ..store import append_only_records
    from ..store.campaign import FileState

    try:
        if found := append_only_records.damaged(campaign):
            return [
                FileState(f"{append_only_records.FOLDER}/{name}", "damaged", message) for name, message in found.items()
            ]
        calibration_history.read_calibrations(campaign)
    except StoreError as error:
        return [FileState(append_only_records.FOLDER, "damaged", str(error))]
    message = "no record by its name: nobody reads it; what it says does not hold"
    return [
        FileState(f"{append_only_records.FOLDER}/{name}", "extra", message)
        for name in append_only_records.others(campaign)
    ]


@command(
    epilog="""\b
Examples:
  testbench ledger campaign
  testbench ledger campaign --json
\b
The head is the SHA-256 of the last entry, which holds that of the entry before: noted elsewhere it shows whether
anything up to it was changed since. It is a plain digest and no signature.
Exit codes: 0 done, 1 the ledger was changed."""
)
def ledger(campaign: Path = argument()) -> Answer:
    """What was entered into a campaign, in this order: runs, records, removals; and the head."""
    from ..store.campaign import existing
    from ..store.ledger import Entry, read_ledger

    found = read_ledger(existing(campaign))
    name = campaign.resolve().name

    def show() -> None:
        if found.head is None:
            say(f"{plain_text(name)}: no ledger; the next run or record that is stored begins one")
        else:
            emit_table(f"{name}: {len(found.entries)} entries", *table(Entry, found.entries), f"head {found.head}")

    return Answer({"campaign": name, "head": found.head, "entries": found.entries}, show)


@command(
    epilog="""\b
Examples:
  testbench remove campaign/r001.h5 --by "A. Kaya" --reason "the wrong rig"
  testbench remove campaign/records/*-calibration-0a1b2c3d.json --by "A. Kaya" --reason "a typing error"
\b
A file that is gone already may be named too: then its absence is accounted for.
Exit codes: 0 done, 1 some file was neither there nor in the ledger (the others are removed)."""
)
def remove(
    files: tuple[Path, ...] = argument("RUN|RECORD...", required=True),
    by: str = option("Who removes it.", required=True, metavar="NAME"),
    reason: str = option("Why.", required=True, metavar="TEXT"),
) -> Answer:
    """Take runs or records out of a campaign. The ledger keeps what they were, by whom and why they were removed."""
    from ..errors import StoreError
    from ..store import append_only_records
    from ..store.campaign import existing
    from ..store.ledger import remove as take_out

    by, reason = options.one_line("--by", by), options.one_line("--reason", reason)
    if not by or not reason:
        raise click.UsageError("--by and --reason: expected a text; a removal is recorded with who made it and why")
    removed, failed = [], []
    for path in files:
        in_records = path.parent.name == append_only_records.FOLDER
        folder = path.parent.parent if in_records else path.parent
        try:
            name = f"{path.parent.name}/{path.name}" if in_records else path.name
            removed.append(take_out(existing(folder), name, by, reason))
        except StoreError as error:
            failed.append(str(error))

    def show() -> None:
        for entry in removed:
            say(f"{plain_text(entry.file)}: removed, entry {entry.number} of the ledger")

    return Answer({"removed": removed, "refused": failed}, show, refused=failed)
