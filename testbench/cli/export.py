"""``testbench export``."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.console import EXIT_REFUSED, EXIT_WITH_FINDINGS, emit_json, json_option

from . import calibrations, stored_runs
from .progress import progress
from .reading import plain

if TYPE_CHECKING:
    from ..export import Exported
    from ..store import Run

TARGETS = ("csv", "parquet", "mat", "uff", "sep005", "ro-crate")


@click.command(
    epilog="""\b
Examples:
  testbench export campaign/r001.h5 --to csv -o tables
  testbench export campaign --to parquet -o tables --physical
  testbench export campaign --to ro-crate --licence CC-BY-4.0 -o crate
\b
SEP005 defines objects in memory and no file: testbench.export.sep005(testbench.open_run("r001.h5"))
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
        raise click.UsageError("SEP005 defines no file: use testbench.export.sep005(run) in Python")
    if licence and to != "ro-crate":
        raise click.UsageError("--licence is for --to ro-crate")
    if physical and to == "ro-crate":
        raise click.UsageError("a crate holds the runs as they are stored: --physical is for the other forms")
    runs: list[Run]
    refused: list[stored_runs.NotOpened] = []
    if to == "ro-crate":  # a crate describes a whole campaign, so that it takes all of it or nothing
        runs = stored_runs.opened([stored])
        written = _crate(stored, runs, output, licence)
    else:
        runs, refused = stored_runs.each([stored])
        written, failed = _files(runs, to, output, physical)
        refused += failed
    applied = calibrations.in_force(runs) if physical else []
    losses = [loss for one in written for loss in one.losses]
    if as_json:
        files = [{"file": str(one.file), "losses": list(one.losses)} for one in written]
        held = [h.as_dict() for h in applied]
        said = [one.as_dict() for one in refused]
        emit_json({"to": to, "files": files, "physical": physical, "calibrations": held, "refused": said})
    else:
        for one in written:
            click.echo(plain(str(one.file)))
        for loss in losses:
            click.echo(f"  lost: {plain(loss)}")
        calibrations.say_each(applied)
    stored_runs.say(refused)
    if refused:
        return EXIT_REFUSED
    return EXIT_WITH_FINDINGS if losses else 0


def _files(
    runs: "Sequence[Run]", to: str, output: Path, physical: bool
) -> "tuple[list[Exported], list[stored_runs.NotOpened]]":
    """What was written, and the runs that were refused with the reason."""
    from balance.errors import CounterpoiseError

    from ..export import export as write
    from ..runs.physical_run import physical as in_si

    written, refused = [], []
    with progress("exporting", sum(run.path.stat().st_size for run in runs)) as done:
        for run in runs:
            try:
                written += write(in_si(run) if physical else run, to, output)
            except CounterpoiseError as error:
                refused.append(stored_runs.NotOpened(run.name, str(error)))
            done(run.path.stat().st_size)
    return written, refused


def _crate(stored: Path, runs: "Sequence[Run]", output: Path, licence: str | None) -> "list[Exported]":
    from ..export import ro_crate
    from ..store import Campaign

    folder = stored if stored.is_dir() else stored.parent
    return [ro_crate.write(Campaign(folder), list(runs), output, licence)]
