"""Files that this user's programs keep to be quicker the next time: whole, or else not read; all can be made again.

Machine code is among them: what another user could have written is not read.
"""

import hashlib
import os
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

_DIGEST = 32


def cache_folder() -> Path:
    """Where they are, by the custom of the operating system. Raises OSError for a user without a home."""
    chosen = os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME", "")
    if os.path.isabs(chosen):  # another is to be passed over, says the XDG Base Directory Specification
        return Path(chosen, "counterpoise")
    try:
        home = Path.home()
    except RuntimeError as error:
        raise OSError("there is no home folder to keep files in; XDG_CACHE_HOME can name a folder") from error
    usual = {"win32": home / "AppData" / "Local", "darwin": home / "Library" / "Caches"}
    return usual.get(sys.platform, home / ".cache") / "counterpoise"


def read_cached(path: Path, limit: int) -> bytes | None:
    """What :func:`write_cached` wrote at ``path`` for this user; None where there is none, or more than ``limit``."""
    try:
        with path.open("rb") as file:
            state = os.fstat(file.fileno())
            if sys.platform != "win32" and (state.st_uid != os.geteuid() or state.st_mode & 0o022):
                return None
            content = file.read(limit + _DIGEST + 1)
    except OSError:
        return None
    digest, content = content[:_DIGEST], content[_DIGEST:]
    return content if len(content) <= limit and hashlib.sha256(content).digest() == digest else None


def write_cached(path: Path, content: bytes) -> None:
    """Keep ``content`` at ``path`` with its digest, at once or not at all. Raises OSError where it cannot be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, part = tempfile.mkstemp(dir=path.parent, prefix=f"{path.name}.")  # for this user's eyes
    try:
        with open(handle, "wb") as file:
            file.write(hashlib.sha256(content).digest() + content)
        Path(part).replace(path)
    except BaseException:
        Path(part).unlink()
        raise


def forget_oldest(pattern: str, count: int) -> None:
    """Remove all but the newest ``count`` files of a pattern."""
    with suppress(OSError):  # another process removes them too
        for path in sorted(cache_folder().glob(pattern), key=lambda path: path.stat().st_mtime, reverse=True)[count:]:
            path.unlink(missing_ok=True)
