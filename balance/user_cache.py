"""Files that this user's programs keep to be quicker the next time: whole, or else not read; all can be made again."""

import hashlib
import os
import sys
import threading
from contextlib import suppress
from pathlib import Path

_DIGEST = 32


def cache_folder() -> Path:
    """Where they are, by the custom of the operating system."""
    home = Path.home()
    usual = {"win32": home / "AppData" / "Local", "darwin": home / "Library" / "Caches"}
    chosen = os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME")
    return (Path(chosen) if chosen else usual.get(sys.platform, home / ".cache")) / "counterpoise"


def read_cached(path: Path, limit: int) -> bytes | None:
    """What :func:`write_cached` wrote at ``path``; None where there is none, or other bytes, or more than ``limit``."""
    try:
        with path.open("rb") as file:
            content = file.read(limit + _DIGEST + 1)
    except OSError:
        return None
    digest, content = content[:_DIGEST], content[_DIGEST:]
    return content if len(content) <= limit and hashlib.sha256(content).digest() == digest else None


def write_cached(path: Path, content: bytes) -> None:
    """Keep ``content`` at ``path`` with its digest, at once or not at all. Raises OSError where it cannot be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{os.getpid()}.{threading.get_ident()}")
    part.write_bytes(hashlib.sha256(content).digest() + content)
    part.replace(path)


def forget_oldest(pattern: str, count: int) -> None:
    """Remove all but the newest ``count`` files of a pattern."""
    with suppress(OSError):  # another process removes them too
        for path in sorted(cache_folder().glob(pattern), key=lambda path: path.stat().st_mtime, reverse=True)[count:]:
            path.unlink(missing_ok=True)
