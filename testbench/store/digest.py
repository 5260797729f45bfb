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


def beside(run: Path) -> Path:
    """Where the digest of ``run`` lies."""
    return run.with_name(run.name + SUFFIX)


def line_for(run_name: str, digest: str) -> str:
    """The text of a digest file."""
    return f"{digest}  {run_name}\n"


def recorded(run: Path) -> str:
    """The digest that was written beside ``run``."""
    place = beside(run)
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
