"""The one registry of readers."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path

from ..errors import RecordingError
from ..findings import Finding, Refusal
from ..recording import Recording
from .magic import known_as, to_do
from .origin import with_stated

ENTRY_POINTS = "counterpoise.readers"
BUILT_IN = (
    "testbench.readers.cortex",
    "testbench.readers.c3d.reader",
    "testbench.readers.ide.reader",
    "testbench.readers.lvm.reader",
    "testbench.readers.mat5.reader",
    "testbench.readers.mat4",
    "testbench.readers.hdf5.reader",
    "testbench.readers.mcap.reader",
    "testbench.readers.mdf.reader",
    "testbench.readers.parquet.reader",
    "testbench.readers.rosbag.reader",
    "testbench.readers.tdms.reader",
    "testbench.readers.uff.reader",
    "testbench.readers.wav",
    "testbench.readers.csv.reader",  # any other text, so that it comes last
)
HEAD_BYTES = 4096


@dataclass(frozen=True)
class ReadOptions:
    """What a person says about a file, where the reader is not to detect it; None: detect."""

    encoding: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    header: bool | None = None
    date_order: str | None = None
    """``dmy``, ``mdy``, ``ymd``: of dates such as 03/04/2024, where no number above 12 tells."""


@dataclass(frozen=True)
class Reader:
    """One format.

    ``identify`` judges the file's first bytes; ``open`` reads the header and returns the recording; ``needs`` says
    what must be installed.
    """

    name: str
    extensions: tuple[str, ...]
    identify: Callable[[bytes], bool]
    open: Callable[[Path, ReadOptions], Recording]
    needs: str = ""


def readers() -> list[Reader]:
    """All readers, those of other packages first."""
    others = [entry.load() for entry in sorted(entry_points(group=ENTRY_POINTS), key=lambda e: e.name)]
    return [*others, *(import_module(name).READER for name in BUILT_IN)]


def find_reader(path: Path) -> Reader:
    """The reader of the file at ``path``: by its content, else by its extension."""
    head = _head(path)
    if not head:
        raise Refusal(path.name, Finding("empty_file", None, None, "the file is empty (0 bytes)"))
    known = readers()
    for reader in known:
        if reader.identify(head):
            return reader
    if (kind := known_as(head)) is None:
        for reader in known:
            if path.suffix.lower() in reader.extensions:
                return reader
    formats = ", ".join(reader.name for reader in known)
    advice = to_do(kind) or f"can be read: {formats}"
    found = f"the content is {kind or 'of no format that is known'}; {advice}"
    raise Refusal(path.name, Finding("not_text" if kind is None else "other_format", None, None, found))


def open_recording(path: str | Path, options: ReadOptions | None = None) -> Recording:
    """Open a log file of any known format: its header is read, its data are not yet."""
    path = Path(path)
    return with_stated(find_reader(path).open(path, options or ReadOptions()))


def _head(path: Path) -> bytes:
    if path.is_dir():
        raise RecordingError(f"{path}: is a folder; expected a log file")
    if path.exists() and not path.is_file():
        raise RecordingError(f"{path}: is a pipe or device; expected a log file on a disk")
    try:
        with path.open("rb") as stream:
            return stream.read(HEAD_BYTES)
    except FileNotFoundError as error:
        raise RecordingError(missing(path)) from error


def missing(path: Path) -> str:
    """That there is no file at ``path``; a pattern that the shell left as it was matched none."""
    if any(sign in str(path) for sign in "*?["):
        return f"{path}: no file matches; expected a log file"
    return f"{path}: no such file; expected a log file"
