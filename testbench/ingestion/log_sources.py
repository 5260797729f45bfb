"""The files given to an ingest: each opened, its digest computed on the way, and what is refused at once.

Where several logs make one run, groups of one name in two files get the name of their file in front. Where each is a
run of its own, the others are asked for channels that one lacks. Refused are stored runs, channels without end, and the
same bytes twice in one run.
"""

import threading
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from balance import datasets

from ..errors import RecordingError
from ..readers import ReadOptions, open_recording
from ..recording import Block, Finding, Group, Recording, Refusal, Report
from ..store import atomic_files, layout
from ..store.campaign import KEPT, SUFFIX

if TYPE_CHECKING:
    from ..readers.import_description import ImportDescription
    from ..rig import Rig

_AT_ONCE = 4 << 20
"""Bytes between two waits for Python's lock, which whoever runs Python holds for milliseconds."""


class LogReading:
    """How each log is read: as the rig's logger says of which it holds channels, else by the options given.

    Raises RecordingError for a description that is not there or wrong, or beside one that the options have.
    """

    def __init__(self, options: ReadOptions | None = None, rig: "Rig | None" = None) -> None:
        self._rig, self._options = rig, options or ReadOptions()
        self._loggers: dict[str, list[str]] = {}
        """Names of the loggers by the import description that the rig names for them: in its folder, or shipped."""
        self._described: dict[str, ReadOptions] = {}
        self._named, self._unread = set[tuple[str, str]](), dict[Path, None]()
        """Channels that descriptions name and a log holds, each with the description's text; logs to be asked yet."""
        for name, logger in {} if rig is None else rig.loggers.items():
            if logger.read_as:
                self._loggers.setdefault(logger.read_as, []).append(name)
        for named, loggers in self._loggers.items():
            from ..readers.import_description import ImportDescription  # late: few logs have one

            if Path(named).is_absolute() or ".." in Path(named).parts:
                raise RecordingError(
                    f"loggers.{loggers[0]}.read_as: {named!r}: expected a file in the rig's folder, or a shipped "
                    "description"
                )
            own = ((rig and rig.folder) or Path()) / named
            shipped = not own.is_file() and named in datasets.dataset_names("loggers", ".toml")
            description = ImportDescription.load(named if shipped else str(own))
            self._described[named] = replace(self._options, description=description)
        if self._described and self._options.description is not None:
            first = min(name for loggers in self._loggers.values() for name in loggers)
            raise RecordingError(f"--as: the rig says it by loggers.{first}.read_as: give one of the two")

    def is_of(self, options: ReadOptions | None, rig: "Rig | None") -> bool:
        """Whether it is by these options and this rig."""
        return self._options == (options or ReadOptions()) and self._rig is rig

    def options(self, path: Path) -> ReadOptions:
        """Those of a log; raises as :meth:`opened`."""
        return self.opened(path)[0]

    def add_logs(self, files: Iterable[Path]) -> None:
        """Other logs of the same command: a description that they share may name channels that only some hold."""
        self._unread |= dict.fromkeys(files)

    def checked(self, description: "ImportDescription | None", found: Iterable[Finding]) -> list[Finding]:
        """Findings of a log, of which channels that it lacks are notes where another log of the command holds them."""
        return [
            replace(
                f, code="channel_elsewhere", message=f"{f.channel} is in another log of the command, not in this one"
            )
            if f.code == "channel_not_found" and description and self._names(description.text, f.channel or "")
            else f
            for f in found
        ]

    def _names(self, text: str, channel: str) -> bool:
        """Whether a log holds this channel, by the description of this text; no more are opened than are needed."""
        while (text, channel) not in self._named and self._unread:
            self._unread.pop(path := next(iter(self._unread)))
            with suppress(RecordingError, OSError):  # what is said where it is ingested
                self.opened(path)
        return (text, channel) in self._named

    def opened(self, path: Path) -> tuple[ReadOptions, Recording]:
        """A log, opened by its options. Raises RecordingError for one of two descriptions, or that does not fit."""
        options, recording = self._opened(path)
        if (told := options.description) is not None:
            self._named |= {(told.text, name) for name in told.channels.keys() - _lacking(recording)}
        return options, recording

    def _opened(self, path: Path) -> tuple[ReadOptions, Recording]:
        fitting, failed = dict[str, tuple[ReadOptions, Recording]](), dict[str, RecordingError]()
        for named, options in self._described.items():
            try:
                recording = open_recording(path, options)
            except RecordingError as error:
                failed[named] = error
            else:
                if self._holds(recording, named):
                    fitting[named] = options, recording
        whole = {named: one for named, one in fitting.items() if not _lacking(one[1])}
        fitting = whole or fitting  # of loggers that call their channels alike, the one whose names are all there
        complete = {named: one for named, one in fitting.items() if self._holds(one[1], named, every=True)}
        fitting = complete or fitting
        if len({options.description.text for options, _ in fitting.values() if options.description}) > 1:
            loggers = [name for named in fitting for name in self._loggers[named]]
            raise RecordingError(
                f"{path.name}: holds channels of the loggers {', '.join(loggers)}, which the rig has read by different "
                "import descriptions (read_as): expected those of one"
            )
        if fitting:
            return fitting.popitem()[1]
        try:
            recording = open_recording(path, self._options)
        except RecordingError:
            if failed:  # what is wrong with a description, as nothing else reads the log
                raise next(iter(failed.values())) from None
            raise
        for named, failure in failed.items():
            if recording.origin != "simulated" and self._holds(recording, named):
                raise failure
        return self._options, recording

    def _holds(self, recording: Recording, named: str, every: bool = False) -> bool:
        """Whether a log holds a channel, or ``every`` one, of one of the loggers with a description, be it by its name
        as written."""
        held = {name for group in recording.groups for channel in group.channels for name in channel.names}
        loggers, description = self._loggers[named], self._described[named].description
        held |= description.renamed(held) if description is not None else set()
        quantity = all if every else any
        wanted = [[column.channel in held for column in self._rig.columns(name)] for name in loggers if self._rig]
        return any(one and quantity(one) for one in wanted)


def _lacking(recording: Recording) -> set[str | None]:
    """Channels that the import description names and the log does not hold."""
    return {finding.channel for finding in recording.findings if finding.code == "channel_not_found"}


class Source:
    """One log file: its recording opened, the findings so far, and its SHA-256.

    That is of the bytes as the reader reads them, where it reads all; else it is computed in a thread meanwhile.
    """

    def __init__(self, path: Path, reading: LogReading) -> None:
        if not path.is_file():
            open_recording(path)  # says what is there instead
        self.path, self._sha256 = path, ""
        self.findings: list[Finding] = []
        self._state = _state(path)
        self._failed: OSError | None = None
        self._thread: threading.Thread | None = None
        options, self.recording = reading.opened(path)
        self.description = options.description
        if self.recording.content is not None:
            self.recording.content.wanted = True
        else:
            self._thread = threading.Thread(target=self._digest, daemon=True)
            self._thread.start()

    def _digest(self) -> None:
        try:
            self._sha256 = atomic_files.sha256_of(self.path, at_once=_AT_ONCE)
        except OSError as error:
            self._failed = error

    @property
    def sha256(self) -> str:
        """The SHA-256 of the file; empty as long as it is not known."""
        content = self.recording.content
        return self._sha256 or (content.sha256 if content is not None else "")

    @property
    def size(self) -> int:
        """Size of the file when it was opened [bytes]."""
        return self._state[0]

    def digested(self) -> str:
        """The SHA-256 of the file. Raises RecordingError if the file has changed since it was opened."""
        if self._thread is not None:
            self._thread.join()
        elif not self.sha256:
            self._digest()
        if self._failed is not None:
            raise self._failed
        if _state(self.path) != self._state:
            raise RecordingError(f"{self.path.name}: changed while it was read; ingest it when its logger is done")
        return self.sha256

    def provenance(self) -> dict[str, Any]:
        """What is kept of the source: never its folder, which is no business of those who get the run."""
        recording = self.recording
        return {
            "name": self.path.name,
            "size_bytes": self.size,
            "sha256": self.sha256,
            "format": recording.format,
            "reader": recording.reader,
            "origin": recording.origin,
            "groups": [group.name for group in recording.groups],
            "settings": dict(recording.settings),
            "metadata": dict(recording.metadata),
            "comments": list(recording.comments),
        } | ({"texts": list(map(asdict, recording.texts.kept))} if recording.texts.series else {})


def _state(path: Path) -> tuple[int, int]:
    stat = path.stat()
    return stat.st_size, stat.st_mtime_ns


def distinct_groups(recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings, with no group's name in two of them."""
    names = Counter(name for recording in recordings for name in {group.name for group in recording.groups})
    stems = Counter(recording.path.stem for recording in recordings)
    found = []
    for i, recording in enumerate(recordings, 1):
        stem = recording.path.stem
        front = stem if stems[stem] == 1 else f"{stem} {i}"
        shared = any(names[group.name] > 1 for group in recording.groups)
        found.append(_renamed(recording, front) if shared else recording)
    return found


def _renamed(recording: Recording, front: str) -> Recording:
    """The recording with ``front`` before the name of each group, also of those that come while it is read."""

    def renamed(group: Group) -> Group:
        return replace(group, name=f"{front} {group.name}")

    def read(report: Report) -> Iterator[Block]:
        for block in recording.read(report):
            yield replace(block, group=renamed(block.group))

    recording.texts.front = front
    return replace(recording, groups=tuple(map(renamed, recording.groups)), read=read)


class SiblingLogs:
    """The channels of several logs, by their headers, of which no more are read than are asked for."""

    def __init__(self, files: Sequence[Path], reading: LogReading) -> None:
        self._unread = list(files)
        self._reading = reading
        self._labels: dict[Path, frozenset[str]] = {}

    def changed(self, path: Path) -> None:
        """A log is there or says something else than before: its header is to be read."""
        self.gone(path)
        self._unread.append(path)

    def gone(self, path: Path) -> None:
        """A log is no longer there."""
        self._labels.pop(path, None)
        self._unread = [other for other in self._unread if other != path]

    def holding(self, channels: Collection[str]) -> str | None:
        """The name of the first log that holds one of ``channels``; None if none does."""
        for path, labels in self._labels.items():
            if not labels.isdisjoint(channels):
                return path.name
        while self._unread:
            path = self._unread.pop(0)
            try:
                groups = self._reading.opened(path)[1].groups
            except (RecordingError, OSError):  # what is said where it is ingested
                groups = ()
            self._labels[path] = labels = frozenset(n for g in groups for channel in g.channels for n in channel.names)
            if not labels.isdisjoint(channels):
                return path.name
        return None


MOST_CHANNELS = 30_000
"""Channels of one log: each takes some 40 KiB of memory and half a millisecond while it is stored."""


def own_files(files: Sequence[Path], campaign: Path) -> list[Path]:
    """Those of ``files`` that the campaign put into its folder: a pattern for logs that lie there names them too.

    A run is known by the digest beside it, so that an HDF5 file of others stays a log; none are named where no file
    but these is given, for then somebody means them.
    """
    if not campaign.is_dir():
        return []
    own = []
    for path in files:
        run = path.with_name(path.name.removesuffix(atomic_files.SUFFIX))
        is_run = run.suffix == SUFFIX and run.exists() and atomic_files.digest_file(run).exists()
        if path.parent.resolve() == campaign.resolve() and (path.name in KEPT or is_run):
            own.append(path)
    return own if len(own) < len(files) else []


def refuse_stored_run(source: Source) -> None:
    """Raise Refusal for a stored run: stored anew it would lose its conditions, findings and sources."""
    if layout.MARK in source.recording.metadata:
        message = "is a stored run and no log: copy it with its .sha256 into a campaign, or use `testbench archive`"
        raise Refusal(source.path.name, Finding("stored_run", None, None, message))


def refuse_too_many(source: Source, groups: Iterable[Group]) -> None:
    """Raise Refusal for more channels than memory is for: small files can declare them without end."""
    if (count := sum(len(group.channels) for group in groups)) > MOST_CHANNELS:
        message = f"{count} channels; expected no more than {MOST_CHANNELS}: export fewer at a time"
        raise Refusal(source.path.name, Finding("too_large", None, None, message))


def refuse_twice(digests: Sequence[tuple[str, str]]) -> None:
    """Raise RecordingError where two files of one run, each its SHA-256 and name, hold the same bytes."""
    seen: dict[str, str] = {}
    for sha256, name in digests:
        if sha256 in seen:
            raise RecordingError(f"{name}: holds the same bytes as {seen[sha256]}: one recording twice in one run")
        seen[sha256] = name
