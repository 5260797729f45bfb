"""Reading the bytes of a file without trusting what it states about itself, and preparing blocks ahead in threads."""

import ctypes
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from itertools import chain, islice
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..recording import Samples
from .format_findings import cut

BLOCK_BYTES = 8 << 20
"""Size of a block of samples: many a file, few in memory [bytes]."""


def block_samples(channels: int) -> int:
    """Samples of a block of ``channels`` columns of float64."""
    return max(1, BLOCK_BYTES // (8 * max(1, channels)))


def block_spans(samples: int, channels: int) -> Iterator[tuple[int, int]]:
    """First sample and end of the blocks of so many ``samples`` of ``channels`` columns."""
    step = block_samples(channels)
    return ((begin, min(begin + step, samples)) for begin in range(0, samples, step))


class ByteSource:
    """A file read in pieces; one that would lie beyond its end is refused as cut, by its place and name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stream = path.open("rb")
        self.size = os.fstat(self._stream.fileno()).st_size

    def __enter__(self) -> "ByteSource":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stream.close()

    def read(self, offset: int, count: int, what: str) -> bytes:
        """``count`` bytes from ``offset`` on, which are ``what``."""
        if not (offset >= 0 and count >= 0 and offset + count <= self.size):
            raise cut(self.path, f"{what}, {count} bytes at byte {offset}, lies beyond the end at byte {self.size}")
        self._stream.seek(offset)
        data = self._stream.read(count)
        if len(data) != count:
            raise cut(self.path, f"{what} at byte {offset} could not be read; the file has become shorter")
        return data


def decoded(raw: bytes) -> str:
    """A text in UTF-8 where it is that, else in the letters of Western Europe."""
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("cp1252", "replace")


def as_float64(numbers: NDArray[Any]) -> Samples:
    """Numbers (n,) [any unit] as float64 (n,) [the same], bit for bit where it holds them; no warning on any NaN."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(numbers.astype(np.float64))


A = TypeVar("A")
B = TypeVar("B")

WORKERS = 2
DEPTH = 3
"""Items that are prepared at once: what bounds the memory."""
_END: Any = object()
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Options of mallopt."""
_KEPT_BYTES, _LARGEST_KEPT = 128 << 20, 32 << 20
"""Free memory that is kept, and the largest array for which it serves; glibc takes no more [bytes]."""


@cache
def _keep_freed_memory() -> None:
    """Let glibc keep what blocks leave free for the next ones: what it gives back comes back page by page, zeroed.

    https://man7.org/linux/man-pages/man3/mallopt.3.html
    """
    with suppress(OSError, TypeError, AttributeError):  # no C library that can be asked, or another one
        set_option = ctypes.CDLL(None).mallopt
        set_option(_TRIM_THRESHOLD, _KEPT_BYTES)
        set_option(_MMAP_THRESHOLD, _LARGEST_KEPT)


def in_order(prepare: Callable[[A], B], items: Iterable[A]) -> Iterator[B]:
    """``map(prepare, items)``: items are taken by one thread and prepared by others; results in their order."""
    source = iter(items)
    first = list(islice(source, 2))
    if len(first) < 2:  # a small file needs no threads
        yield from map(prepare, first)
        return
    _keep_freed_memory()
    source = chain(first, source)
    del first
    waiting: deque[Future[Any]] = deque()

    def prepared(item: Future[Any]) -> object:
        return _END if (found := item.result()) is _END else prepare(found)

    with ThreadPoolExecutor(1) as reading, ThreadPoolExecutor(WORKERS) as pool:
        try:
            while True:
                while len(waiting) < DEPTH:
                    waiting.append(pool.submit(prepared, reading.submit(next, source, _END)))
                if (result := waiting.popleft().result()) is _END:
                    return
                yield result
        finally:
            for future in waiting:
                future.cancel()
