"""Below HDF5 while samples are written and read: the file itself, whole chunks, and the checksum behind each.

HDF5 crashes the process when it cannot write out what it holds, as on a full disk: :class:`OutFile` keeps the first
error and drops the writes after it, so that HDF5 closes in good order and the caller raises.

HDF5 reads a chunk, checks it and copies it, one after the other, and copies twice what it writes. Long float64 whose
blocks have digests are read past it; all float64 is written past it, with the checksum that its own filter leaves, for
other people's tools. Where a chunk lies is asked of HDF5, and believed only if it is whole and
inside the file.

The checksum is Fletcher-32: of the 16-bit big-endian words w[0..n), s1 = sum w[i] and s2 = sum (n - i) w[i], both
modulo 65535 (J. G. Fletcher, IEEE Trans. Commun. 30 (1982) 247; H5checksum.c of HDF5). That of zeros is zero, so that
a chunk that was never written passes it, and it says nothing of where a chunk belongs. Each block of samples has
therefore a digest in the run's description: XXH3 (64 bits, https://xxhash.com) of the float64 values as they are read,
seeded by XXH3 of the text ``SALT GROUP CHANNEL FIRST COUNT``: the salt of the run, the numbers of group and channel,
the first sample of the block and how many it has.
"""

import io
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from xxhash import xxh3_64_digest, xxh3_64_intdigest

from ..errors import StoreError
from ..recording import Samples

if TYPE_CHECKING:
    import h5py

    from balance.compiled_kernels import Preparing


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

    def sync(self) -> None:
        """Wait until what was written is on the disk."""
        os.fsync(self._stream.fileno())

    def close(self) -> None:
        """Close the file."""
        if not self.closed:
            self._stream.close()
        super().close()


WORTH = 1 << 19
"""Bytes of a channel from which on it pays to read past HDF5."""
_CHECKSUM_BYTES = 4
_AT_ONCE = 16
"""Chunks that are read in one go."""
_MODULUS, _BYTE, _WORD, _SIDE = 65535, 256, 16, 128


_MANY = 1 << 23
"""Samples of one group from which on the compiled loop saves more than its start costs, in time and memory."""


@cache
def compiled_sums() -> "Preparing":
    """The loop that adds the words of a chunk, made ready from now on."""
    from balance.compiled_kernels import INTEGER, PLACE, Kernel, Preparing  # late: who reads needs none

    return Preparing(Kernel("testbench.store.checksum_kernel", "checksum", (PLACE, INTEGER)))


def fletcher32(samples: Samples, loop: Callable[..., int] | None = None) -> int:
    """HDF5's checksum of the bytes of ``samples``, (n,) as recorded [-], at most 131,000; by the compiled ``loop``.

    Without it the words lie in squares: float32 holds a sum of 128 of them, float64 all else, and no product is long
    enough for the threads of BLAS, which wait for one another longer than this takes. Either way the sums are of words
    whose bytes are swapped, which modulo 65535 is a factor of 256; end-around carries leave 65535, not 0, unless there
    was nothing.
    """
    if loop is not None:
        found = loop(samples.ctypes.data, len(samples))
        return _of_sums(found % (1 << _WORD), found >> _WORD)
    words = samples.view("<u2").astype(np.float32)
    missing = -len(words) % _SIDE**2
    squares = (np.pad(words, (0, missing)) if missing else words).reshape(-1, _SIDE, _SIDE)
    rows = np.einsum("kij->ki", squares).astype(np.float64).ravel()
    columns = np.einsum("kij->kj", squares).sum(axis=0, dtype=np.float64)
    behind = len(words) - _SIDE * np.arange(len(rows), dtype=np.float64)
    return _of_sums(int(rows.sum()), int(rows @ behind - columns @ np.arange(_SIDE, dtype=np.float64)))


def _of_sums(*sums: int) -> int:
    low, high = ((value % _MODULUS * _BYTE + _MODULUS - 1) % _MODULUS + 1 for value in sums)
    return high << _WORD | low if sums[0] else 0


def checked_samples(chunk: bytes) -> Samples:
    """The samples, (n,) as recorded [-], of a chunk as it lies in a file, four bytes of checksum last.

    Raises ValueError if they are not as they were written.
    """
    samples = np.frombuffer(chunk[:-_CHECKSUM_BYTES], "<f8")
    if fletcher32(samples) != int.from_bytes(chunk[-_CHECKSUM_BYTES:], "little"):
        raise ValueError("the checksum does not match")
    return samples


def is_possible(dataset: "h5py.h5d.DatasetID", block: int) -> bool:
    """Whether ``dataset`` is long float64 in whole chunks of ``block`` samples, with no filter but the checksum.

    It is what h5py's lower level has: objects of the upper one take several times as long.
    """
    from h5py import h5d, h5fd, h5i, h5z

    shape, kind = dataset.shape, dataset.dtype
    if kind != np.dtype("<f8") or len(shape) != 1 or kind.itemsize * shape[0] < WORTH or not hasattr(os, "preadv"):
        return False
    plist, file = dataset.get_create_plist(), h5i.get_file_id(dataset)
    one = plist.get_nfilters() == 1 and plist.get_filter(0)[0] == h5z.FILTER_FLETCHER32
    whole = one and plist.get_layout() == h5d.CHUNKED and plist.get_chunk() == (block,)
    plain = file.get_access_plist().get_driver() == h5fd.SEC2 and not file.get_create_plist().get_userblock()
    return whole and plain and sys.byteorder == "little"


def read_chunks(dataset: "h5py.h5d.DatasetID", length: int, check: Callable[[int, Samples], None]) -> Samples:
    """The values of ``dataset``, (n,) as recorded [-], in chunks of ``length`` samples; ``check`` is given the first
    sample and the values of each part.

    Raises OSError if a chunk is missing or elsewhere. :func:`is_possible` is asked before.
    """
    from h5py import h5i

    (total,), handle = dataset.shape, h5i.get_file_id(dataset).get_vfd_handle()
    places = _places(dataset, length, os.fstat(handle).st_size)
    values = np.empty((len(places), length))

    def read(first: int) -> None:
        _read(handle, places, values, range(first, min(first + _AT_ONCE, len(places))))
        check(first * length, values[first : first + _AT_ONCE].reshape(-1)[: total - first * length])

    if len(places) <= _AT_ONCE:
        read(0)
    else:
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(read, range(0, len(places), _AT_ONCE)))
    return values.reshape(-1)[:total]


def _places(dataset: "h5py.h5d.DatasetID", length: int, file_size: int) -> list[int]:
    """Where each chunk of ``length`` samples lies, in order [bytes]."""
    (total,), size = dataset.shape, length * np.dtype("<f8").itemsize
    found: list[tuple[int, int, int, int]] = []
    dataset.chunk_iter(lambda c: found.append((c.chunk_offset[0], c.byte_offset, c.size, c.filter_mask)))
    found.sort()
    whole = [first for first, *_ in found] == list(range(0, total, length))
    inside = all(at + size + _CHECKSUM_BYTES <= file_size for _, at, *_ in found)
    if not whole or not inside or any((s, mask) != (size + _CHECKSUM_BYTES, 0) for *_, s, mask in found):
        raise OSError(f"{_name(dataset)}: its chunks are not those of {total} samples, or lie outside the file")
    if len(found) * size > file_size:
        raise OSError(f"{_name(dataset)} declares more values than the file holds")
    return [at for _, at, *_ in found]


def _name(dataset: "h5py.h5d.DatasetID") -> str:
    from h5py import h5i

    return str(h5i.get_name(dataset).decode())


def _read(handle: int, places: Sequence[int], values: Samples, part: range) -> None:
    """Read the chunks of ``part``, those that follow one another in one go; the checksums between them are let go."""
    begin, size, unused = part.start, values[0].nbytes + _CHECKSUM_BYTES, np.empty(1, "<u4")
    while begin < part.stop:
        end = begin + 1
        while end < part.stop and places[end] == places[begin] + (end - begin) * size:
            end += 1
        _fill(handle, [b for i in range(begin, end) for b in (values[i], unused)], places[begin])
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


class Chunk:
    """Memory of one chunk of ``length`` samples and its checksum, used again and again."""

    def __init__(self, length: int) -> None:
        self.length = length
        self._bytes = np.zeros(8 * length + _CHECKSUM_BYTES, np.uint8)
        self._samples = self._bytes[:-_CHECKSUM_BYTES].view("<f8")
        self._checksum = self._bytes[-_CHECKSUM_BYTES:].view("<u4")
        self._written = 0

    def fill(self, parts: Sequence[Samples]) -> Samples:
        """Take in samples (n,) [as recorded] one part behind the other, zeros behind the last: where they lie now."""
        end = 0
        for part in parts:
            begin, end = end, end + len(part)
            self._samples[begin:end] = part
        self._samples[end:] = 0.0
        return self._samples[:end]

    def write(self, dataset: "h5py.Dataset", start: int) -> int:
        """Write what was taken in as the chunk from sample ``start`` on; its size [bytes]."""
        self._written += len(self._samples)
        loop = compiled_sums().loop if self._written > _MANY else None
        self._checksum[0] = fletcher32(self._samples, loop)
        dataset.id.write_direct_chunk((start,), self._bytes)
        return self._bytes.nbytes


_DIGEST_BYTES = 8
"""Of a digest."""


def digest(samples: Samples, salt: str, group: int, channel: int, first: int) -> bytes:
    """The digest of a block (n,) [as recorded] that begins at sample ``first`` of a channel, by its number."""
    place = f"{salt} {group} {channel} {first} {len(samples)}"
    return xxh3_64_digest(samples.data, seed=xxh3_64_intdigest(place.encode()))


def digest_of_texts(texts: Sequence[str], salt: str, path: str) -> str:
    """The digest of the texts of one dataset, in hexadecimal."""
    return xxh3_64_digest("\0".join(texts).encode(), seed=xxh3_64_intdigest(f"{salt} {path}".encode())).hex()


@dataclass(frozen=True)
class Digests:
    """The digests of the samples of one group, as its run's description has them."""

    salt: str
    group: int
    block: int
    """Samples of each block but the last."""
    channels: tuple[bytes, ...]
    """Of each channel, its digests one after the other."""

    def check(self, channel: int, first: int, samples: Samples, name: str) -> None:
        """Raise StoreError if samples (n,) [as recorded], from the beginning of a block on, are not as written."""
        for begin in range(0, len(samples), self.block):
            block, at = samples[begin : begin + self.block], first + begin
            if digest(block, self.salt, self.group, channel, at) != self._stored(channel, at):
                what = self._what_is_there(channel, at, block)
                raise StoreError(f"{name}, samples {at} to {at + len(block) - 1}: {what}")

    def _stored(self, channel: int, first: int) -> bytes:
        at = first // self.block * _DIGEST_BYTES
        return self.channels[channel][at : at + _DIGEST_BYTES]

    def _what_is_there(self, channel: int, first: int, block: Samples) -> str:
        """What lies in the place of a block: zeros, a block of elsewhere in the group, or anything else."""
        if not block.any():
            return "a hole, read as zeros; an interrupted copy or a loss of power leaves such files"
        blocks = range(0, self.block * (len(self.channels[channel]) // _DIGEST_BYTES), self.block)
        places = [(other, at) for other in (channel, *range(len(self.channels))) for at in blocks]
        for other, at in places:
            if digest(block, self.salt, self.group, other, at) == self._stored(other, at):
                of = "this channel" if other == channel else f"channel {other + 1} of the group"
                return f"a chunk is swapped or repeated: there lie those of {of} from sample {at} on"
        return "the values are not those that were written"


def digests_from(known: Any, group: int, channels: Sequence[Any]) -> Digests | None:  # noqa: ANN401
    """The digests of a group out of the run's description; None of a run that was stored before there were any."""
    if known is None:
        return None
    found = tuple(bytes.fromhex(channel["digests"]) for channel in channels)
    return Digests(str(known["salt"]), group, int(known["samples"]), found)
