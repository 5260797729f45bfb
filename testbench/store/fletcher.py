"""HDF5's checksum of a chunk (Fletcher-32), so that chunks can be read past the library and still be checked.

Of the 16-bit big-endian words w[0..n): s1 = sum w[i], s2 = sum (n - i) w[i], both modulo 65535. Since 65536 is 1 modulo
65535, words may be summed two at a time, and in the other byte order: swapping bytes is multiplying by 256.
"""

import numpy as np
from numpy.typing import NDArray

_MODULUS = 65535
_AT_ONCE = 1 << 15
"""Pairs of words whose weighted sum stays below 2**64."""


def checksum(content: NDArray[np.uint8]) -> int:
    """Fletcher-32 of ``content``, whose length must be a multiple of four [bytes]."""
    pairs = content.view("<u4")
    s1 = s2 = 0
    for begin in range(0, len(pairs), _AT_ONCE):
        block = pairs[begin : begin + _AT_ONCE]
        weights = np.arange(2 * len(block), 0, -2, dtype=np.uint64)
        total = int(block.sum(dtype=np.uint64))
        later = int((block >> np.uint32(16)).sum(dtype=np.uint64))
        s2 += 2 * len(block) * s1 + int(np.dot(weights, block.astype(np.uint64))) - later
        s1 += total
    return _folded(s2 * 256) << 16 | _folded(s1 * 256)


def _folded(total: int) -> int:
    """The total modulo 65535 as end-around carries leave it: 65535, not 0, unless there was nothing."""
    return (total - 1) % _MODULUS + 1 if total else 0


def is_intact(chunk: NDArray[np.uint8]) -> bool:
    """Whether a chunk as it lies in the file, its four bytes of checksum last, is as it was written."""
    return checksum(chunk[:-4]) == int(chunk[-4:].view("<u4")[0])
