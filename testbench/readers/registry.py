"""The one registry of readers: how a file finds its own, what each needs installed, what other files are called."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

from ..errors import RecordingError
from ..findings import Finding, Refusal
from ..recording import Recording
from .origin import with_stated

ENTRY_POINTS = "counterpoise.readers"
BUILT_IN = (
    "testbench.readers.cortex",
    "testbench.readers.c3d.reader",
    "testbench.readers.ide.reader",
    "testbench.readers.lvm.reader",
    "testbench.readers.matlab:MATLAB_5",
    "testbench.readers.matlab:MATLAB_4",
    "testbench.readers.hdf5.reader",
    "testbench.readers.mdf.reader",
    "testbench.readers.parquet.reader",
    "testbench.readers.ros_files:MCAP",
    "testbench.readers.ros_files:ROS_BAG",
    "testbench.readers.tdms.reader",
    "testbench.readers.uff.reader",
    "testbench.readers.wav",
    "testbench.readers.csv.reader",  # any other text, so that it comes last
)
HEAD_BYTES = 4096
EXTRAS = {
    "tdms": ("nptdms",),
    "ide": ("idelib",),
    "mcap": ("mcap", "rosbags", "google.protobuf"),
    "parquet": ("polars",),
    "rosbag": ("rosbags",),
}
"""Modules that a reader imports and that only an extra of the distribution installs."""


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


def needs(extra: str) -> str:
    """What must be installed for the formats of ``extra``, as pip names it."""
    return f"counterpoise[{extra}]"


def require(extra: str, path: Path) -> None:
    """Raise RecordingError where a library of ``extra`` is missing, naming what to install; none is imported."""
    for name in EXTRAS[extra]:
        if any(find_spec(part) is None for part in _packages(name)):
            raise RecordingError(f"{path}: reading it needs {name}: pip install '{needs(extra)}'")


def _packages(name: str) -> Iterator[str]:
    """``google.protobuf`` as ``google`` and ``google.protobuf``: the inner one is looked for where the outer one is."""
    for i, letter in enumerate(f"{name}."):
        if letter == ".":
            yield name[:i]


def readers() -> list[Reader]:
    """All readers, those of other packages first."""
    others = [entry.load() for entry in sorted(entry_points(group=ENTRY_POINTS), key=lambda e: e.name)]
    built_in = (entry.partition(":") for entry in BUILT_IN)
    return [*others, *(getattr(import_module(module), name or "READER") for module, _, name in built_in)]


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
    """That there is no file at ``path``; a pattern that the shell passed on matched none."""
    if any(sign in str(path) for sign in "*?["):
        return f"{path}: no file matches; expected a log file"
    return f"{path}: no such file; expected a log file"


_MAGIC = {
    b"PK\x03\x04": "a ZIP archive",
    b"\x1f\x8b": "gzip-compressed",
    b"7z\xbc\xaf\x27\x1c": "a 7-Zip archive",
    b"Rar!": "a RAR archive",
    b"BZh": "bzip2-compressed",
    b"\xfd7zXZ": "xz-compressed",
    b"\x28\xb5\x2f\xfd": "zstd-compressed",
    b"%PDF": "a PDF document",
    b"\xd0\xcf\x11\xe0": "an old Office document (perhaps an .xls workbook)",
    b"\x89HDF": "HDF5",
    b"CDF\x01": "netCDF 3",
    b"CDF\x02": "netCDF 3",
    b"CDF\x05": "netCDF 3",
    b"TDSm": "NI TDMS",
    b"MDF     ": "ASAM MDF",
    b"UnFinMF ": "an unfinished ASAM MDF",
    b"MATLAB 5.0": "MATLAB v5",
    b"PAR1": "Parquet",
    b"ARROW1": "Arrow",
    b"RIFF": "WAV",
    b"SQLite format 3": "an SQLite database",
    b"\x89PNG": "a PNG image",
    b"\x1aE\xdf\xa3": "EBML, such as an enDAQ IDE recording",
    b"\x89MCAP": "MCAP",
    b"#ROSBAG": "a ROS 1 bag",
    b"LabVIEW Measurement": "LabVIEW LVM",
}


_WORKBOOK = (b"[Content_Types].xml", b"xl/", b"_rels/.rels")
_TO_DO = {
    "an .xlsx workbook": "save its sheet as CSV",
    "an old Office document (perhaps an .xls workbook)": "save its sheet as CSV",
    "netCDF 3": "convert it by `nccopy -k nc4`",
    "a ZIP archive": "unpack it and give the log inside",
    "gzip-compressed": "unpack it and give the log inside",
    "a 7-Zip archive": "unpack it and give the log inside",
    "a RAR archive": "unpack it and give the log inside",
    "bzip2-compressed": "unpack it and give the log inside",
    "xz-compressed": "unpack it and give the log inside",
    "zstd-compressed": "unpack it and give the log inside",
}


def to_do(kind: str | None) -> str:
    """What a person can do with a file of a kind that is not read; empty if nothing is known."""
    return _TO_DO.get(kind or "", "")


def known_as(head: bytes) -> str | None:
    """The name of the format that begins with these bytes, if it is one of the above."""
    if head.startswith(b"PK\x03\x04") and any(part in head for part in _WORKBOOK):
        return "an .xlsx workbook"
    for magic, name in _MAGIC.items():
        if head.startswith(magic):
            return name
    return None
