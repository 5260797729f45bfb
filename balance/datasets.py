"""Shipped data, in a wheel ``balance/_datasets``, in a checkout ``datasets``; and digests of files that are read."""

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import NamedTuple

from .errors import DataError, suggestion

_HERE = Path(__file__).parent
ROOT = _HERE / "_datasets" if (_HERE / "_datasets").is_dir() else _HERE.parent / "datasets"

KINDS = {
    "mechanism": ("mechanisms", ".xml"), "motion": ("motions", ".toml"), "stock": ("stock", ".csv"),
    "rig": ("rigs", ".toml"), "plan": ("plans", ".toml"), "drive": ("drives", ".toml"), "engine": ("engines", ".toml"),
    "linkage": ("linkages", ".toml"), "rotor": ("rotors", ".toml"), "springs": ("springs", ".toml"),
    "robot": ("robots", ".urdf"), "materials": ("materials", ".toml"), "published": ("published", ".json"),
    "import-description": ("loggers", ".toml"),
}  # fmt: skip
"""Folder and ending of each kind of file that is shipped."""


def dataset_names(folder: str, suffix: str) -> list[str]:
    """Names, without ending, of the shipped files of one kind, such as ``dataset_names("mechanisms", ".xml")``."""
    return sorted(path.stem for path in (ROOT / folder).glob(f"*{suffix}"))


def find_dataset(name: str | Path, folder: str, *suffixes: str) -> Path:
    """The file that ``name`` means: a file of the user's, or else a shipped one of ``folder``.

    Raises DataError, listing the shipped names, if there is neither.
    """
    path = Path(name)
    try:
        if path.is_file():
            return path
    except OSError as error:
        raise DataError(f"{str(name)[:60]}...: {error.strerror}") from error
    for suffix in suffixes:
        shipped = ROOT / folder / f"{name}{suffix}"
        if path.name == str(name) and shipped.is_file():
            return shipped
    known = ", ".join(n for suffix in suffixes for n in dataset_names(folder, suffix))
    if str(name) and path.is_dir():
        kinds = " or ".join(suffixes)
        raise DataError(
            f"{name}: is a folder; expected a file ({kinds}), or a shipped one of {folder} (there are: {known})"
        )
    beside = [str(one) for suffix in suffixes for one in path.parent.glob(f"*{suffix}")]
    whole = next((one for one in (f"{name}{suffix}" for suffix in suffixes) if one in beside), None)
    meant = (
        f"; did you mean {whole!r}?"
        if whole
        else suggestion(str(name), [*beside, *(n for suffix in suffixes for n in dataset_names(folder, suffix))])
    )
    given = str(name) or repr("")
    raise DataError(f"{given}: no such file, and no shipped one of that name in {folder}{meant} (there are: {known})")


_READ: ContextVar[list["FileDigest"] | None] = ContextVar("files read", default=None)


class FileDigest(NamedTuple):
    """A file that was read."""

    name: str
    """Without its folder."""
    sha256: str
    """Of its bytes as they were read, 64 hexadecimal digits."""


@contextmanager
def files_read() -> Iterator[list[FileDigest]]:
    """What is read within, in order, each content once; an enclosing context does not have it."""
    found: list[FileDigest] = []
    token = _READ.set(found)
    try:
        yield found
    finally:
        _READ.reset(token)


def note_files(files: Iterable[FileDigest]) -> None:
    """Enter files among those that are read in this context, if there is one."""
    found = _READ.get()
    if found is not None:
        found += [one for one in dict.fromkeys(files) if one not in found]


def text_of(path: Path, encoding: str = "utf-8") -> str:
    """The text of a file, each end of line as one newline; it is entered among those that are read.

    Raises OSError and UnicodeDecodeError as ``Path.read_text`` does.
    """
    content = path.read_bytes()
    text = content.decode(encoding)
    note_files([FileDigest(path.name, hashlib.sha256(content).hexdigest())])
    return text.replace("\r\n", "\n").replace("\r", "\n")
