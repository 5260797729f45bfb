"""The registry of readers: which one reads a file, what each needs installed, and the names of other formats."""

import re
import struct
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib import import_module, metadata
from importlib.util import find_spec
from itertools import accumulate, chain
from pathlib import Path
from typing import TYPE_CHECKING

from balance.errors import suggestion

from ..errors import RecordingError
from ..recording import Finding, Recording, Refusal
from .header_claims import with_stated_origin
from .subprocess_reader import open_in_subprocess

if TYPE_CHECKING:
    from .import_description import ImportDescription

ENTRY_POINTS = "counterpoise.readers"
HEAD_BYTES = 4096
EXTRAS = {
    "excel": ("openpyxl",),
    "tdms": ("nptdms",),
    "ide": ("idelib",),
    "mcap": ("mcap", "rosbags", "google.protobuf"),
    "parquet": ("pyarrow",),
    "rosbag": ("rosbags",),
    "ulog": ("pyulog",),
}
"""Modules that a reader imports and that only an extra of the distribution installs."""


@dataclass(frozen=True)
class ReadOptions:
    """What a person states about a file, where the reader is not to detect it; None: detect."""

    encoding: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    header: bool | None = None
    date_order: str | None = None
    """``dmy``, ``mdy``, ``ymd``: order of dates such as 03/04/2024, where no number above 12 settles it."""
    description: "ImportDescription | None" = None
    """What is stated of the logger; the options above go before it."""


@dataclass(frozen=True)
class Reader:
    """One format.

    ``identify`` tests the file's first bytes; ``open`` reads the header and returns the recording; ``needs`` names
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


def _reader(
    name: str, extensions: str, sign: bytes | Callable[[bytes], bool], place: str, extra: str = "", apart: bool = False
) -> Reader:
    """A row: files whose first bytes match ``sign`` are opened by the function at ``place``, imported only then.

    What ``extra`` installs must be there. ``apart``: in a process of its own.
    """
    module, _, function = f"{__package__}.{place}".partition(":")

    def opened(path: Path, options: ReadOptions) -> Recording:
        for name in EXTRAS.get(extra, ()):  # none is imported
            if any(find_spec(part) is None for part in accumulate(name.split("."), "{}.{}".format)):  # outer one first
                raise RecordingError(f"{path}: reading it needs {name}: pip install '{needs(extra)}'")
        if apart:
            return open_in_subprocess(path, module, function)
        recording: Recording = getattr(import_module(module), function)(path, options)
        return recording

    identify = partial(_matches, sign) if isinstance(sign, bytes) else sign
    return Reader(name, tuple(extensions.split()), identify, opened, needs(extra) if extra else "")


def _matches(pattern: bytes, head: bytes) -> bool:
    return re.match(pattern, head) is not None


def _is_c3d(head: bytes) -> bool:
    """50 (hexadecimal) in the second byte, and the processor's number at the parameters, in blocks of 512 bytes."""
    if len(head) < 512 or head[1] != 0x50 or not head[0]:
        return False
    at = (head[0] - 1) * 512
    return at + 4 > len(head) or head[at + 3] in (84, 85, 86)


def _is_matlab_4(head: bytes) -> bool:
    """A header of version 4: small sides, and a name that MATLAB takes."""
    size = struct.calcsize("5i")
    for order in "<>" if len(head) >= size else "":
        kind, rows, columns, is_complex, length = struct.unpack_from(f"{order}5i", head)
        name = head[size : size + max(0, min(length, 256))]
        known = kind // 1000 == (order == ">") and 0 <= kind % 1000 <= 52 and kind % 10 <= 2
        if known and min(rows, columns) >= 0 and is_complex in (0, 1) and length > 1:
            plain = name[:-1].decode("latin-1")
            return name[-1:] == b"\0" and plain.isidentifier() and plain.isascii()
    return False


def _is_text(head: bytes) -> bool:
    return import_module("testbench.readers.csv.text_blocks").detect_encoding(head) is not None


_HDF5_MARK = b"\x89HDF\r\n\x1a\n"
_FAR_BLOCKS = [HEAD_BYTES << i for i in range(10)]
_HDF5_EXTENSIONS = ".h5 .hdf5 .nxs .nc .mat"
_HDF5 = rb"(?s)(?:.{512}|.{1024}|.{2048})?\x89HDF\r\n\x1a\n"  # it may begin behind other content
_UFF = rb"\s{0,6}-1[ \t]*\r?\n[ \t]*\d{1,5}[bB]?(?:[ \t][^\n]*)?\r?\n"
_TDMS_NEEDS = f"{needs('tdms')} for scales of thermocouples, bridges and tables"
BUILT_IN = (
    _reader("Cortex forces", ".forces", rb"\[Force Data]", "cortex:open_forces"),
    _reader("C3D", ".c3d", _is_c3d, "c3d:open_c3d"),
    _reader("enDAQ IDE", ".ide", rb"(?s)\x1aE\xdf\xa3.{0,56}(?i:mide)", "endaq_ide:open_library", "ide", apart=True),
    _reader("LabVIEW LVM", ".lvm", rb"(?:\xef\xbb\xbf)?LabVIEW Measurement", "lvm:open_lvm"),
    _reader("MATLAB v5", ".mat", rb"(?s)MATLAB 5\.0|.{124}\x00\x01IM", "matlab_worker:open_library", apart=True),
    _reader("MATLAB v4", ".mat", _is_matlab_4, "matlab_worker:open_library", apart=True),
    _reader("HDF5, NeXus, netCDF 4, MATLAB v7.3", _HDF5_EXTENSIONS, _HDF5, "hdf5_worker:open_library", apart=True),
    _reader("ASAM MDF", ".mf4 .mdf", rb"MDF     |UnFinMF ", "mdf.reader:open_mdf"),
    _reader("Parquet", ".parquet .pq", rb"PAR1", "parquet_worker:open_library", "parquet", apart=True),
    _reader("MCAP", ".mcap", rb"\x89MCAP0\r\n", "mcap_worker:open_library", "mcap", apart=True),
    _reader("ROS 1 bag", ".bag", rb"\#ROSBAG V2", "rosbag_worker:open_ros1", "rosbag", apart=True),
    _reader("ROS 2 bag", ".db3", rb"SQLite format 3\x00", "rosbag_worker:open_ros2", "rosbag", apart=True),
    _reader("ULog", ".ulg .ulog", rb"ULog\x01\x12\x35", "ulog_worker:open_library", "ulog", apart=True),
    replace(_reader("NI TDMS", ".tdms", rb"TDS[mh]", "tdms.reader:open_tdms"), needs=_TDMS_NEEDS),
    _reader("Excel workbook", ".xlsx .xlsm", lambda head: format_name(head) == "an .xlsx workbook",
            "xlsx:open_workbook", "excel"),
    _reader("UFF", ".uff .unv", _UFF, "uff:open_uff"),
    _reader("WAV", ".wav", rb"(?s)(?:RIFF|RIFX|RF64|BW64).{4}WAVE", "wav:open_wav"),
    _reader("CSV", ".csv .txt .tsv .dat .asc", _is_text, "csv.reader:open_text"),
)  # fmt: skip
"""The formats that are read, in the order in which they are asked; any other text is CSV, so that it comes last."""


@cache
def entry_points(group: str) -> metadata.EntryPoints:
    """Those of the installed packages, looked for once."""
    return metadata.entry_points(group=group)


def readers() -> list[Reader]:
    """All readers, those of other packages first."""
    others = [entry.load() for entry in sorted(entry_points(group=ENTRY_POINTS), key=lambda e: e.name)]
    return [*others, *BUILT_IN]


def find_reader(path: Path) -> Reader:
    """The reader of the file at ``path``: by its content, else by its extension."""
    head = _first_bytes(path)
    if not head:
        raise Refusal(path.name, Finding("empty_file", None, None, "the file is empty (0 bytes)"))
    known = readers()
    kind = format_name(head)
    by_content = (reader for reader in known if reader.identify(head))
    by_extension = (reader for reader in known if kind is None and path.suffix.lower() in reader.extensions)
    if (found := next(chain(by_content, by_extension), None)) is not None:
        return found
    formats = ", ".join(reader.name for reader in known)
    packed = (kind or "").endswith(("archive", "-compressed"))
    advice = "unpack it and give the log inside" if packed else _ADVICE.get(kind, f"can be read: {formats}")
    message = f"the content is {kind or 'of no format that is known'}; {advice}"
    raise Refusal(path.name, Finding("not_text" if kind is None else "other_format", None, None, message))


def open_recording(path: str | Path, options: ReadOptions | None = None) -> Recording:
    """Open a log file of any known format: its header is read, its data are not yet."""
    path, options = Path(path), options or ReadOptions()
    described = options.description
    if described is not None:
        stated = {key: text for key, text in described.options.items() if getattr(options, key) is None}
        options = replace(options, **stated)  # type: ignore[arg-type]
    recording = with_stated_origin(find_reader(path).open(path, options))
    return recording if described is None else described.applied(recording)


def _first_bytes(path: Path) -> bytes:
    if path.is_dir():
        kinds = Counter(one.suffix for one in path.iterdir() if one.is_file())
        such = f", such as {path}/*{kinds.most_common(1)[0][0]}" if kinds else ""
        raise RecordingError(f"{path}: is a folder; expected log files{such}")
    if path.exists() and not path.is_file():
        raise RecordingError(f"{path}: is a pipe or device; expected a log file on a disk")
    try:
        with path.open("rb") as stream:
            head = stream.read(HEAD_BYTES)
            for at in (
                _FAR_BLOCKS if path.suffix.lower() in _HDF5_EXTENSIONS.split() else ()
            ):  # behind content of others
                stream.seek(at)
                if stream.read(len(_HDF5_MARK)) == _HDF5_MARK:
                    return _HDF5_MARK
            return head
    except FileNotFoundError as error:
        raise RecordingError(no_such_file(path)) from error


def no_such_file(path: Path) -> str:
    """That there is no file at ``path``, and what is called alike; a pattern that the shell passed on matched none."""
    if any(sign in str(path) for sign in "*?["):
        return f"{path}: no file matches; expected a log file"
    beside = path.parent.iterdir() if path.parent.is_dir() else ()
    return f"{path}: no such file; expected a log file{suggestion(path.name, (one.name for one in beside))}"


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
    b"ARROW1": "Arrow",
    b"RIFF": "WAV",
    b"SQLite format 3": "an SQLite database",
    b"\x89PNG": "a PNG image",
    b"\x1aE\xdf\xa3": "EBML, such as an enDAQ IDE recording",
    b"\x89MCAP": "MCAP",
    b"#ROSBAG": "a ROS 1 bag",
    b"LabVIEW Measurement": "LabVIEW LVM",
}


_WORKBOOK, _OTHER_OFFICE = (b"[Content_Types].xml", b"xl/", b"_rels/.rels"), (b"word/", b"ppt/")
_ADVICE: dict[str | None, str] = {
    "an old Office document (perhaps an .xls workbook)": "save it as .xlsx, without a password",
    "netCDF 3": "convert it by `nccopy -k nc4`",
}


def format_name(head: bytes) -> str | None:
    """The name of the format that begins with these bytes, if it is one of the above."""
    if head.startswith(b"PK\x03\x04") and any(part in head for part in _WORKBOOK):
        return "a document of Office, no workbook" if any(p in head for p in _OTHER_OFFICE) else "an .xlsx workbook"
    return next((name for magic, name in _MAGIC.items() if head.startswith(magic)), None)
