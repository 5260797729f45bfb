"""Reading bytes of a file without trusting what it says about itself."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..findings import Finding, Refusal
from ..recording import Samples

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
