"""Names of files that are being written; and giving a finished one its own: on the disk, never over what is there.

SHA-256 of files, and the digest that lies beside each stored run, as ``sha256sum`` writes it.

Locks that end with the process that holds them, however it ends.
"""

import errno
import hashlib
import os
import re
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import IO, Any, NamedTuple

from ..errors import StoreError

SUFFIX = ".sha256"
_BLOCK = 1 << 20
_LINE = re.compile(r"([0-9a-f]{64}) [ *](.+)\n")


def sha256_of(path: Path, progress: Callable[[int], None] = lambda count: None, at_once: int = _BLOCK) -> str:
    """SHA-256 of a file's content, in hexadecimal; ``progress`` is told how many bytes were read since last."""
    total = hashlib.sha256()
    with path.open("rb", buffering=0) as stream:
        room = memoryview(bytearray(max(4096, min(at_once, os.fstat(stream.fileno()).st_size))))
        while count := stream.readinto(room):
            total.update(room[:count])
            progress(count)
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
    """The digest that was written beside ``run``."""
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
"""Ending of the journal beside a run that is being written."""
_HIDDEN = re.compile(rf"\.(.+)\.([0-9a-f]{{12}})({PART}|{JOURNAL}(?:\.new)?)")


class Unfinished(NamedTuple):
    """What the hidden name of a file says that is being written: ``.NAME.TAG.part`` or ``.NAME.TAG.journal``."""

    name: str
    """Of the run, or of the digest's file."""
    tag: str
    """What tells apart those who write at one time."""
    ending: str


def unfinished(path: Path) -> Unfinished | None:
    """What the name of ``path`` says, if it is one that we give; None for the files of others."""
    found = _HIDDEN.fullmatch(path.name)
    return None if found is None else Unfinished(found[1], found[2], found[3])


def place_with_digest(part: Path, target: Path, line: str) -> None:
    """Give a synced file its name and put its digest beside it, the digest first; never over what is there."""
    beside = digest_file(target)
    named = unfinished(part)
    assert named is not None
    digest_part = beside.with_name(f".{beside.name}.{named.tag}{PART}")
    try:
        digest_part.write_text(line, encoding="utf-8", newline="\n")
        sync(digest_part)
        take_name(digest_part, beside)
        try:
            take_name(part, target)
        except OSError:
            beside.unlink()
            raise
    except FileExistsError as error:
        taken = error.filename2 or error.filename
        raise StoreError(
            f"{taken}: is there already, from another ingest at this moment or one that was stopped; "
            "`testbench verify` tells which"
        ) from error
    finally:
        digest_part.unlink(missing_ok=True)
    sync(target.parent)


def take_name(part: Path, target: Path) -> None:
    """Give a finished file its name. Raises FileExistsError if it is taken: what has it stays, whoever was quicker."""
    try:
        os.link(part, target)
    except FileExistsError:
        raise
    except OSError as error:  # a file system without hard links
        if target.exists():
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target)) from error
        os.rename(part, target)
    part.unlink(missing_ok=True)


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


def is_held(path: Path) -> bool:
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
def one_at_a_time(folder: Path) -> Iterator[None]:
    """Wait for the only place in ``folder``: of all processes on this machine, one is inside."""
    if fcntl is None:
        yield  # a run's name is still taken once only
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a network folder without locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
