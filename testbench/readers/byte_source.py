"""Reading bytes of a file without trusting what it says about itself.

Working ahead: the next items are read and prepared in threads while this one is used.

Samples of binary formats that are no finite number: kept as they are, counted and said by channel.
"""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..recording import Block, Finding, Group, Refusal, Report, Samples

BLOCK_BYTES = 8 << 20
"""Size of a block of samples: many a file, few in memory [bytes]."""


def block_samples(channels: int) -> int:
    """Samples of a block of ``channels`` columns of float64."""
    return max(1, BLOCK_BYTES // (8 * max(1, channels)))


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


def as_float64(numbers: NDArray[Any]) -> Samples:
    """Numbers as float64, bit for bit where it holds them; a signalling NaN raises no alarm."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(numbers.astype(np.float64))


def cut(path: Path, message: str) -> Refusal:
    """The refusal of a file that ends too early."""
    return Refusal(path.name, Finding("cut_file", None, None, message))


def damaged(path: Path, message: str) -> Refusal:
    """The refusal of a file that contradicts itself."""
    return Refusal(path.name, Finding("damaged_file", None, None, message))


@contextmanager
def refusing(path: Path, what: str, *errors: type[Exception]) -> Iterator[None]:
    """Make ``errors`` of reading ``what`` a refusal of the file as damaged."""
    try:
        yield
    except errors as error:
        raise damaged(path, f"{what} cannot be read: {type(error).__name__}: {error}") from error


A = TypeVar("A")
B = TypeVar("B")

WORKERS = 2
DEPTH = 3
"""Items in the air at once: what bounds the memory."""
_END: Any = object()


def in_order(prepare: Callable[[A], B], items: Iterable[A]) -> Iterator[B]:
    """``map(prepare, items)``: items are taken by one thread and prepared by others; results in their order."""
    source = iter(items)
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


def watch_nonfinite(blocks: Iterable[Block], report: Report, but: Group | None = None) -> Iterator[Block]:
    """The same blocks; at their end, channels with samples that are not finite are reported, ``but`` those of one."""
    counts: dict[tuple[str, int], int] = {}
    first: dict[tuple[str, int], tuple[str, str]] = {}
    for block in blocks:
        for i, column in enumerate(block.columns if block.group is not but else ()):
            if number := int(np.count_nonzero(~np.isfinite(column))):
                key = (block.group.name, i)
                counts[key] = counts.get(key, 0) + number
                place = block.where(int(np.flatnonzero(~np.isfinite(column))[0]))
                first.setdefault(key, (block.group.channels[i].name, place))
        yield block
    for key, number in counts.items():
        channel, place = first[key]
        message = f"{number} samples of group {key[0]!r} are no finite number, the first is {place}"
        report(Finding("not_a_number", channel, place, message))
