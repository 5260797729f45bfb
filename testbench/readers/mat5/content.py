"""The bytes of one variable: where they lie in the file, or unpacked beside it."""

import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import IO

from ...findings import Finding, Refusal
from ..stream import ByteSource, cut, damaged

_IN_MEMORY = 32 << 20
_PIECE = 1 << 18
_MOST_RATIO, _ALWAYS_ALLOWED = 200, 64 << 20


class Content:
    """Bytes from ``begin`` to before ``end`` of a file."""

    def __init__(self, source: ByteSource, begin: int, end: int) -> None:
        self.path: Path = source.path
        self._source, self._begin, self.size = source, begin, end - begin

    def read(self, offset: int, count: int, what: str) -> bytes:
        """``count`` bytes from ``offset`` on."""
        if offset < 0 or count < 0 or offset + count > self.size:
            raise damaged(self.path, f"{what} lies beyond the end of its variable")
        return self._source.read(self._begin + offset, count, what)


class Spool:
    """Where compressed variables are unpacked to: memory if they are small, else a temporary file without a name."""

    def __init__(self) -> None:
        self.stream: IO[bytes] = tempfile.SpooledTemporaryFile(max_size=_IN_MEMORY)  # noqa: SIM115 (closed on leaving)
        self.size = 0

    def __enter__(self) -> "Spool":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stream.close()


class Unpacked(Content):
    """The compressed bytes from ``begin`` to before ``end`` of a file, unpacked."""

    def __init__(self, source: ByteSource, begin: int, end: int, spool: Spool) -> None:
        super().__init__(source, begin, end)
        self._spool, self._base, self.size, packed = spool, spool.size, 0, end - begin
        spool.stream.seek(spool.size)
        for piece in _inflated(source, begin, end):
            spool.stream.write(piece)
            self.size += len(piece)
            if self.size > max(_ALWAYS_ALLOWED, _MOST_RATIO * packed):
                message = f"{packed} bytes at byte {begin} unpack to more than {_MOST_RATIO} times as many"
                raise Refusal(source.path.name, Finding("too_large", None, f"byte {begin}", message))
        spool.size += self.size

    def read(self, offset: int, count: int, what: str) -> bytes:
        """``count`` bytes from ``offset`` on."""
        if offset < 0 or count < 0 or offset + count > self.size:
            raise damaged(self.path, f"{what} lies beyond the end of its variable")
        self._spool.stream.seek(self._base + offset)
        return self._spool.stream.read(count)


def _inflated(source: ByteSource, begin: int, end: int) -> Iterator[bytes]:
    """The unpacked bytes, in pieces."""
    unpack = zlib.decompressobj()
    try:
        for offset in range(begin, end, _PIECE):
            rest = source.read(offset, min(_PIECE, end - offset), "a compressed variable")
            while rest:
                if piece := unpack.decompress(rest, _PIECE):
                    yield piece
                rest = unpack.unconsumed_tail
        if piece := unpack.flush():
            yield piece
    except zlib.error as error:
        raise damaged(source.path, f"the compressed variable at byte {begin} cannot be unpacked ({error})") from error
    if not unpack.eof:
        raise cut(source.path, f"the compressed variable at byte {begin} ends too early")
