"""The first lines of a text file, from which encoding, dialect and header are told."""

import codecs
from dataclasses import dataclass
from pathlib import Path

from ...errors import RecordingError
from ...findings import Finding, Refusal
from ..registry import known_as
from . import encoding as encodings
from .encoding import Encoding
from .lines import LONGEST_LINE, too_long

SAMPLE_BYTES = 256 << 10
MOST_LINES = 400
_LAST_BYTES = 64 << 10


@dataclass(frozen=True)
class Sample:
    """Encoding and first whole lines of a file."""

    encoding: Encoding
    lines: tuple[str, ...]


def take(path: Path, given: str | None = None) -> Sample:
    """The sample of the file at ``path``; a ``given`` encoding is not detected."""
    with path.open("rb") as stream:
        head = stream.read(SAMPLE_BYTES)
        more = bool(stream.peek(1)) if len(head) == SAMPLE_BYTES else False
        if more and head.count(b"\n") < 3:
            head += stream.read(LONGEST_LINE)
            more = bool(stream.peek(1))
    if not head:
        raise Refusal(path.name, Finding("empty_file", None, None, "the file is empty (0 bytes)"))
    encoding = _given(path, head, given) if given else encodings.detect(head)
    if encoding is None:
        kind = known_as(head) or ("nothing but NUL bytes" if not head.strip(b"\0") else "binary")
        raise Refusal(path.name, Finding("not_text", None, None, f"expected text, the content is {kind}"))
    lines = _decoded(path, head[encoding.mark :], encoding).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if more and len(lines[-1]) > LONGEST_LINE // 2:
        raise too_long(path, len(lines))
    if more or len(lines) > 2:
        lines.pop()  # it may be cut
    return Sample(encoding, tuple(lines[:MOST_LINES]))


def last_lines(path: Path, encoding: Encoding) -> list[str]:
    """The last whole lines of the file, from which its last dates are told."""
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(encoding.mark, (size - _LAST_BYTES) // 4 * 4))
        text = stream.read().decode(encoding.name, "replace")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")[1:-1]


def _given(path: Path, head: bytes, name: str) -> Encoding:
    try:
        "".encode(name)  # unlike codecs.lookup, refuses codecs that are no text encodings
        known = codecs.lookup(name).name
    except LookupError as error:
        raise RecordingError(
            f"{path.name}: {name!r} is no encoding that is known; for example utf-8, utf-16, cp1254, cp1252"
        ) from error
    detected = encodings.detect(head)
    if detected is not None and detected.mark:
        return Encoding(detected.name, detected.mark)
    return Encoding("utf-16-le" if known == "utf-16" else known)


def _decoded(path: Path, head: bytes, encoding: Encoding) -> str:
    decoder = codecs.getincrementaldecoder(encoding.name)("strict")
    try:
        return decoder.decode(head)
    except UnicodeDecodeError as error:
        message = f"byte {error.start} is not {encoding.name} ({error.reason}); say another --encoding"
        raise Refusal(path.name, Finding("unknown_encoding", None, None, message)) from error
