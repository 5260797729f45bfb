"""What an ingest has written so far: one line each time whole chunks lie in the unfinished file.

HDF5 gives up a file whose writer was killed. Its chunks are there nevertheless, each with its checksum; the journal
says where, so that `testbench recover` reads them without HDF5. Each line of the journal begins with its own CRC-32.
"""

import json
import zlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import IO, Any

from ..errors import StoreError
from ..recording import Channel, Clock, Group, TimeColumn, UniformClock
from . import atomic_files
from .atomic_files import JOURNAL, PART, unfinished


@dataclass(frozen=True)
class Piece:
    """A chunk of one channel, of which ``count`` samples count: its place and size in the unfinished file [bytes]."""

    at: int
    size: int
    count: int


@dataclass
class Kept:
    """A group as the journal knows it: for each channel the pieces that were acknowledged."""

    group: Group
    pieces: list[list[Piece]]

    @property
    def samples(self) -> int:
        """Acknowledged samples a channel."""
        return sum(piece.count for piece in self.pieces[0])


@dataclass
class Journal:
    """A journal read back: what was meant to be stored, and what is."""

    intent: dict[str, Any] = field(default_factory=dict)
    groups: list[Kept] = field(default_factory=list)
    sealed: str | None = None
    """SHA-256 of the file, if it was written to its end."""


class JournalWriter:
    """The journal of a run that is being written. Locked while its process lives."""

    def __init__(self, path: Path, intent: dict[str, Any]) -> None:
        self.path = path
        made = path.with_name(f"{path.name}.new")
        self._stream: IO[bytes] = made.open("xb", buffering=0)
        atomic_files.hold_lock(self._stream)  # before it has the name by which `recover` finds it
        if atomic_files.fcntl is not None:
            made.rename(path)
        else:
            self.path = made  # Windows does not rename what is open
        try:
            self._note({"intent": intent})
        except OSError:
            self.remove()
            raise

    def group(self, number: int, group: Group) -> None:
        """Note a group that begins."""
        clock: Clock | None = group.clock
        kind = None if clock is None else "uniform" if isinstance(clock, UniformClock) else "recorded"
        channels = [asdict(channel) for channel in group.channels]
        text = {"name": group.name, "channels": channels, "clock": kind, **({} if clock is None else asdict(clock))}
        self._note({"group": number, "is": text})

    def acknowledge(self, number: int, pieces: Sequence[Sequence[Piece]]) -> None:
        """Note chunks of each channel of a group that are written: from now on they survive this process."""
        self._note({"group": number, "pieces": [[[p.at, p.size, p.count] for p in row] for row in pieces]})

    def seal(self, sha256: str) -> None:
        """Note that the run is written to its end, and the digest of its file."""
        self._note({"sealed": sha256})

    def _note(self, what: dict[str, Any]) -> None:
        text = json.dumps(what, ensure_ascii=True).encode("ascii")
        line = b"%08x %s\n" % (zlib.crc32(text), text)
        while line:  # a disk that is full takes a part, and says why when asked again
            line = line[self._stream.write(line) :]

    def remove(self) -> None:
        """Take the journal away: the run is stored, or given up in good order."""
        with suppress(OSError):  # a disk that is full
            self._stream.close()
        self.path.unlink(missing_ok=True)


def read_journal(path: Path) -> Journal:
    """Read a journal up to its last whole line. Raises StoreError if a line before that is damaged."""
    journal = Journal()
    lines = path.read_bytes().split(b"\n")
    for number, line in enumerate(lines[:-1], 1):
        checksum, _, text = line.partition(b" ")
        if checksum != b"%08x" % zlib.crc32(text):
            raise StoreError(f"{path.name}, line {number}: damaged; what the lines after it say is not trusted either")
        _take(journal, json.loads(text))
    return journal


def _take(journal: Journal, line: dict[str, Any]) -> None:
    if "intent" in line:
        journal.intent = line["intent"]
    elif "sealed" in line:
        journal.sealed = line["sealed"]
    elif "is" in line:
        group = _group(line["is"])
        journal.groups.append(Kept(group, [[] for _ in group.channels]))
    else:
        for known, more in zip(journal.groups[line["group"]].pieces, line["pieces"], strict=True):
            known.extend(Piece(*piece) for piece in more)


def _group(text: dict[str, Any]) -> Group:
    clock: Clock | None = None
    if text["clock"] == "uniform":
        clock = UniformClock(text["rate_hz"], text["start_s"])
    elif text["clock"] == "recorded":
        clock = TimeColumn(text["index"], text["seconds_per_unit"], text["assumed"])
    return Group(text["name"], tuple(Channel(**channel) for channel in text["channels"]), clock)


def journals_in(folder: Path) -> Iterator[Path]:
    """The journals in ``folder``; files of others are none, whatever their ending."""
    for path in sorted(folder.iterdir()):
        if (named := unfinished(path)) is not None and named.ending.startswith(JOURNAL) and path.is_file():
            yield path


@dataclass(frozen=True)
class Leftover:
    """The files that one stopped ingest left: its journal, and the unfinished run."""

    journal: Path
    part: Path
    run: str
    """The name of the run that it was to become."""
    tag: str
    """What its unfinished files have in common."""

    @property
    def target(self) -> Path:
        """Where the run was to be."""
        return self.part.with_name(f"{self.run}.h5")


def leftovers(campaign: Path) -> list[Leftover]:
    """What stopped ingests left in a campaign, those that are running included."""
    found = []
    for path in journals_in(campaign):
        if (named := unfinished(path)) is not None:
            part = path.with_name(f".{named.name}.{named.tag}{PART}")
            found.append(Leftover(path, part, named.name, named.tag))
    return found
