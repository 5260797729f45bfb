"""SHA-256 of files, and the digest that lies beside each stored run, as ``sha256sum`` writes it."""

import hashlib
import re
from collections.abc import Callable
from pathlib import Path

from ..errors import StoreError

SUFFIX = ".sha256"
_BLOCK = 1 << 20
_LINE = re.compile(r"([0-9a-f]{64}) [ *](.+)\n")


def sha256_of(path: Path, progress: Callable[[int], None] = lambda count: None) -> str:
    """SHA-256 of a file's content, in hexadecimal; ``progress`` is told how many bytes were read since last."""
    total = hashlib.sha256()
    with path.open("rb", buffering=0) as stream:
        while block := stream.read(_BLOCK):
            total.update(block)
            progress(len(block))
    return total.hexdigest()


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
