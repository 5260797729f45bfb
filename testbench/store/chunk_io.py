"""A long channel read straight from its chunks in the file into the array that is handed out, every checksum checked.

HDF5 reads a chunk, checks it and copies it, one after the other. Here one thread reads while another checks, and
nothing is copied. Where a chunk lies is asked of HDF5, and believed only if it is whole and inside the file.

Whole chunks of float64 put into the file with their checksum, as HDF5's own filter leaves them.

HDF5 copies what it is given into its cache, from there into the filter's room, and only then writes. Here each chunk is
put together once, checksum behind it, and written; two thirds of the time of writing are saved.
"""

import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..recording import Samples
from . import fletcher32
from .fletcher32 import SWIFT

if TYPE_CHECKING:
    import h5py

WORTH = 1 << 20
"""Bytes of a channel from which on it pays."""
_CHECKSUM = 4
_AT_ONCE = 16
"""Chunks that are read between two looks."""


def is_possible(dataset: "h5py.Dataset") -> bool:
    """Whether ``dataset`` is float64 in whole chunks with no filter but the checksum, on a system that can."""
    if dataset.dtype != np.dtype("<f8") or dataset.ndim != 1 or dataset.nbytes < WORTH or not hasattr(os, "preadv"):
        return False
    file, filters = dataset.file, dataset.id.get_create_plist().get_nfilters()
    plain = file.driver == "sec2" and not file.userblock_size and filters == 1 and dataset.fletcher32
    return plain and bool(dataset.chunks) and fletcher32.ROW % dataset.chunks[0] == 0


def read_chunks(dataset: "h5py.Dataset") -> Samples:
    """The values of ``dataset``, (n,). Raises OSError if a chunk is missing, elsewhere, or not as it was written."""
    length = dataset.chunks[0]
    handle = dataset.file.id.get_vfd_handle()
    places = _places(dataset, os.fstat(handle).st_size)
    values = np.empty((len(places), length))
    written = np.empty((len(places), 1), "<u4")
    sums = SWIFT.sums(len(places), length)
    parts = [range(i, min(i + _AT_ONCE, len(places))) for i in range(0, len(places), _AT_ONCE)]
    with ThreadPoolExecutor(1) as pool:
        pending = [pool.submit(_read, handle, places, values, written, part) for part in parts]
        for part, filled in zip(parts, pending, strict=True):
            filled.result()
            for number in part:
                sums.add(number, values[number].view("<u8"))
    odd = np.flatnonzero(sums.checksums() != written[:, 0])
    if odd.size:
        raise OSError(f"{dataset.name}: the checksum of the samples from {odd[0] * length} on does not match")
    return values.reshape(-1)[: len(dataset)]


def _places(dataset: "h5py.Dataset", file_size: int) -> list[int]:
    """Where each chunk lies, in order [bytes]."""
    size = dataset.chunks[0] * dataset.dtype.itemsize
    found: list[tuple[int, int, int, int]] = []
    dataset.id.chunk_iter(lambda c: found.append((c.chunk_offset[0], c.byte_offset, c.size, c.filter_mask)))
    found.sort()
    whole = [first for first, *_ in found] == list(range(0, len(dataset), dataset.chunks[0]))
    inside = all(at + size + _CHECKSUM <= file_size for _, at, *_ in found)
    if not whole or not inside or any((s, mask) != (size + _CHECKSUM, 0) for *_, s, mask in found):
        raise OSError(f"{dataset.name}: its chunks are not those of {len(dataset)} samples, or lie outside the file")
    if len(found) * size > file_size:
        raise OSError(f"{dataset.name} declares more values than the file holds")
    return [at for _, at, *_ in found]


def _read(handle: int, places: Sequence[int], values: Samples, written: NDArray[np.uint32], part: range) -> None:
    """Read the chunks of ``part`` and the checksums behind them; those that follow one another in one go."""
    begin = part.start
    size = values[0].nbytes + _CHECKSUM
    while begin < part.stop:
        end = begin + 1
        while end < part.stop and places[end] == places[begin] + (end - begin) * size:
            end += 1
        _fill(handle, [b for i in range(begin, end) for b in (values[i], written[i])], places[begin])
        begin = end


def _fill(handle: int, buffers: Sequence[NDArray[Any]], at: int) -> None:
    views = [buffer.data.cast("B") for buffer in buffers]
    while views:
        count = os.preadv(handle, views, at)
        if not count:
            raise OSError("the file ends inside a chunk")
        at += count
        while views and count >= len(views[0]):
            count -= len(views.pop(0))
        if count:
            views[0] = views[0][count:]


_CHECKSUM_BYTES = 4


def are_possible(dataset: "h5py.Dataset") -> bool:
    """Whether ``dataset`` is float64 with no filter but the checksum, in chunks of a length that is known here."""
    plain = dataset.dtype == np.dtype("<f8") and dataset.fletcher32 and dataset.compression is None
    return plain and sys.byteorder == "little" and fletcher32.ROW % dataset.chunks[0] == 0


class Room:
    """Memory in which chunks of ``length`` samples are put together, used again and again; ``size`` of one [bytes]."""

    def __init__(self, length: int) -> None:
        self.length, self.size = length, 8 * length + _CHECKSUM_BYTES
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
        rest = _fill_rows(chunks[:, :length], waiting)
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


def _fill_rows(chunks: NDArray[np.float64], waiting: Sequence[Samples]) -> list[Samples]:
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
