"""Giving a finished file its name: once it is on the disk, and never over what is there."""

import os
from pathlib import Path

from ..errors import StoreError
from . import digest

PART = ".part"
"""Ending of a file that is being written."""


def place(part: Path, target: Path, line: str) -> None:
    """Give a synced file its name and put its digest beside it, the digest first; never over what is there."""
    beside = digest.beside(target)
    digest_part = beside.with_name(f".{beside.name}.{part.name.rpartition('.')[0].rpartition('.')[2]}{PART}")
    try:
        digest_part.write_text(line, encoding="utf-8", newline="\n")
        sync(digest_part)
        _place(digest_part, beside)
        try:
            _place(part, target)
        except (StoreError, OSError):
            beside.unlink()
            raise
    finally:
        digest_part.unlink(missing_ok=True)
    sync(target.parent)


def _place(part: Path, target: Path) -> None:
    """Give a synced file its name; what has that name already stays, whoever was quicker."""
    try:
        os.link(part, target)
    except FileExistsError as error:
        raise StoreError(
            f"{target}: is there already, from another ingest at this moment or one that was stopped; "
            "`testbench verify` tells which"
        ) from error
    except OSError as error:  # a file system without hard links
        if target.exists():
            raise StoreError(f"{target}: is there already; nothing was replaced") from error
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
