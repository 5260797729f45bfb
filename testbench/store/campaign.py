"""A campaign: a folder of stored runs, each with its digest file; which recordings it holds, by size and SHA-256."""

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from balance.results import Key, Shown, frame
from balance.task_pool import cores

from ..errors import StoreError
from . import atomic_files, ledger
from .atomic_files import leftovers, unfinished
from .run import Run, open_run

if TYPE_CHECKING:
    import pandas

SUFFIX = ".h5"
CONTINUES = "continues"
"""Key of the provenance: the run whose logs, grown since, this run holds whole."""
CRATE = "ro-crate-metadata.json"
"""The description of a crate, which holds copies and quotes the head of the ledger."""
SUMS = "SHA256SUMS"
"""Digests of all files of a crate, for ``sha256sum -c``: what its author signs, with a tool of their choice."""
KEPT = frozenset(
    {"records", CRATE, SUMS, f"{SUMS}.minisig", f"{SUMS}.sig", f"{SUMS}.asc", ledger.FILE, atomic_files.LOCK}
)
"""What else belongs into a campaign: later records, the ledger, the lock, and what describes and signs a crate."""


WITHOUT_DIGESTS = (
    "stored before samples had digests: a hole, or a chunk in the place of another, is found by verify alone, not when "
    "it is read; `testbench archive` gives its copy digests"
)


@dataclass(frozen=True)
class FileState:
    """What :meth:`Campaign.verify` found of a file.

    ``intact``, ``damaged``, ``missing``, ``unfinished``, ``extra`` (no run), ``added`` (not in the ledger), or of the
    ledger ``absent``, where a campaign was stored before there was one.
    """

    name: Annotated[str, Key("", "file")]
    status: Annotated[str, Key("", "status")]
    message: Annotated[str, Key("", "what")] = ""


class NoSuchRun(StoreError, KeyError):
    """A name that no run of a campaign has."""

    __str__ = Exception.__str__


@dataclass(frozen=True)
class Campaign(Mapping[str, Run], Shown):
    """A folder of runs, by their names.

    >>> import testbench
    >>> campaign = testbench.open_campaign("campaign")
    >>> list(campaign), campaign["r001"].origin
    (['r001', 'r002'], 'simulated')
    """

    path: Path

    def __getitem__(self, name: str) -> Run:
        """The run of this name. Raises KeyError, a StoreError too, with the names that there are."""
        if name not in set(self):
            near = get_close_matches(name, self, n=1)
            raise NoSuchRun(
                f"{self.path}: no run {name!r}{f'; did you mean {near[0]!r}?' if near else ''}: there are "
                f"{', '.join(self)}"
            )
        return open_run(self.path / f"{name}{SUFFIX}")

    def __iter__(self) -> Iterator[str]:
        return (path.stem for path in self.run_paths)

    def __len__(self) -> int:
        return len(self.run_paths)

    def table(self) -> "pandas.DataFrame":
        """The runs with their conditions, a row each; counter-masses and payloads by site or body [kg]."""
        found = frame({"run": run.name, "origin": run.origin, **run.conditions} for run in self.runs)
        found.attrs["units"] |= {
            name: "kg" for name in map(str, found) if name.startswith(("counter_masses.", "payloads."))
        }
        return found

    @property
    def run_paths(self) -> list[Path]:
        """The files of the stored runs, by name."""
        return sorted(p for p in self.path.glob(f"*{SUFFIX}") if not p.name.startswith("."))

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """The stored runs, by name; their data are read when asked for. Of a log that grew, its newest version."""
        paths = self.run_paths
        return tuple(newest_versions(cores(len(paths)).map(open_run, paths, imports=True)))

    def verify(self, progress: Callable[[int], None] = lambda count: None) -> list[FileState]:
        """The state of every file in the folder: of runs by their digests, of others that they are there.

        By the ledger it knows what should be there too.
        """
        states = [_state_of(path, progress) for path in self.run_paths]
        known = {path.name for path in self.run_paths} | {
            atomic_files.digest_file(path).name for path in self.run_paths
        }
        for leftover in leftovers(self.path):
            is_running = atomic_files.is_locked(leftover.journal)
            message = (
                "an ingest is writing it at this moment"
                if is_running
                else ("left by an ingest that was stopped; no run of it: `testbench recover` saves what is in it")
            )
            states.append(FileState(leftover.part.name, "unfinished", message))
            known |= {leftover.part.name, leftover.journal.name}
        for path in sorted(self.path.iterdir()):
            if path.name in known | KEPT:
                continue
            if path.name.endswith(SUFFIX + atomic_files.SUFFIX) and not path.name.startswith("."):
                name = path.name.removesuffix(atomic_files.SUFFIX)
                states.append(FileState(name, "missing", "its digest is there, the run is not"))
            elif unfinished(path) is not None:
                message = "left by an ingest that was stopped; no run of it"
                states.append(FileState(path.name, "unfinished", message))
            else:
                states.append(FileState(path.name, "extra", "no stored run"))
        found = {state.name: state for state in states}
        entered = not (self.path / CRATE).exists() and any(_unproven(path) == "" for path in self.run_paths)
        for name, status, message in ledger.cross_check(self.path, entered):
            if name not in found or found[name].status == "intact":
                found[name] = FileState(name, status, message)
        return list(found.values())


def newest_versions(runs: Sequence[Run]) -> list[Run]:
    """The runs without those whose log another one of them continues, which holds all that they hold."""
    continued = {(run.path.parent, run.provenance.get(CONTINUES)) for run in runs}
    return [run for run in runs if (run.path.parent, run.path.name) not in continued]


def existing(folder: str | Path) -> Path:
    """The folder of a campaign. Raises StoreError if it is not there, or no folder."""
    path = Path(folder)
    if not path.is_dir():
        what = "is a file" if path.exists() else "no such folder"
        raise StoreError(f"{path}: {what}; expected a campaign's folder, as `testbench ingest -o` makes it")
    return path


def open_campaign(folder: str | Path) -> Campaign:
    """Open the campaign in ``folder``. Raises StoreError where there is none.

    >>> import testbench
    >>> testbench.open_campaign("campaign").table()[["run", "motion"]].values.tolist()
    [['r001', 'x'], ['r002', 'x']]
    """
    path = existing(folder)
    campaign = Campaign(path)
    if not campaign.run_paths and not any(path.glob(f"*{SUFFIX}{atomic_files.SUFFIX}")):
        stopped = leftovers(path)
        if any(atomic_files.is_locked(one.journal) for one in stopped):
            what = " yet; an ingest is writing into it at this moment"
        elif stopped:
            what = f", only what a stopped ingest left: `testbench recover {path}` saves what is in it"
        else:
            what = f"; `testbench ingest FILE... -o {path}` puts some there"
        raise StoreError(f"{path}: holds no run (*{SUFFIX}){what}")
    return campaign


def _state_of(run: Path, progress: Callable[[int], None]) -> FileState:
    """Whether the bytes of a run are those that were written."""
    if not run.is_file():
        return FileState(run.name, "damaged", "no file: a folder, a link that leads nowhere, or a device")
    try:
        expected = atomic_files.recorded_digest(run)
        found = atomic_files.sha256_of(run, progress)
    except StoreError as error:
        return FileState(run.name, "damaged", str(error))
    except OSError as error:
        return FileState(run.name, "damaged", f"cannot be read ({error.strerror or error})")
    if found == expected:
        return FileState(run.name, "intact", _unproven(run))
    message = f"its content changed: SHA-256 {found[:12]}..., when written {expected[:12]}...; {_what_changed(run)}"
    return FileState(run.name, "damaged", message)


def _unproven(path: Path) -> str:
    """What reading a run of the right bytes cannot prove, for want of digests or since it cannot be opened."""
    try:
        return "" if all(group.digests is not None for group in open_run(path).groups) else WITHOUT_DIGESTS
    except StoreError as error:
        return f"its bytes are those that were written, but it cannot be opened: {error}"


def _what_changed(path: Path) -> str:
    """What reading finds of the damage; never an error."""
    try:
        run = open_run(path)
        for group in run.groups:
            for index in range(len(group.channels)):
                run.channel_at(group.name, index)
    except StoreError as error:
        return str(error).removeprefix(f"{path.name}: ")
    return "reading it finds nothing"


@dataclass
class StoredSources:
    """The sources of the runs in ``folder``, as of the last :meth:`look`; runs are opened once."""

    folder: Path
    unopened: dict[str, str] = field(default_factory=dict, init=False)
    """Runs that cannot be opened, and why: what they hold is not known."""
    _runs: dict[tuple[int, str], str] = field(default_factory=dict, init=False)
    _named: dict[str, list[tuple[int, str, str]]] = field(default_factory=dict, init=False)
    """Size, digest and run of each source, by its name; the versions of a run in their order."""
    _continues: dict[str, str] = field(default_factory=dict, init=False)
    """The file that a run continues, by its own."""
    _known: set[Path] = field(default_factory=set, init=False)

    def look(self) -> None:
        """Take in the runs that came since last, and try again those that could not be opened."""
        self.unopened.clear()
        for path in sorted(Campaign(self.folder).run_paths, key=lambda path: (len(path.name), path.name)):
            if path in self._known:
                continue
            try:
                provenance = open_run(path).provenance
                sources = provenance["sources"]
                for source in sources:
                    content = source["size_bytes"], source["sha256"]
                    self._runs[content] = path.name
                    self._named.setdefault(source["name"], []).append((*content, path.name))
            except (StoreError, LookupError, TypeError) as error:
                self.unopened[path.name] = str(error).replace(f"{self.folder}{os.sep}", "")
            else:
                self._known.add(path)
                if before := provenance.get(CONTINUES):
                    self._continues[path.name] = before

    def any_of_size(self, sizes: set[int]) -> bool:
        """Whether a source has one of these sizes [bytes]; if not, no digest need be waited for."""
        return any(size in sizes for size, _ in self._runs)

    def run_of(self, size: int, sha256: str) -> str | None:
        """The file of the run that was made of a source of this size [bytes] and digest."""
        return self._runs.get((size, sha256))

    def newest(self, name: str) -> str | None:
        """The file of the newest version of the run of this name; None if none is stored."""
        versions = (path.name for path in self._known if self.is_version(path.name, name))
        return max(versions, key=lambda file: (len(file), file), default=None)

    def content_of(self, log: str, run: str) -> tuple[int, str] | None:
        """Size [bytes] and SHA-256 of the log of this name that the ``run``, a file, was made of; None: of none."""
        return next(((size, sha256) for size, sha256, of in self._named.get(log, ()) if of == run), None)

    def made_of(self, log: str) -> set[str]:
        """The files of the runs that were made of a log of this name, whole."""
        return {run for _, sha256, run in self._named.get(log, ()) if sha256}

    def begun_run(self, path: Path, size: int) -> str | None:
        """The file of the newest run of a log of this name that was shorter, and is how this one of ``size`` begins."""
        for stored, sha256, run in sorted(reversed(self._named.get(path.name, [])), key=itemgetter(0), reverse=True):
            if 0 < stored < size and atomic_files.sha256_of(path, size=stored) == sha256:
                return run
        return None

    def is_version(self, file: str, name: str) -> bool:
        """Whether a file is the run of this name, or one that continues it, of the same logs when they had grown."""
        return self.named(file) == name

    def named(self, file: str) -> str:
        """The run's name of which a file is a version, by what it says that it continues: `r1.v2` may be a name too."""
        first, links = file, 0
        while first in self._continues and links < len(self._continues):
            first, links = self._continues[first], links + 1
        name = first.removesuffix(SUFFIX)
        # Of a version that was removed, what it continued is told by its name alone.
        return re.sub(r"\.v\d+$", "", name) if links and not (self.folder / first).exists() else name
