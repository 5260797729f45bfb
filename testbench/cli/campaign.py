"""Commands on a campaign of stored runs: ``testbench list``, ``verify``, ``recover``, ``archive`` and ``export``."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.framework import EXIT_REFUSED, EXIT_WITH_FINDINGS, emit_json, emit_table, json_option

from . import options
from .options import plain_text, progress

if TYPE_CHECKING:
    from ..export import Exported
    from ..store import Run
    from ..store.archive import Archived
    from ..store.campaign import FileState

TARGETS = ("csv", "parquet", "mat", "uff", "sep005", "ro-crate")


@click.command(
    epilog="""\b
Examples:
  testbench export campaign/r001.h5 --to csv -o tables
  testbench export campaign --to parquet -o tables --physical
  testbench export campaign --to ro-crate --licence CC-BY-4.0 -o crate
\b
SEP005 defines objects in memory and no file: testbench.export.columns(testbench.open_run("r001.h5"))
Exit codes: 0 done, 3 done with losses, which are listed, 1 some run was refused (the others are exported)."""
)
@click.argument("stored", metavar="RUN|CAMPAIGN", type=click.Path(path_type=Path))
@click.option("--to", required=True, type=click.Choice(TARGETS), help="The form to write.")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="The folder to write into.")
@click.option("--licence", metavar="NAME|URL", help="Licence of the runs, such as CC-BY-4.0: for ro-crate.")
@click.option("--physical", is_flag=True, help="Values in SI, by the calibration that holds, and not as recorded.")
@json_option
def export(stored: Path, to: str, output: Path, licence: str | None, physical: bool, as_json: bool) -> int:
    """Write stored runs in another form: values as recorded, with units, time and provenance. Overwrites nothing."""
    if to == "sep005":
        raise click.UsageError("SEP005 defines no file: use testbench.export.columns(run) in Python")
    if licence and to != "ro-crate":
        raise click.UsageError("--licence is for --to ro-crate")
    if physical and to == "ro-crate":
        raise click.UsageError("a crate holds the runs as they are stored: --physical is for the other forms")
    runs: list[Run]
    refused: list[options.NotOpened] = []
    if to == "ro-crate":  # a crate describes a whole campaign, so that it takes all of it or nothing
        runs = options.opened_runs([stored])
        written = _crate(stored, runs, output, licence)
    else:
        runs, refused = options.openable_runs([stored])
        written, failed = _files(runs, to, output, physical)
        refused += failed
    applied = options.applied_calibrations(runs) if physical else []
    losses = [loss for one in written for loss in one.losses]
    if as_json:
        files = [{"file": str(one.file), "losses": list(one.losses)} for one in written]
        document = {"to": to, "files": files, "physical": physical}
        calibrations = [one.as_dict() for one in applied]
        emit_json({**document, "calibrations": calibrations, "refused": [one.as_dict() for one in refused]})
    else:
        for one in written:
            click.echo(plain_text(str(one.file)))
        for loss in losses:
            click.echo(f"  lost: {plain_text(loss)}")
        options.print_applied_calibrations(applied)
    options.print_not_opened(refused)
    if refused:
        return EXIT_REFUSED
    return EXIT_WITH_FINDINGS if losses else 0


def _files(
    runs: "Sequence[Run]", to: str, output: Path, physical: bool
) -> "tuple[list[Exported], list[options.NotOpened]]":
    """What was written, and the runs that were refused with the reason."""
    from balance.errors import CounterpoiseError

    from ..export import export as write
    from ..runs.si_run import physical as in_si

    written, refused = [], []
    with progress("exporting", sum(run.path.stat().st_size for run in runs)) as done:
        for run in runs:
            try:
                written += write(in_si(run) if physical else run, to, output)
            except CounterpoiseError as error:
                refused.append(options.NotOpened(run.name, str(error)))
            done(run.path.stat().st_size)
    return written, refused


def _crate(stored: Path, runs: "Sequence[Run]", output: Path, licence: str | None) -> "list[Exported]":
    from ..export import ro_crate
    from ..store import Campaign

    folder = stored if stored.is_dir() else stored.parent
    return [ro_crate.export_crate(Campaign(folder), list(runs), output, licence)]


@click.command(
    epilog="""\b
Examples:
  testbench archive campaign -o archive
  testbench archive campaign/r001.h5 campaign/r002.h5 -o archive --json
\b
A command of its own and no option of ingest: a run is small enough to keep once the tests are over, and is then read
a little more slowly. The archive is a campaign like any other: verify, list, analyze, export read it as it is. An
archived run names the SHA-256 of the run that it was made of; the originals are left where they are.
Exit codes: 0 done, 1 some run was refused (the others are archived)."""
)
@click.argument("stored", nargs=-1, required=True, metavar="RUN|CAMPAIGN...", type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="The folder of the archive.")
@json_option
def archive(stored: tuple[Path, ...], output: Path, as_json: bool) -> int:
    """Store runs anew, small, and the same to the bit. Overwrites nothing; needs no HDF5 plugin to be read.

    Numbers of fixed decimals are kept as whole numbers, others as they are; both are compressed. Each channel is read
    back and compared before a run has its name.
    """
    from ..store import append_only_records

    runs, unopened = options.openable_runs(stored)
    for folder in dict.fromkeys(run.path.parent for run in runs):
        append_only_records.read_records(
            folder
        )  # an archive without its records would be calibrated otherwise: none is made then
    done, refused = _archived(runs, output)
    refused = [*(one.as_dict() for one in unopened), *refused]
    for folder in dict.fromkeys(run.path.parent for run in runs):
        if done:
            append_only_records.copy(folder, output)
    if as_json:
        emit_json({"archive": output.name, "runs": [*map(_document, done), *refused]})
    else:
        emit_table(f"{plain_text(output.name)}: {len(done)} runs", ARCHIVE_HEADER, [_row(one) for one in done])
        for one in refused:
            click.echo(f"testbench: {plain_text(one['message'])}", err=True)
    return EXIT_REFUSED if refused else 0


ARCHIVE_HEADER = ["run", "status", "float64 MB", "archive MB", "ratio", "whole numbers", "channels"]


def _archived(runs: "Sequence[Run]", output: Path) -> "tuple[list[Archived], list[dict[str, Any]]]":
    """What was archived, and what was refused with the reason."""
    from ..errors import StoreError
    from ..store.archive import archive as make

    done, refused = [], []
    total = sum(8 * len(group.channels) * group.samples for run in runs for group in run.groups)
    with progress("archiving", total) as advance:
        for run in runs:
            try:
                done.append(make(run, output, advance))
            except StoreError as error:
                refused.append({"run": run.name, "status": "refused", "message": str(error)})
    return done, refused


def _document(one: "Archived") -> dict[str, Any]:
    return {
        "run": one.file.stem,
        "status": one.status,
        "file": one.file.name,
        "sha256_of_original": one.sha256_of_original,
        "float64_bytes": one.float64_bytes,
        "sample_bytes": one.sample_bytes,
        "file_bytes": one.file_bytes,
        "ratio": one.ratio,
        "channels": one.channels,
        "channels_of_whole_numbers": one.whole_numbers,
    }


def _row(one: "Archived") -> list[str]:
    sizes = f"{one.float64_bytes / 1e6:.1f}", f"{one.sample_bytes / 1e6:.1f}", f"{one.ratio:.3f}"
    return [plain_text(one.file.stem), one.status, *sizes, str(one.whole_numbers), str(one.channels)]


RUN_HEADER = ["run", "origin", "payload kg", "counter-masses kg", "motion", "peak g0", "repeat", "samples", "findings"]


def run_document(run: "Run") -> dict[str, Any]:
    """The run without its data."""
    return {
        "run": run.name,
        "file": run.path.name,
        "origin": run.origin,
        "conditions": dict(run.conditions),
        "sources": [source["name"] for source in run.provenance["sources"]],
        "groups": [
            {"name": g.name, "samples": g.samples, "rate_hz": g.rate_hz, "rate_source": g.rate_source,
             "channels": [{"name": c.name, "unit": c.unit} for c in g.channels]}
            for g in run.groups
        ],
        "findings": [finding.as_dict() for finding in run.findings],
    }  # fmt: skip


def run_row(run: "Run") -> list[str]:
    """The run under :data:`HEADER`."""
    conditions = run.conditions
    masses = conditions.get("counter_masses")
    return [
        plain_text(run.name),
        run.origin,
        f"{conditions['payload_kg']:g}" if "payload_kg" in conditions else "-",
        "-" if masses is None else ", ".join(f"{plain_text(s)} {m:g}" for s, m in masses.items()) or "none",
        plain_text(conditions.get("motion", "-")),
        f"{conditions['peak_acceleration_g']:g}" if "peak_acceleration_g" in conditions else "-",
        str(conditions.get("repeat", "-")),
        ", ".join(str(group.samples) for group in run.groups),
        str(sum(finding.severity > 0 for finding in run.findings)),
    ]


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
def list_runs(campaign: Path, as_json: bool) -> int:
    """The runs of a campaign, with the conditions of each."""
    from ..store import open_campaign

    runs, refused = options.openable_runs(open_campaign(campaign).run_paths)
    if as_json:
        documents = [*map(run_document, runs), *(one.as_dict() for one in refused)]
        emit_json({"campaign": campaign.resolve().name, "runs": documents})
    else:
        emit_table(
            f"{plain_text(campaign.resolve().name)}: {len(runs)} runs", RUN_HEADER, [run_row(run) for run in runs]
        )
    options.print_not_opened(refused)
    return EXIT_REFUSED if refused else 0


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
    from ..ingest.recovered_runs import recover as save

    found = save(campaign)
    if as_json:
        emit_json({"campaign": campaign.resolve().name, "recovered": [one.as_dict() for one in found]})
    elif found:
        rows = [
            [plain_text(one.run), one.status, plain_text(one.file or "-"), plain_text(one.message)] for one in found
        ]
        emit_table(
            f"{plain_text(campaign.resolve().name)}: {len(found)} left by stopped ingests",
            ["run", "status", "file", "what"],
            rows,
        )
    else:
        click.echo(f"{plain_text(campaign.resolve().name)}: no ingest was stopped; nothing to do")
    states = {one.status for one in found}
    if states & {"failed", "empty"}:
        return EXIT_REFUSED
    return EXIT_WITH_FINDINGS if "recovered" in states else 0


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
        rows = [[plain_text(file.name), file.status, plain_text(file.message)] for file in files]
        emit_table(f"{plain_text(campaign.resolve().name)}: {len(files)} files", ["file", "status", "what"], rows)
    states = {file.status for file in files}
    if states & {"damaged", "missing"}:
        return EXIT_REFUSED
    return EXIT_WITH_FINDINGS if states - {"intact"} else 0


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
