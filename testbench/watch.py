"""Logs as they arrive in a folder: each is ingested once it has stopped growing, once, also after a crash.

Nothing is remembered beside the campaign: a log that a stored run was made of is known by its SHA-256.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from .errors import RecordingError, RigError
from .ingest import Ingest, Outcome
from .runsheet import plan

State = tuple[int, int]
"""Size [bytes] and time of the last change [ns] of a file."""
_SKIPPED = (".part", ".tmp", ".crdownload", ".filepart", "~")
"""Endings of files on their way from elsewhere."""


@dataclass
class Watch:
    """The files of a folder that became runs, those that were refused, and those that still grow.

    Folders and links in it, and hidden files, are left alone.
    """

    folder: Path
    ingest: Ingest
    settle_s: float = 2.0
    """A file that did not change for so long has stopped growing [s]."""
    growing: list[Path] = field(default_factory=list, init=False)
    """Files that had changed shortly before the last look."""
    _done: dict[Path, State] = field(default_factory=dict, init=False)
    _seen: dict[Path, tuple[State, float]] = field(default_factory=dict, init=False)

    def once(self) -> Iterator[Outcome]:
        """One pass: what is there and does not grow. Files that still grow are named by ``growing``."""
        self._look()
        if any(path not in self._done for path in self._seen):
            time.sleep(self.settle_s)
        yield from self.look()

    def forever(self, interval_s: float = 1.0) -> Iterator[Outcome]:
        """Everything that arrives, until the process ends."""
        while True:
            yield from self.look()
            time.sleep(interval_s)

    def look(self) -> Iterator[Outcome]:
        """Ingest what has not changed for a while. A file that cannot be taken is said once, and the next one comes."""
        self._look()
        now = time.monotonic()
        waiting = sorted((path, *seen) for path, seen in self._seen.items() if path not in self._done)
        self.growing = [path for path, _, since in waiting if now - since < self.settle_s]
        for path, state, _ in waiting:
            if path not in self.growing:
                self._done[path] = state
                yield from self._one(path)

    def _one(self, path: Path) -> list[Outcome]:
        try:
            (run,) = plan([path], None)
            return self.ingest.run(run)
        except (RecordingError, RigError, OSError) as error:
            return [Outcome(None, path.name, None, "unstated", "refused", (), str(error))]

    def _look(self) -> None:
        """Note the state of every file, and since when it has been in it."""
        now, there = time.monotonic(), _files(self.folder)
        for path in [*self._seen]:
            if path not in there:
                self._seen.pop(path)
                self._done.pop(path, None)
        for path, state in there.items():
            if path not in self._seen or self._seen[path][0] != state:
                self._seen[path] = state, now
                self._done.pop(path, None)


def _files(folder: Path) -> dict[Path, State]:
    found = {}
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name.endswith(_SKIPPED) or path.is_symlink():
            continue
        try:
            stat = path.stat()
        except FileNotFoundError:
            continue  # it was there a moment ago
        if path.is_file():
            found[path] = stat.st_size, stat.st_mtime_ns
    return found
