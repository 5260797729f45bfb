"""Which encoding a text is in: by its mark, else UTF-8 if it is valid, else by the letters that it would hold."""

import re
from dataclasses import dataclass

from ..registry import known_as

_NUL_RUN = re.compile(rb"\0{16,}")
_MARKS = (
    (b"\xef\xbb\xbf", "utf-8"),
    (b"\xff\xfe\x00\x00", "utf-32-le"),
    (b"\x00\x00\xfe\xff", "utf-32-be"),
    (b"\xff\xfe", "utf-16-le"),
    (b"\xfe\xff", "utf-16-be"),
)
_ASCII = "0123456789+-.,;:eE \t\r\n"
_TURKISH = frozenset("çÇğĞıİöÖşŞüÜâÂîÎûÛ")
# The only bytes in which Windows-1254 (Turkish) and Windows-1252 (Western) both have a letter, and not the same one.
_APART = frozenset(b"\xd0\xdd\xde\xf0\xfd\xfe")


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


def detect(head: bytes) -> Encoding | None:
    """The encoding of a file that begins with ``head``; None if it is no text."""
    for mark, name in _MARKS:
        if head.startswith(mark):
            return Encoding(name, len(mark))
    if known_as(head) is not None:
        return None
    if (wide := _without_mark(head)) is not None:
        return wide
    if _looks_binary(head):
        return None
    if _is_utf8(head):
        return Encoding("utf-8")
    return _single_byte(head)


def _without_mark(head: bytes) -> Encoding | None:
    """UTF-16 without a mark: in ASCII text every other byte is zero."""
    pairs = head[: len(head) // 2 * 2]
    even, odd = pairs[0::2].count(0), pairs[1::2].count(0)
    if not pairs or max(even, odd) < 0.4 * len(pairs) / 2 or min(even, odd) > 0.02 * len(pairs) / 2:
        return None
    name = "utf-16-le" if odd > even else "utf-16-be"
    return Encoding(name, 0, "every other byte is zero, and there is no byte order mark")


def without_nul_runs(head: bytes) -> bytes:
    """The bytes without long runs of NUL, as a logger leaves them in a text when its power fails."""
    return _NUL_RUN.sub(b"", head)


def _looks_binary(head: bytes) -> bool:
    head = without_nul_runs(head)
    control = sum(head.count(c) for c in range(32) if c not in b"\t\n\r\f\x1a\x00")
    return not head or control > 0.005 * len(head) or head.count(0) > 0.3 * len(head)


def _is_utf8(head: bytes) -> bool:
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        return error.start >= len(head) - 3 and error.reason == "unexpected end of data"
    return True


def _single_byte(head: bytes) -> Encoding:
    high = {b for b in head if b >= 0x80}
    letters = {c for c in bytes(sorted(high)).decode("cp1254", "replace") if c.isalpha()}
    if high & _APART and letters <= _TURKISH:
        shown = "".join(sorted(letters))
        return Encoding("cp1254", 0, f"not UTF-8, and its letters are those of Turkish ({shown})")
    try:
        bytes(sorted(high)).decode("cp1252")
    except UnicodeDecodeError:
        return Encoding("latin-1", 0, "not UTF-8, and with bytes that Windows-1252 does not have")
    return Encoding("cp1252", 0, "not UTF-8, and without a letter that is Turkish alone")
