"""Files that are there whole or not at all: names, digests and locks of what is written, and the journal of it.

A run is written under a hidden name, ``.NAME.TAG.part``, synced, and linked to its own name, never over what is there.
Its SHA-256 is in a file next to it, as ``sha256sum`` writes it. A lock ends with its process, however that ends.

HDF5 gives up a file whose writer was killed. Its chunks are there nevertheless, each with its checksum; the journal
says where, one line each time whole chunks lie in the file, so that `testbench recover` finds them without the file's
index. Each line begins with its own CRC-32.
"""

import errno
import hashlib
import json
import os
import re
import sys
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import IO, Any

from ..errors import StoreError
from ..recording import Group, group_from_dict

SUFFIX = ".sha256"
_BLOCK = 1 << 20
_LINE = re.compile(r"([0-9a-f]{64}) [ *](.+)\n")


def sha256_of(
    path: Path,
    progress: Callable[[int], None] = lambda count: None,
    at_once: int = _BLOCK,
    size: int = sys.maxsize,
) -> str:
    """SHA-256 of a file's content, or of its first ``size`` bytes, in hexadecimal.

    ``progress`` is called with the bytes read since last.
    """
    total = hashlib.sha256()
    with path.open("rb", buffering=0) as stream:
        room = memoryview(bytearray(max(4096, min(at_once, os.fstat(stream.fileno()).st_size))))
        while size > 0 and (count := stream.readinto(room[: min(size, len(room))])):
            total.update(room[:count])
            progress(count)
            size -= count
    return total.hexdigest()


def sha256_alone(path: Path) -> str:
    """SHA-256 of a file's content, in hexadecimal, where nothing else is to be done: another thread reads ahead."""
    total, rooms = hashlib.sha256(), [memoryview(bytearray(_BLOCK)) for _ in range(2)]
    with path.open("rb", buffering=0) as stream, ThreadPoolExecutor(1) as pool:
        reading = pool.submit(stream.readinto, rooms[0])
        while count := reading.result():
            filled, free = rooms
            rooms = [free, filled]
            reading = pool.submit(stream.readinto, free)
            total.update(filled[:count])
    return total.hexdigest()


def digest_file(run: Path) -> Path:
    """Where the digest of ``run`` lies."""
    return run.with_name(run.name + SUFFIX)


def line_for(run_name: str, digest: str) -> str:
    """The text of a digest file."""
    return f"{digest}  {run_name}\n"


def recorded_digest(run: Path) -> str:
    """The digest that was written with ``run``."""
    place = digest_file(run)
    if not place.is_file():
        what = "is no file" if place.exists() else "is missing"
        raise StoreError(f"{run.name}: its digest {place.name} {what}")
    try:
        text = place.read_text("utf-8")
    except OSError as error:
        raise StoreError(f"{place}: cannot be read ({error.strerror or error})") from error
    except UnicodeDecodeError as error:
        raise StoreError(f"{place.name}: not a digest; it may be damaged") from error
    match = _LINE.fullmatch(text)
    if match is None or match[2] != run.name:
        raise StoreError(f"{place.name}: not the digest of {run.name}; it may be damaged")
    return match[1]


PART = ".part"
"""Ending of a file that is being written."""
JOURNAL = ".journal"
"""Ending of the journal of a run that is being written."""
_HIDDEN = re.compile(rf"\.(?P<name>.+)\.(?P<tag>[0-9a-f]{{12}})(?P<ending>{PART}|{JOURNAL}(?:\.new)?)")


def unfinished(path: Path) -> re.Match[str] | None:
    """What a hidden name ``.NAME.TAG.part`` or ``.NAME.TAG.journal`` says that is being written.

    ``name`` is that of the run or of the digest's file, ``tag`` different for all who write at one time; None for the
    files of others.
    """
    return _HIDDEN.fullmatch(path.name)


def place_with_digest(part: Path, target: Path, sha256: str) -> None:
    """Give a synced file its name and write its digest file, that first; never over what is there.

    The folder, which holds the names, is not synced yet.
    """
    digest = digest_file(target)
    named = unfinished(part)
    assert named is not None
    digest_part = digest.with_name(f".{digest.name}.{named['tag']}{PART}")
    try:
        digest_part.write_text(line_for(target.name, sha256), encoding="utf-8", newline="\n")
        sync(digest_part)
        take_name(digest_part, digest)
        try:
            sync(target.parent)  # no loss of power leaves the run without its digest
            take_name(part, target)
        except BaseException:  # an interrupt too: a digest without its run would be in the way of the next ingest
            if part.exists() and not (target.exists() and target.samefile(part)):
                digest.unlink()
            raise
    except FileExistsError as error:
        taken = error.filename2 or error.filename
        raise StoreError(
            f"{taken}: is there already, from another ingest at this moment or one that was stopped; "
            "`testbench verify` tells which"
        ) from error
    finally:
        digest_part.unlink(missing_ok=True)


def take_name(part: Path, target: Path) -> None:
    """Give a finished file its name; it keeps its hidden one until the folder is synced.

    Raises FileExistsError if it is taken: what has it stays, whoever was quicker.
    """
    try:
        os.link(part, target)
    except FileExistsError:
        raise
    except OSError as error:  # a file system without hard links
        if target.exists():
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target)) from error
        os.rename(part, target)


def sync(path: Path) -> None:
    """Wait until the file or folder is on the disk."""
    if path.is_dir() and os.name == "nt":
        return  # Windows cannot open a folder to sync it
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # Windows, where nobody can rename a file that another process holds open
    fcntl = None


def hold_lock(stream: IO[Any]) -> bool:
    """Lock an open file for this process, without waiting; False if another one holds it."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(stream.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def is_locked(path: Path) -> bool:
    """Whether a process that is alive holds ``path``."""
    try:
        if fcntl is None:
            os.rename(path, path)
            return False
        with path.open("rb") as stream:
            return not hold_lock(stream)
    except FileNotFoundError:
        return False
    except PermissionError:
        return True


@contextmanager
def taken(path: Path) -> Iterator[bool]:
    """Hold a file as the only process that does; False where another one that is alive holds it.

    Raises FileNotFoundError if it is gone. On Windows it is not opened for this: nobody could remove it then.
    """
    if fcntl is None:
        yield not is_locked(path)
        return
    with path.open("rb") as stream:
        yield hold_lock(stream)


LOCK = ".lock"
"""Of a campaign: the file by which its writers wait for each other. It stays, and holds nothing."""


@contextmanager
def one_at_a_time(folder: Path) -> Iterator[None]:
    """Wait for the only place in ``folder``: of all processes on this machine, one is inside, which may enter twice."""
    from filelock import FileLock  # late: who reads needs none

    lock = FileLock(folder / LOCK, is_singleton=True)
    try:
        lock.acquire()
    except OSError as error:
        if error.errno not in {errno.ENOLCK, errno.ENOTSUP}:  # a network folder without locks
            raise
    try:
        yield
    finally:
        lock.release()


@dataclass(frozen=True)
class Piece:
    """A chunk of one channel, of which ``count`` samples count: its place and size in the unfinished file [bytes]."""

    at: int
    size: int
    count: int
    digest: str = ""
    """Of its samples, see :mod:`.chunk_io`; empty where it was written before there were digests."""


@dataclass
class Kept:
    """A group as the journal knows it: for each channel the pieces that were acknowledged."""

    group: Group
    number: int
    pieces: list[list[Piece]]
    synced: int = 0
    """So many of them had been synced to the disk when the journal ended."""

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
    boot: str = ""
    """Which start of the machine it was written in; empty where that is not known."""


def boot_id() -> str:
    """Which start of this machine this is; empty where the system does not say."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text("ascii").strip()
    except OSError:
        return ""


class JournalWriter:
    """The journal of a run that is being written. Locked while its process lives."""

    def __init__(self, path: Path, intent: dict[str, Any]) -> None:
        self.path = path
        self.acknowledged: dict[int, int] = {}
        """Chunks a channel that are noted, by the number of their group."""
        self._one_notes = Lock()
        made = path.with_name(f"{path.name}.new")
        self._stream: IO[bytes] = made.open("xb", buffering=0)
        hold_lock(self._stream)  # before it has the name by which `recover` finds it
        if fcntl is not None:
            made.rename(path)
        else:
            self.path = made  # Windows does not rename what is open
        try:
            self._note({"intent": intent, "boot": boot_id()})
        except OSError:
            self.remove()
            raise

    def group(self, number: int, group: Group) -> None:
        """Note a group that begins."""
        self._note({"group": number, "is": asdict(group)})

    def acknowledge(self, number: int, pieces: Sequence[Sequence[Piece]]) -> None:
        """Note chunks of each channel of a group that are written: from now on they survive this process."""
        self.acknowledged[number] = self.acknowledged.get(number, 0) + len(pieces[0])
        self._note({"group": number, "pieces": [[[p.at, p.size, p.count, p.digest] for p in row] for row in pieces]})

    def sync(self, acknowledged: Mapping[int, int]) -> None:
        """Note which chunks are on the disk, and wait until the journal is too: they survive the machine then."""
        self._note({"synced": acknowledged})
        os.fsync(self._stream.fileno())

    def seal(self, sha256: str) -> None:
        """Note that the run is written to its end, and the digest of its file."""
        self._note({"sealed": sha256})

    def _note(self, what: dict[str, Any]) -> None:
        text = json.dumps(what, ensure_ascii=True).encode("ascii")
        line = b"%08x %s\n" % (zlib.crc32(text), text)
        with self._one_notes:
            while line:  # a disk that is full takes a part, and says why when asked again
                line = line[self._stream.write(line) :]

    def close(self) -> None:
        """Let go of the journal, which stays."""
        with suppress(OSError):  # a disk that is full
            self._stream.close()

    def remove(self) -> None:
        """Take the journal away: the run is stored, or given up in good order."""
        self.close()
        self.path.unlink(missing_ok=True)


def read_journal(path: Path) -> Journal:
    """Read a journal up to its last whole line, or a hole that a loss of power left in it.

    Raises StoreError if a line before that is damaged.
    """
    journal = Journal()
    for number, line in enumerate(path.read_bytes().split(b"\n")[:-1], 1):
        if b"\0" in line:
            break
        checksum, _, text = line.partition(b" ")
        if checksum != b"%08x" % zlib.crc32(text):
            raise StoreError(f"{path.name}, line {number}: damaged; what the lines after it say is not trusted either")
        known = json.loads(text)
        if "intent" in known:
            journal.intent, journal.boot = known["intent"], known.get("boot", "")
        elif "sealed" in known:
            journal.sealed = known["sealed"]
        elif "synced" in known:
            for kept in journal.groups:  # journals once said no more than that all was synced
                of_all = known["synced"] is True
                kept.synced = len(kept.pieces[0]) if of_all else known["synced"].get(str(kept.number), 0)
        elif "is" in known:
            group = group_from_dict(known["is"])
            journal.groups.append(Kept(group, known["group"], [[] for _ in group.channels]))
        else:
            for column, more in zip(journal.groups[known["group"]].pieces, known["pieces"], strict=True):
                column.extend(Piece(*piece) for piece in more)
    return journal


@dataclass(frozen=True)
class Leftover:
    """The files that one stopped ingest left: its journal, and the unfinished run."""

    journal: Path
    run: str
    """The name of the run that it was to become."""
    tag: str
    """What its unfinished files have in common."""

    @property
    def part(self) -> Path:
        """The unfinished run."""
        return self.journal.with_name(f".{self.run}.{self.tag}{PART}")

    @property
    def target(self) -> Path:
        """Where the run was to be."""
        return self.journal.with_name(f"{self.run}.h5")


def leftovers(campaign: Path) -> list[Leftover]:
    """What stopped ingests left in a campaign, those that are running included; files of others are none."""
    return [
        Leftover(path, named["name"], named["tag"])
        for path in sorted(campaign.iterdir())
        if (named := unfinished(path)) is not None and named["ending"].startswith(JOURNAL) and path.is_file()
    ]
