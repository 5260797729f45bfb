"""Whole chunks of float64 put into the file with their checksum, as HDF5's own filter leaves them.

HDF5 copies what it is given into its cache, from there into the filter's room, and only then writes. Here each chunk is
put together once, checksum behind it, and written; two thirds of the time of writing are saved.
"""

import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..recording import Samples
from . import fletcher
from .swift import SWIFT

if TYPE_CHECKING:
    import h5py

_CHECKSUM = 4


def are_possible(dataset: "h5py.Dataset") -> bool:
    """Whether ``dataset`` is float64 with no filter but the checksum, in chunks of a length that is known here."""
    plain = dataset.dtype == np.dtype("<f8") and dataset.fletcher32 and dataset.compression is None
    return plain and sys.byteorder == "little" and fletcher.ROW % dataset.chunks[0] == 0


class Room:
    """Memory in which chunks of ``length`` samples are put together, used again and again; ``size`` of one [bytes]."""

    def __init__(self, length: int) -> None:
        self.length, self.size = length, 8 * length + _CHECKSUM
        self._chunks = np.empty((0, length + 1))  # so that each begins aligned; the last four bytes are not used

    def write(
        self,
        dataset: "h5py.Dataset",
        start: int,
        waiting: Sequence[Samples],
        count: int,
        written: Callable[[], object] = lambda: None,
    ) -> list[Samples]:
        """Write the first ``count`` of the ``waiting`` samples, whole chunks, from sample ``start`` on; the others.

        ``written`` is called after each chunk.
        """
        length, rows = self.length, count // self.length
        if len(self._chunks) < rows:
            self._chunks = np.empty((rows, length + 1))
        chunks = self._chunks[:rows]
        rest = _fill(chunks[:, :length], waiting)
        chunks.view("<u4")[:, 2 * length] = _checksums(chunks, length)
        for row in range(rows):
            dataset.id.write_direct_chunk((start + row * length,), chunks[row].view(np.uint8)[: self.size])
            written()
        return rest


def _checksums(chunks: NDArray[np.float64], length: int) -> NDArray[np.uint32]:
    """Fletcher-32 of the first ``length`` samples of each chunk."""
    sums = SWIFT.sums(len(chunks), length)
    for row, chunk in enumerate(chunks):
        sums.add(row, chunk[:length].view("<u8"))
    return sums.checksums()


def _fill(chunks: NDArray[np.float64], waiting: Sequence[Samples]) -> list[Samples]:
    """Copy the ``waiting`` samples into the chunks, row by row; those that are left."""
    rows, length = chunks.shape
    done, rest = 0, []
    for samples in waiting:
        taken = 0
        while taken < len(samples) and done < rows * length:
            row, at = divmod(done, length)
            step = min(length - at, len(samples) - taken)
            chunks[row, at : at + step] = samples[taken : taken + step]
            taken, done = taken + step, done + step
        if taken < len(samples):
            rest.append(samples[taken:].copy() if taken else samples)
    return rest
