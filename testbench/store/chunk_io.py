"""Below HDF5 while samples are written and read: the file itself, whole chunks, and the checksum behind each.

HDF5 crashes the process when it cannot write out what it holds, as on a full disk: :class:`OutFile` keeps the first
error and drops the writes after it, so that HDF5 closes in good order and the caller raises.

HDF5 reads a chunk, checks it and copies it, one after the other, and copies twice what it writes. Where the checksum is
compiled (the extra ``compiled``), whole chunks of float64 are written and read past it, with the checksum that its own
filter leaves; everywhere else HDF5 does both. Where a chunk lies is asked of HDF5, and believed only if it is whole and
inside the file.

The checksum is Fletcher-32: of the 16-bit big-endian words w[0..n), s1 = sum w[i] and s2 = sum (n - i) w[i], both
modulo 65535 (J. G. Fletcher, IEEE Trans. Commun. 30 (1982) 247; H5checksum.c of HDF5).
"""

import io
import os
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from balance.compiled_kernels import INTEGER, PLACE, Kernel

from ..recording import Samples

if TYPE_CHECKING:
    import h5py


class OutFile(io.RawIOBase):
    """A new file that HDF5 writes through, whose first error is kept."""

    def __init__(self, path: Path) -> None:
        self._stream = path.open("x+b", buffering=0)
        self._at = 0
        self.error: OSError | None = None
        self.last = (0, 0)
        """Place and size of what was written last [bytes]."""

    def check(self) -> None:
        """Raise what went wrong, if anything did."""
        if self.error is not None:
            raise self.error

    def write(self, content: Any) -> int:  # noqa: ANN401
        """Write all of ``content``, or keep the reason why not."""
        view = memoryview(content).cast("B")
        done = 0
        try:
            while self.error is None and done < len(view):
                done += self._stream.write(view[done:])
        except OSError as error:
            self.error = error
        self.last = (self._at, len(view))
        self._at += len(view)
        return len(view)

    def readinto(self, buffer: Any) -> int:  # noqa: ANN401
        """Read into ``buffer``; zeros where a write was dropped."""
        view = memoryview(buffer).cast("B")
        done = 0
        while done < len(view) and (count := self._stream.readinto(view[done:])):
            done += count
        view[done:] = bytes(len(view) - done)
        self._at = self._stream.tell()
        return len(view)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Move to a place in the file."""
        self._at = self._stream.seek(offset, whence)
        return self._at

    def tell(self) -> int:
        """The place in the file."""
        return self._stream.tell()

    def truncate(self, size: int | None = None) -> int:
        """Set the file's size, or keep the reason why not."""
        try:
            return self._stream.truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0

    def flush(self) -> None:
        """Nothing waits here."""

    def close(self) -> None:
        """Close the file."""
        if not self.closed:
            self._stream.close()
        super().close()


WORTH = 1 << 20
"""Bytes of a channel from which on it pays to read past HDF5."""
MUCH_BYTES = 32_000_000
"""What HDF5 writes and reads before the compiled checksum is asked for [bytes]."""
LONGEST = 1 << 20
"""Samples of a chunk whose sums the compiled loop holds."""
KERNEL = Kernel("testbench.store.fletcher32_kernel", "checksum", (PLACE, INTEGER))
_CHECKSUM_BYTES = 4
_WORDS = 4
"""Words of 16 bits in a sample."""
_AT_ONCE = 16
"""Chunks that are read between two looks."""


class CompiledChecksum:
    """Fletcher-32 by the compiled loop, which is made ready in a thread once there was much to do."""

    def __init__(self) -> None:
        self._done = 0
        self._loop: Callable[..., int] | None = None
        self._asked = False

    def is_ready(self, size: int) -> bool:
        """Whether the loop is there, asked before ``size`` more bytes are written or read; never waited for."""
        self._done += size
        if not self._asked and self._done > MUCH_BYTES:
            self._asked = True
            threading.Thread(target=self._load, daemon=True).start()
        return self._loop is not None

    def _load(self) -> None:
        self._loop = KERNEL.loop()

    def of_samples(self, samples: Samples) -> int:
        """The checksum of the bytes of ``samples``, (n,) as recorded [-], once :meth:`is_ready`."""
        assert self._loop is not None
        return self._loop(samples.ctypes.data, _WORDS * len(samples))


CHECKSUM = CompiledChecksum()
"""Of this process."""


def checked_samples(chunk: bytes) -> Samples:
    """The samples, (n,) as recorded [-], of a chunk as it lies in a file, four bytes of checksum last.

    Raises OSError, or ValueError, if they are not as they were written.
    """
    import h5py

    with h5py.File("chunk", "w", driver="core", backing_store=False) as file:  # in memory: HDF5's own check
        size = ((len(chunk) - _CHECKSUM_BYTES) // 8,)
        dataset = file.create_dataset("chunk", size, "<f8", chunks=size, fletcher32=True)
        dataset.id.write_direct_chunk((0,), chunk)
        return np.asarray(dataset[()])


def is_possible(dataset: "h5py.Dataset") -> bool:
    """Whether ``dataset`` is long float64 in whole chunks with no filter but the checksum, which is compiled here."""
    if dataset.dtype != np.dtype("<f8") or dataset.ndim != 1 or dataset.nbytes < WORTH or not hasattr(os, "preadv"):
        return False
    file, filters = dataset.file, dataset.id.get_create_plist().get_nfilters()
    plain = file.driver == "sec2" and not file.userblock_size and filters == 1 and dataset.fletcher32
    return plain and bool(dataset.chunks) and dataset.chunks[0] <= LONGEST and CHECKSUM.is_ready(dataset.nbytes)


def read_chunks(dataset: "h5py.Dataset") -> Samples:
    """The values of ``dataset``, (n,) as recorded [-].

    Raises OSError if a chunk is missing, elsewhere, or not as it was written. :func:`is_possible` is asked before.
    """
    length = dataset.chunks[0]
    handle = dataset.file.id.get_vfd_handle()
    places = _places(dataset, os.fstat(handle).st_size)
    values = np.empty((len(places), length))
    written = np.empty((len(places), 1), "<u4")
    found = np.empty(len(places), "<u4")
    parts = [range(i, min(i + _AT_ONCE, len(places))) for i in range(0, len(places), _AT_ONCE)]
    with ThreadPoolExecutor(1) as pool:
        pending = [pool.submit(_read, handle, places, values, written, part) for part in parts]
        for part, filled in zip(parts, pending, strict=True):
            filled.result()
            for number in part:
                found[number] = CHECKSUM.of_samples(values[number])
    odd = np.flatnonzero(found != written[:, 0])
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
    inside = all(at + size + _CHECKSUM_BYTES <= file_size for _, at, *_ in found)
    if not whole or not inside or any((s, mask) != (size + _CHECKSUM_BYTES, 0) for *_, s, mask in found):
        raise OSError(f"{dataset.name}: its chunks are not those of {len(dataset)} samples, or lie outside the file")
    if len(found) * size > file_size:
        raise OSError(f"{dataset.name} declares more values than the file holds")
    return [at for _, at, *_ in found]


def _read(handle: int, places: Sequence[int], values: Samples, written: NDArray[np.uint32], part: range) -> None:
    """Read the chunks of ``part`` and the checksums behind them; those that follow one another in one go."""
    begin = part.start
    size = values[0].nbytes + _CHECKSUM_BYTES
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


def are_possible(dataset: "h5py.Dataset") -> bool:
    """Whether whole chunks of ``dataset`` can be written past HDF5: float64 with no filter but the checksum."""
    plain = dataset.dtype == np.dtype("<f8") and dataset.fletcher32 and dataset.compression is None
    return plain and sys.byteorder == "little" and dataset.chunks[0] <= LONGEST


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
        """Write the first ``count`` of the ``waiting`` samples, whole chunks, from sample ``start`` on.

        Returns the other samples, (n,) each as recorded [-]. ``written`` is called after each chunk.
        """
        length, rows = self.length, count // self.length
        if len(self._chunks) < rows:
            self._chunks = np.empty((rows, length + 1))
        chunks = self._chunks[:rows]
        rest = _fill_rows(chunks[:, :length], waiting)
        for row in range(rows):
            chunks.view("<u4")[row, 2 * length] = CHECKSUM.of_samples(chunks[row, :length])
            dataset.id.write_direct_chunk((start + row * length,), chunks[row].view(np.uint8)[: self.size])
            written()
        return rest


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
