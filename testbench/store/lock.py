"""Locks that end with the process that holds them, however it ends."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import IO, Any

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # Windows, where nobody can rename a file that another process holds open
    fcntl = None


def hold(stream: IO[Any]) -> bool:
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
            return not hold(stream)
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
