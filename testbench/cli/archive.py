"""``testbench archive``."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.console import EXIT_REFUSED, emit_json, emit_table, json_option

from . import stored_runs
from .progress import progress
from .reading import plain

if TYPE_CHECKING:
    from ..store import Run
    from ..store.archive import Archived


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
    from ..store import records

    runs, unopened = stored_runs.each(stored)
    for folder in dict.fromkeys(run.path.parent for run in runs):
        records.read(folder)  # an archive without its records would be calibrated otherwise: none is made then
    done, refused = _archived(runs, output)
    refused = [*(one.as_dict() for one in unopened), *refused]
    for folder in dict.fromkeys(run.path.parent for run in runs):
        if done:
            records.copy(folder, output)
    if as_json:
        emit_json({"archive": output.name, "runs": [*map(_document, done), *refused]})
    else:
        emit_table(f"{plain(output.name)}: {len(done)} runs", HEADER, [_row(one) for one in done])
        for one in refused:
            click.echo(f"testbench: {plain(one['message'])}", err=True)
    return EXIT_REFUSED if refused else 0


HEADER = ["run", "status", "float64 MB", "archive MB", "ratio", "whole numbers", "channels"]


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
    return [plain(one.file.stem), one.status, *sizes, str(one.whole_numbers), str(one.channels)]
