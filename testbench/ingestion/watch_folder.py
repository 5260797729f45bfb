"""Logs as they arrive in a folder: each is ingested once it has stopped growing, once, also after a crash.

A log has stopped growing when no process holds it for writing, where the system says so, and it has rested for twice
the longest pause that a log of its kind made while it grew. One that grows nevertheless is stored again, whole, as the
next version of its run, which is marked incomplete until then.

Nothing is remembered outside the campaign: a log that a stored run was made of is known by its SHA-256.

With a run table, which is read again when it changes, the rule is: a file that the run table names is
ingested with its conditions, once all files of its run are there; a file that it does not name waits until it does, or,
where asked for, is ingested without conditions. While the table cannot be read, or is being saved, everything waits.

Without a run table each log is a run of its own, and what another log in the folder holds is not missing in it.
"""

import math
import os
import re
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..errors import RecordingError, RigError, StoreError
from ..store.ledger import enter_growth
from .ingest import Ingest, Outcome
from .log_sources import SiblingLogs
from .planned_runs import PlannedRun, plan_rows, plan_runs, same_file
from .run_table import RunTableRow, read_run_table

State = tuple[int, int]
"""Size [bytes] and time of the last change [ns] of a file."""


@dataclass
class WatchedRunTable:
    """The rows of a run table, read again whenever it has changed and its saving is done."""

    path: Path
    settle_s: float
    """It must not have changed for so long [s]."""
    rows: list[RunTableRow] | None = field(default=None, init=False)
    """None while it is not there, is being saved, or cannot be read."""
    _state: State | None = field(default=None, init=False)
    _since: float = field(default=0.0, init=False)
    _read: State | None = field(default=None, init=False)
    _known: dict[str, RunTableRow] = field(default_factory=dict, init=False)

    def note(self, now: float) -> None:
        """Note the state of the file at ``now`` [s], and since when it has been in it."""
        state = state_of(self.path)
        if state != self._state:
            self._state, self._since = state, now

    def look(self, now: float) -> set[str]:
        """Read what has changed; the files whose rows say something else than before. Raises RigError, once a state."""
        self.note(now)
        if self._state is None or now - self._since < self.settle_s:
            self.rows, self._read = None, None
            return set()
        if self._state == self._read:
            return set()
        self._read, self.rows = self._state, None
        self.rows = read_run_table(self.path)
        before, self._known = self._known, {row.file: row for row in self.rows}
        names = before.keys() | self._known.keys()
        rows = ((name, before.get(name), self._known.get(name)) for name in names)
        return {
            Path(name).name
            for name, old, new in rows
            if old is None
            or new is None
            or (old.run, old.origin, old.conditions) != (new.run, new.origin, new.conditions)
        }


def state_of(path: Path) -> State | None:
    """Size and time of the last change of a file; None if it is not there."""
    try:
        stat = path.stat()
    except FileNotFoundError:
        return None
    return stat.st_size, stat.st_mtime_ns


_SKIPPED = (".part", ".tmp", ".crdownload", ".filepart", "~")
"""Endings of files on their way from elsewhere."""
TRIED_AGAIN_S = 30.0
"""After so long a log is tried again at which the disk or share failed [s]."""
LONGEST_PAUSE_S = 60.0
"""A log that rested for longer did not pause: somebody went on with it [s]."""


def knows_all_writers() -> bool:
    """Whether this system says which processes hold a file open, those of all users."""
    return os.path.isdir("/proc/self/fd") and os.geteuid() == 0


def writers(paths: Collection[Path]) -> dict[Path, int]:
    """The files that a process holds open for writing, and its number, as far as the system says so."""
    wanted = {(stat.st_dev, stat.st_ino): path for path in paths if (stat := _stat(path))}
    found: dict[Path, int] = {}
    for folder in Path("/proc").glob("[0-9]*/fd") if wanted else ():
        try:
            for handle in folder.iterdir():
                stat = _stat(handle)
                path = stat and wanted.get((stat.st_dev, stat.st_ino))
                if path and int((folder.parent / "fdinfo" / handle.name).read_text().split()[3], 8) & os.O_ACCMODE:
                    found[path] = int(folder.parent.name)
        except OSError:  # it has ended, or is another user's
            continue
    return found


def _stat(path: Path) -> os.stat_result | None:
    try:
        return path.stat()
    except OSError:
        return None


@dataclass
class WatchedLog:
    """What is known of a log in the folder."""

    state: State
    since: float
    """When it was first seen in this state [s]."""
    is_done: bool = False
    """Whether it was ingested or refused in this state."""
    run: str | None = None
    """File of the run that it was stored as."""
    due: float = math.inf
    """When it is tried again, if the disk or share failed at it [s]; and what was said of that then."""
    failure: str = ""


@dataclass
class Watch:
    """The files of a folder that became runs, those that were refused, and those that still grow.

    Folders and links in it, and hidden files, are left alone.
    """

    folder: Path
    ingest: Ingest
    settle_s: float = 2.0
    """A file that did not change for so long has stopped growing, unless files of its kind paused for longer [s]."""
    run_table: WatchedRunTable | None = None
    """The run table; it may lie in the folder."""
    store_unnamed: bool = False
    """Whether files that the run table does not name are ingested without conditions; otherwise they wait."""
    growing: list[Path] = field(default_factory=list, init=False)
    """Files that had changed shortly before the last look, or that a process holds for writing."""
    writing: dict[Path, int] = field(default_factory=dict, init=False)
    """Those of them that a process holds, by its number."""
    waiting: dict[Path, str] = field(default_factory=dict, init=False)
    """Files that have stopped growing, and what they wait for."""
    _logs: dict[Path, WatchedLog] = field(default_factory=dict, init=False)
    _pauses: dict[str, float] = field(default_factory=dict, init=False)
    """Longest pause of logs while they grew [s], by their name without its digits."""
    _trouble: str = field(default="", init=False)
    """Why the last look saw nothing."""
    _siblings: SiblingLogs = field(init=False)

    def __post_init__(self) -> None:
        self._siblings = SiblingLogs((), self.ingest.reading)
        self.ingest = replace(
            self.ingest, sibling_log=lambda channels: None if self.run_table else self._siblings.holding(channels)
        )

    def once(self) -> Iterator[Outcome]:
        """One pass: what is there and does not grow. Files that still grow are named by ``growing``."""
        self._look()
        if not all(log.is_done for log in self._logs.values()) or self.run_table is not None:
            if self.run_table is not None:
                self.run_table.note(time.monotonic())
            time.sleep(max([self.settle_s, *map(self._settle_s, self._logs)]))
        yield from self.look()

    def forever(self, looked: Callable[[], None] = lambda: None, interval_s: float = 1.0) -> Iterator[Outcome]:
        """Everything that arrives, until the process ends; ``looked`` is called after each look."""
        while True:
            yield from self.look()
            looked()
            time.sleep(interval_s)

    def look(self) -> Iterator[Outcome]:
        """Ingest what has not changed for a while. A file that cannot be taken is said once, and the next one comes."""
        try:
            self._look()
        except OSError as error:  # a share that went away: a later look may see it again
            if self._trouble != (reason := error.strerror or str(error)):
                yield _refused(self.folder, f"{error.filename}: {reason}; tried again at each look, not said again")
            self._trouble = reason
            return
        self._trouble = ""
        now = time.monotonic()
        for log in self._logs.values():
            log.is_done &= log.due > now
        if self.run_table is not None:
            try:
                changed = self.run_table.look(now)
            except RigError as error:
                yield _refused(self.run_table.path, str(error))
            else:
                for path, log in self._logs.items():
                    log.is_done &= path.name not in changed
        pending = sorted(path for path, log in self._logs.items() if not log.is_done)
        resting = [path for path in pending if now - self._logs[path].since >= self._settle_s(path)]
        self.writing = writers(resting)
        self.growing = [path for path in pending if path not in resting or path in self.writing]
        settled = [path for path in pending if path not in self.growing]
        if self.run_table is None:
            self.waiting = {}
            for path in settled:
                yield from self._one(PlannedRun(path.stem, (path,)))
        else:
            yield from self._by_run_table(settled)

    def _by_run_table(self, settled: list[Path]) -> Iterator[Outcome]:
        """Ingest the runs that are complete; say of the other files, once, what they wait for."""
        assert self.run_table is not None
        if self.run_table.rows is None:
            reason = f"waits for {self.run_table.path.name}, the run table"
            yield from self._wait(dict.fromkeys(settled, reason))
            return
        there = [path for path in self._logs if path not in self.growing]
        try:
            planned = plan_rows(self.run_table.rows, there, self.run_table.path)
        except RigError as error:
            yield from self._wait(dict.fromkeys(settled, f"waits for the run table to be mended: {error}"))
            return
        if self.store_unnamed:
            planned = [run if run.conditions is not None else PlannedRun(run.name, run.files) for run in planned]
        planned = [run for run in planned if any(path in settled for path in run.files)]
        yield from self._wait(
            {path: run.problem for run in planned if run.problem for path in run.files if path in settled}
        )
        for run in planned:
            if not run.problem:
                yield from self._one(run)

    def _wait(self, reasons: dict[Path, str]) -> Iterator[Outcome]:
        before, self.waiting = self.waiting, reasons
        for path, reason in reasons.items():
            if before.get(path) != reason:
                yield Outcome(None, path.name, None, "unstated", "waiting", (), reason)

    def _one(self, run: PlannedRun) -> list[Outcome]:
        for path in run.files:
            self._logs[path].is_done = True
        try:
            if run.conditions is None:
                (run,) = plan_runs(run.files, None)
            outcomes = self.ingest.run(run)
        except (RecordingError, RigError, OSError) as error:
            return [_refused(path, str(error)) for path in run.files]
        told = []
        for path, outcome in zip(run.files, outcomes, strict=False):
            log = self._logs[path]
            log.run = outcome.file or log.run
            if not outcome.may_pass or outcome.message != log.failure:
                told.append(outcome)
            log.due = time.monotonic() + TRIED_AGAIN_S if outcome.may_pass else math.inf
            log.failure = outcome.message if outcome.may_pass else ""
        return told

    def _settle_s(self, path: Path) -> float:
        """How long a log must have rested [s]."""
        return max(self.settle_s, 2.0 * self._pauses.get(_kind(path), 0.0))

    def _look(self) -> None:
        """Note the state of every file, and since when it has been in it.

        Of one that has grown, learn the pause that it made; the run that was made of its beginning is incomplete.
        """
        now, there = time.monotonic(), dict[Path, State]()
        for path in self.folder.iterdir():
            if path.name.startswith(".") or path.name.endswith(_SKIPPED) or path.is_symlink():
                continue
            state = state_of(path)
            is_table = self.run_table is not None and same_file(path, self.run_table.path)
            if state is not None and path.is_file() and not is_table:
                there[path] = state
        for path in self._logs.keys() - there.keys():
            self._logs.pop(path)
            self._siblings.gone(path)
        for path, state in there.items():
            log = self._logs.setdefault(path, WatchedLog((-1, 0), now))
            if log.state == state:
                continue
            if state[0] > log.state[0] > 0:
                pause_s, kind = now - log.since, _kind(path)
                if pause_s <= LONGEST_PAUSE_S:
                    self._pauses[kind] = max(pause_s, self._pauses.get(kind, 0.0))
                if log.run is not None:
                    with suppress(StoreError, OSError):  # a ledger that takes no entry: the next run says so
                        enter_growth(self.ingest.folder, log.run)
                    log.run = None
            log.state, log.since, log.is_done = state, now, False
            self._siblings.changed(path)
            self.ingest.reading.add_logs([path])


def _kind(path: Path) -> str:
    """What the names of one logger's files have in common."""
    return re.sub(r"\d+", "#", path.name)


def _refused(path: Path, message: str) -> Outcome:
    return Outcome(None, path.name, None, "unstated", "refused", (), message)
