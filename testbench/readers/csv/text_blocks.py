"""A text file: its encoding, its first and last lines, and all its lines in blocks of ASCII-compatible bytes."""

import codecs
import hashlib
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import FileIO
from pathlib import Path

import numpy as np

from ...errors import RecordingError
from ...recording import ContentDigest, Finding, Refusal
from ..registry import format_name

BLOCK_BYTES = 8 << 20
"""Size of a block: large enough to parse on all cores, small enough for many blocks in memory [bytes]."""
SAMPLE_BYTES = 256 << 10
LONGEST_LINE = 4 << 20
"""A line longer than this is no row of a log [bytes]."""
MOST_LINES = 400
"""First lines, in which names and the first row of data are sought."""
_LAST_BYTES, _LOOK_BACK = 64 << 10, 4096

_NUL_RUN = re.compile(rb"\0{16,}")
_BYTE_ORDER_MARKS = (
    (b"\xef\xbb\xbf", "utf-8"),
    (b"\xff\xfe\x00\x00", "utf-32-le"),
    (b"\x00\x00\xfe\xff", "utf-32-be"),
    (b"\xff\xfe", "utf-16-le"),
    (b"\xfe\xff", "utf-16-be"),
)
_ASCII = "0123456789+-.,;:eE \t\r\n"
_TURKISH = frozenset("çÇğĞıİöÖşŞüÜâÂîÎûÛ")
_TURKISH_OR_WESTERN = frozenset(b"\xd0\xdd\xde\xf0\xfd\xfe")
"""The only bytes in which Windows-1254 (Turkish) and Windows-1252 (Western) both have a letter, and another one."""


@dataclass(frozen=True)
class Encoding:
    """An encoding, the bytes of its mark at the start of the file, and why it was taken if that was inferred."""

    name: str
    mark: int = 0
    inferred: str = ""

    @property
    def keeps_ascii(self) -> bool:
        """Whether digits and delimiters are the same bytes as in ASCII."""
        return _ASCII.encode(self.name) == _ASCII.encode("ascii")

    @property
    def name_in_blocks(self) -> str:
        """The encoding of the file's blocks: its own if that keeps ASCII, else UTF-8."""
        return self.name if self.keeps_ascii else "utf-8"


def detect_encoding(head: bytes) -> Encoding | None:
    """The encoding of a file that begins with ``head``: by its mark, else UTF-8 if valid, else by the letters it holds.

    None if it is no text.
    """
    for mark, name in _BYTE_ORDER_MARKS:
        if head.startswith(mark):
            return Encoding(name, len(mark))
    if format_name(head) is not None:
        return None
    pairs = head[: len(head) // 2 * 2]  # in ASCII text as UTF-16 every other byte is zero
    even, odd = pairs[0::2].count(0), pairs[1::2].count(0)
    if pairs and max(even, odd) >= 0.4 * len(pairs) / 2 and min(even, odd) <= 0.02 * len(pairs) / 2:
        name = "utf-16-le" if odd > even else "utf-16-be"
        return Encoding(name, 0, "every other byte is zero, and there is no byte order mark")
    rest = _NUL_RUN.sub(b"", head)  # long runs of NUL are what a logger's power failure leaves in a text
    control = sum(rest.count(c) for c in range(32) if c not in b"\t\n\r\f\x1a\x00")
    if not rest or control > 0.005 * len(rest) or rest.count(0) > 0.3 * len(rest):
        return None
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 3 or error.reason != "unexpected end of data":
            return _single_byte_encoding(head)
    return Encoding("utf-8")


def _single_byte_encoding(head: bytes) -> Encoding:
    high = {b for b in head if b >= 0x80}
    letters = {c for c in bytes(sorted(high)).decode("cp1254", "replace") if c.isalpha()}
    if high & _TURKISH_OR_WESTERN and letters <= _TURKISH:
        listed = "".join(sorted(letters))
        return Encoding("cp1254", 0, f"not UTF-8, and its letters are those of Turkish ({listed})")
    try:
        bytes(sorted(high)).decode("cp1252")
    except UnicodeDecodeError:
        return Encoding("latin-1", 0, "not UTF-8, and with bytes that Windows-1252 does not have")
    return Encoding("cp1252", 0, "not UTF-8, and without a letter that is Turkish alone")


def _stated_encoding(path: Path, head: bytes, name: str) -> Encoding:
    """The encoding that a person states; a byte order mark has the last word."""
    try:
        "".encode(name)  # unlike codecs.lookup, refuses codecs that are no text encodings
        known = codecs.lookup(name).name
    except LookupError as error:
        raise RecordingError(
            f"{path.name}: {name!r} is no encoding that is known; for example utf-8, utf-16, cp1254, cp1252"
        ) from error
    detected = detect_encoding(head)
    if detected is not None and detected.mark:
        return Encoding(detected.name, detected.mark)
    return Encoding("utf-16-le" if known == "utf-16" else known)


def read_first_lines(
    path: Path, stated_encoding: str | None = None, above: int = 0
) -> tuple[Encoding, tuple[str, ...]]:
    """The encoding and the first whole lines of the file at ``path``, from which dialect and header are detected.

    A stated encoding is not detected. ``above`` is how many lines a person states to stand above the data: the first
    lines begin anew below them. Raises Refusal if it is no text.
    """
    with path.open("rb") as stream:
        head = stream.read(SAMPLE_BYTES)
        while above and head.count(b"\n") < above and (further := stream.readline(LONGEST_LINE)):
            head += further
        if above:
            head += stream.read(SAMPLE_BYTES)
        more = bool(stream.peek(1)) if len(head) >= SAMPLE_BYTES else False
        if more and head.count(b"\n") < 3:
            head += stream.read(LONGEST_LINE)
            more = bool(stream.peek(1))
    if not head:
        raise Refusal(path.name, Finding("empty_file", None, None, "the file is empty (0 bytes)"))
    encoding = _stated_encoding(path, head, stated_encoding) if stated_encoding else detect_encoding(head)
    if encoding is None:
        kind = format_name(head) or ("nothing but NUL bytes" if not head.strip(b"\0") else "binary")
        raise Refusal(path.name, Finding("not_text", None, None, f"expected text, the content is {kind}"))
    try:
        text = codecs.getincrementaldecoder(encoding.name)("strict").decode(head[encoding.mark :])
    except UnicodeDecodeError as error:
        message = f"byte {error.start} is not {encoding.name} ({error.reason}); say another --encoding"
        raise Refusal(path.name, Finding("unknown_encoding", None, None, message)) from error
    lines = _split_lines(text)
    if more and len(lines[-1]) > LONGEST_LINE // 2:
        raise _too_long(path, len(lines))
    if more or len(lines) > 2:
        lines.pop()  # it may be cut
    return encoding, tuple(lines[: above + MOST_LINES])


def first_line(path: Path, encoding: Encoding, wanted: Callable[[str], bool]) -> list[str]:
    """The first line of all the file that is ``wanted``, if there is one."""
    with path.open(encoding=encoding.name, errors="replace") as stream:
        while line := stream.readline(LONGEST_LINE):
            if wanted(line):
                return [line.rstrip("\n")]
    return []


def read_last_lines(path: Path, encoding: Encoding) -> list[str]:
    """The last whole lines of the file, which show how far its dates and counts go."""
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(encoding.mark, (size - _LAST_BYTES) // 4 * 4))
        return _split_lines(stream.read().decode(encoding.name, "replace"))[1:-1]


def _split_lines(text: str) -> list[str]:
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


@dataclass(frozen=True)
class TextBlock:
    """Whole lines, each with its line feed; the file's line of the first; the rest after the last one.

    ``rest`` is empty but in the file's last block, and there only if the last line has no end. Where nobody counts the
    lines, ``first`` is that of the first block.
    """

    text: bytes
    first: int
    rest: bytes = b""
    bytes_read: int = 0


def read_blocks(
    path: Path, encoding: Encoding, first_line: int, counted: bool = True, content: ContentDigest | None = None
) -> Iterator[TextBlock]:
    """The lines from ``first_line`` (counted from 1) on, in blocks; not ``counted`` where the caller does it.

    ``content`` gets the file's digest if that is wanted.
    """
    line, rest, bytes_read = 1, b"", 0
    for raw in _chunks(path, encoding, content or ContentDigest()):
        bytes_read += len(raw)
        if raw.endswith(b"\n") and not rest:
            whole = raw
        else:
            data = rest + raw
            end = data.rfind(b"\n") + 1
            whole, rest = data[:end], data[end:]
        if len(rest) > LONGEST_LINE:
            raise _too_long(path, line + count_lines(whole))
        skipped = 0
        while line < first_line and (at := whole.find(b"\n", skipped)) >= 0:
            line, skipped = line + 1, at + 1
        if skipped < len(whole):
            text = whole[skipped:] if skipped else whole
            yield TextBlock(text, line, bytes_read=bytes_read)
            line += count_lines(text) if counted else 0
    if rest:
        yield TextBlock(b"", line, rest, bytes_read)


def count_lines(text: bytes) -> int:
    """How many line feeds there are; five times as fast as ``bytes.count``."""
    return int(np.count_nonzero(np.frombuffer(text, dtype=np.uint8) == ord("\n")))


def _too_long(path: Path, line: int) -> Refusal:
    message = f"a line longer than {LONGEST_LINE >> 20} MiB; this is no log with one row a line"
    return Refusal(path.name, Finding("line_too_long", None, f"line {line}", message))


def _chunks(path: Path, encoding: Encoding, content: ContentDigest) -> Iterator[bytes]:
    """The file's content after its mark; other encodings than ASCII's kin as UTF-8, line ends as line feeds."""
    decoder = None if encoding.keeps_ascii else codecs.getincrementaldecoder(encoding.name)("replace")
    returns_only: bool | None = None
    content.sha256 = ""
    with path.open("rb", buffering=0) as stream:
        total = hashlib.sha256(stream.read(encoding.mark))
        while raw := stream.read(_to_line_end(stream, BLOCK_BYTES)):
            if content.wanted:
                total.update(raw)
            if decoder is not None:
                raw = decoder.decode(raw).encode("utf-8", "replace")
            if returns_only is None:
                returns_only = b"\r" in raw and b"\n" not in raw
            yield raw.replace(b"\r", b"\n") if returns_only else raw
    content.sha256 = total.hexdigest() if content.wanted else ""
    if decoder is not None and (tail := decoder.decode(b"", final=True)):
        yield tail.encode("utf-8", "replace")


def _to_line_end(stream: FileIO, size: int) -> int:
    """How much of the next ``size`` bytes ends with a line feed: no line need be put together from two reads then."""
    at = stream.tell()
    stream.seek(max(at, at + size - _LOOK_BACK))
    found = stream.tell() - at + stream.read(min(size, _LOOK_BACK)).rfind(b"\n") + 1
    stream.seek(at)
    return found if found > max(0, size - _LOOK_BACK) else size
