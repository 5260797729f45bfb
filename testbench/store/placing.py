"""Names of files that are being written; and giving a finished one its own: on the disk, never over what is there."""

import errno
import os
import re
from pathlib import Path
from typing import NamedTuple

from ..errors import StoreError
from . import digest

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


def place(part: Path, target: Path, line: str) -> None:
    """Give a synced file its name and put its digest beside it, the digest first; never over what is there."""
    beside = digest.beside(target)
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
