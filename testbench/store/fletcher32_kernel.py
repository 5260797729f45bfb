"""The loop that computes HDF5's checksum of a chunk (see :mod:`.chunk_io`), for the compiler.

Only the process that compiles imports this module.
"""

from typing import Any

import numpy as np
from numba import carray, cfunc, types

_BLOCK = 256
"""Words whose weighted sum stays below 2**32, so that sixteen are handled at once."""
_MODULUS, _ONE, _BYTE, _WORD = (np.uint64(number) for number in (65535, 1, 256, 16))


def checksum(place: Any, count: Any) -> Any:
    """Fletcher-32 of the ``count`` words of 16 bits at ``place``, at most 2**22.

    Of a block of n words behind others: s2 grows by n s1 + sum (n - k) w[k], then s1 by sum w[k].
    """
    words = carray(place, count)
    s1, s2, at = np.uint64(0), np.uint64(0), 0
    while at + _BLOCK <= count:
        plain, weighted = np.uint32(0), np.uint32(0)
        for k in range(_BLOCK):
            word = np.uint32(words[at + k])
            plain = np.uint32(plain + word)
            weighted = np.uint32(weighted + np.uint32(word * np.uint32(_BLOCK - k)))
        s2 += s1 * np.uint64(_BLOCK) + np.uint64(weighted)
        s1 += np.uint64(plain)
        at += _BLOCK
    while at < count:
        s1 += np.uint64(words[at])
        s2 += s1
        at += 1
    # The words' bytes are swapped; end-around carries leave 65535, not 0, unless there was nothing.
    low = (s1 % _MODULUS * _BYTE + _MODULUS - _ONE) % _MODULUS + _ONE
    high = (s2 % _MODULUS * _BYTE + _MODULUS - _ONE) % _MODULUS + _ONE
    return np.int64(high << _WORD | low) if s1 else np.int64(0)


def compiled() -> str:
    """The loop for this processor, as text that LLVM takes; its entry is called ``checksum``."""
    function = cfunc(types.int64(types.CPointer(types.uint16), types.int64), error_model="numpy")(checksum)
    return str(function.inspect_llvm()).replace(function.native_name, checksum.__name__)
