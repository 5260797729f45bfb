"""The loop that computes HDF5's checksum of a chunk (see :mod:`.chunk_io`), for the compiler.

Modulo 65535 a word of 64 bits is the sum of its four words of 16, so that whole words are added; what the four weigh
within it is found of their own sums. Only the process that compiles imports this module.
"""

from typing import Any

import numpy as np
from numba import carray, cfunc, types

_BLOCK = 1024
"""Words of 64 bits whose weighted sum stays below 2**53, and the sums of 16 bits below 2**32."""
_LOW, _WORDS, _MODULUS = (np.uint64(number) for number in (0xFFFFFFFF, 0x0000FFFF0000FFFF, 65535))
_ONE, _TWO, _THREE, _FOUR, _WORD, _HALF = (np.uint64(number) for number in (1, 2, 3, 4, 16, 32))


def checksum(place: Any, count: Any) -> Any:
    """Sums of Fletcher-32 of ``count`` float64 at ``place``, of words whose bytes are swapped: s1 + 2**16 s2.

    Modulo 65535; of s1 that is 65535, not 0, unless all words are 0.
    """
    samples = carray(place, count)
    s1 = s2 = np.uint64(0)
    for begin in range(0, count, _BLOCK):
        plain = weighted = even = odd = np.uint64(0)
        for i, four in enumerate(samples[begin : begin + _BLOCK]):
            folded = (four & _LOW) + (four >> _HALF)
            plain += folded
            weighted += np.uint64(i) * folded
            even += four & _WORDS
            odd += (four >> _WORD) & _WORDS
        inside = _FOUR * weighted + (odd & _LOW) + _TWO * (even >> _HALF) + _THREE * (odd >> _HALF)
        s1 += plain
        s2 += np.uint64(4 * (count - begin)) * (plain % _MODULUS) + _MODULUS - inside % _MODULUS
        s2 %= _MODULUS
    s1 = (s1 - _ONE) % _MODULUS + _ONE if s1 else s1
    return np.int64(s2 << _WORD | s1)


def compiled() -> str:
    """The loop for this processor, as text that LLVM takes; its entry is called ``checksum``."""
    function = cfunc(types.int64(types.CPointer(types.uint64), types.int64), error_model="numpy")(checksum)
    return str(function.inspect_llvm()).replace(function.native_name, checksum.__name__)
