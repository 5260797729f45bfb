"""``testbench export``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.console import EXIT_WITH_FINDINGS, emit_json, json_option

from . import calibrations
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
Exit codes: 0 done, 3 done with losses, which are listed, 1 refused."""
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
    written = _crate(stored, output, licence) if to == "ro-crate" else _files(stored, to, output, physical)
    applied = calibrations.held(_runs(stored)) if physical else []
    losses = [loss for one in written for loss in one.losses]
    if as_json:
        files = [{"file": str(one.file), "losses": list(one.losses)} for one in written]
        emit_json({"to": to, "files": files, "physical": physical, "calibrations": [h.as_dict() for h in applied]})
    else:
        for one in written:
            click.echo(plain(str(one.file)))
        for loss in losses:
            click.echo(f"  lost: {plain(loss)}")
        calibrations.say(applied)
    return EXIT_WITH_FINDINGS if losses else 0


def _files(stored: Path, to: str, output: Path, physical: bool) -> "list[Exported]":
    from ..calibration.view import physical as in_si
    from ..export import export as write

    runs = _runs(stored)
    written = []
    with progress("exporting", sum(run.path.stat().st_size for run in runs)) as done:
        for run in runs:
            written += write(in_si(run) if physical else run, to, output)
            done(run.path.stat().st_size)
    return written


def _crate(stored: Path, output: Path, licence: str | None) -> "list[Exported]":
    from ..export import ro_crate
    from ..store import Campaign

    folder = stored if stored.is_dir() else stored.parent
    return [ro_crate.write(Campaign(folder), _runs(stored), output, licence)]


def _runs(stored: Path) -> "list[Run]":
    from ..store import open_campaign, open_run

    return list(open_campaign(stored).runs) if stored.is_dir() else [open_run(stored)]
