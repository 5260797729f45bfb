"""SHA-256 of files, and the digest that lies beside each stored run, as ``sha256sum`` writes it."""

import hashlib
import os
import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

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


class Growing:
    """SHA-256 of a file whose end is not yet what it will be; another thread reads ahead."""

    def __init__(self, path: Path) -> None:
        self._path, self._total, self._at = path, hashlib.sha256(), 0

    def grow(self, end: int | None = None) -> None:
        """Take in the file from where this stands to byte ``end``, or to its own end."""
        rooms = [memoryview(bytearray(_BLOCK)) for _ in range(2)]
        with self._path.open("rb", buffering=0) as stream, ThreadPoolExecutor(1) as pool:
            stream.seek(self._at)
            reading = pool.submit(stream.readinto, self._fitting(rooms[0], end))
            while count := reading.result():
                filled, free = rooms
                rooms = [free, filled]
                self._at += count
                reading = pool.submit(stream.readinto, self._fitting(free, end))
                self._total.update(filled[:count])

    def _fitting(self, room: memoryview, end: int | None) -> memoryview:
        return room if end is None else room[: max(0, end - self._at)]

    def hexdigest(self) -> str:
        """The digest of what was taken in, in hexadecimal."""
        return self._total.hexdigest()


def beside(run: Path) -> Path:
    """Where the digest of ``run`` lies."""
    return run.with_name(run.name + SUFFIX)


def line_for(run_name: str, digest: str) -> str:
    """The text of a digest file."""
    return f"{digest}  {run_name}\n"


def recorded(run: Path) -> str:
    """The digest that was written beside ``run``."""
    try:
        text = beside(run).read_text("utf-8")
    except FileNotFoundError as error:
        raise StoreError(f"{run.name}: its digest {beside(run).name} is missing") from error
    except UnicodeDecodeError as error:
        raise StoreError(f"{beside(run).name}: not a digest; it may be damaged") from error
    match = _LINE.fullmatch(text)
    if match is None or match[2] != run.name:
        raise StoreError(f"{beside(run).name}: not the digest of {run.name}; it may be damaged")
    return match[1]
