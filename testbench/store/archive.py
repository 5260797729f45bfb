"""A stored run made small, losing nothing: the archive.

Channels of fixed decimals become whole numbers, all others stay float64; both are compressed by HDF5's own filters, so
that every HDF5 tool reads them. The archived run says of which run it was made, by SHA-256 of the file and of each
channel's values, and is committed only if it gives back the same bits.
"""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from balance.results import Key

from ..errors import StoreError
from ..recording import Group, Samples
from . import atomic_files, encodings, safe_hdf5
from .run import ARCHIVED_FROM, Run, StoredGroup, identities, open_run
from .writer import RunWriter

if TYPE_CHECKING:
    import h5py

INTENT = "archive_of"
"""Key of what an unfinished archive says of itself."""
AT_ONCE = 1 << 20
"""Samples of a channel that are in memory at once."""
Progress = Callable[[int], None]


def _megabytes(count: int) -> str:
    return f"{count / 1e6:.1f}"


@dataclass(frozen=True)
class Archived:
    """A run that was ``archived``, or ``already_archived``: what it takes, and what its values take as float64."""

    file: Annotated[Path, Key(to=lambda path: path.name)]
    status: Annotated[str, Key("", "status")]
    sha256_of_original: Annotated[str, Key()]
    float64_bytes: Annotated[int, Key("", "float64 MB", _megabytes)]
    sample_bytes: Annotated[int, Key("", "archive MB", _megabytes)]
    file_bytes: Annotated[int, Key()]
    channels: Annotated[int, Key("", "channels")]
    whole_numbers: Annotated[int, Key("channels_of_whole_numbers", "whole numbers")]
    """Channels that became whole numbers of decimals; the others are compressed float64."""

    @property
    def run(self) -> Annotated[str, Key("", "run")]:
        """Name of the run."""
        return self.file.stem

    @property
    def ratio(self) -> Annotated[float, Key("", "ratio", ".3f")]:
        """Size of the samples over their size as float64."""
        return self.sample_bytes / self.float64_bytes if self.float64_bytes else 1.0


def archive(run: Run, folder: Path, progress: Progress = lambda count: None) -> Archived:
    """Store ``run`` in ``folder`` as an archive. Raises StoreError if it is damaged, or an archive already."""
    if ARCHIVED_FROM in run.provenance:
        raise StoreError(f"{run.path.name}: is an archive already, of {run.provenance[ARCHIVED_FROM]['file']}")
    original = atomic_files.recorded_digest(run.path)
    if atomic_files.sha256_of(run.path) != original:
        raise StoreError(f"{run.path.name}: is not what was stored, see `testbench verify`; it was not archived")
    there = folder / run.path.name
    if there.exists() and original in identities(there):
        if there.samefile(run.path):
            raise StoreError(f"{folder}: holds the run itself; name another folder for the archive")
        return _measured(open_run(there), original, "already_archived")
    with safe_hdf5.open_for_reading(run.path) as file, RunWriter(folder, run.name, {INTENT: run.path.name}) as writer:
        content = {}
        for group in run.groups:
            forms, content[group.name] = list[encodings.Form](), list[str]()
            for index in range(len(group.channels)):
                search, total = encodings.Search(), hashlib.sha256()
                for values in _channel(file, group, index):
                    search.update(values)
                    total.update(values.tobytes())
                    progress(values.nbytes)
                forms.append(search.result())
                content[group.name].append(total.hexdigest())
            to = writer.group(Group(group.name, group.channels, group.clock, group.zero), forms)
            for columns in zip(*(_channel(file, group, i) for i in range(len(group.channels))), strict=True):
                to.append(columns)
            to.finish(group.rate_hz, group.rate_source, group.start_time)
        known = {"file": run.path.name, "sha256": original, "channels_sha256": content}
        known |= {"written": datetime.now(UTC).isoformat(timespec="seconds"), "counterpoise": version("counterpoise")}
        provenance = {**run.provenance, ARCHIVED_FROM: known}
        writer.describe(run.origin, run.conditions, run.findings, provenance, run.rig, run.inputs)
        writer.seal()
        _check(writer.part, run)
        return _measured(open_run(writer.commit()), original, "archived")


def _measured(run: Run, original: str, status: str) -> Archived:
    channels = [(group, i) for group in run.groups for i in range(len(group.channels))]
    with safe_hdf5.open_for_reading(run.path) as file:
        places = (path for group, i in channels for path in group.places(i))
        size = sum(int(safe_hdf5.member(file, path).id.get_storage_size()) for path in places)
    values = sum(8 * group.samples for group, _ in channels)
    whole = sum(group.whole[i] is not None for group, i in channels)
    return Archived(run.path, status, original, values, size, run.path.stat().st_size, len(channels), whole)


def _channel(file: "h5py.File", group: StoredGroup, index: int) -> Iterator[Samples]:
    for begin in range(0, group.samples, AT_ONCE):
        yield group.samples_of(file, index, begin, min(begin + AT_ONCE, group.samples))


def _check(part: Path, run: Run) -> None:
    """Raise StoreError unless what was written gives back the same bits, by their digests."""
    stored = open_run(part)
    with safe_hdf5.open_for_reading(part) as file:
        for group in stored.groups:
            for index, channel in enumerate(group.channels):
                try:
                    for _ in _channel(file, group, index):
                        pass
                except StoreError as error:
                    message = f"{run.path.name}: channel {channel.name!r} does not come back to the bit; not archived"
                    raise StoreError(message) from error
