"""HDF5's checksum of a chunk (Fletcher-32), so that chunks can be read past the library and still be checked.

Of the 16-bit big-endian words w[0..n): s1 = sum w[i], s2 = sum (n - i) w[i], both modulo 65535. Since 65536 is 1 modulo
65535, words may be summed in the other byte order: swapping bytes is multiplying by 256. Weights count from the end, so
zeros put in front change nothing.

The compiled checksum, where so much is written or read that it is worth its start.
"""

import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..compiled_kernels import INTEGER, PLACE, Kernel

_MODULUS = 65535
ROW = 1 << 15
"""Quadruples of words whose sums stay below 2**32 in each half of a uint64."""
_END = 512
"""Quadruples to which a row is folded before the rest is done for all rows at once."""
_EVERY_OTHER = np.uint64(0x0000FFFF0000FFFF)
_WORD, _HALF, _LOW = np.uint64(16), np.uint64(32), np.uint64(0xFFFFFFFF)

Quadruples = NDArray[np.uint64]


class Sums:
    """Sums of ``count`` rows of ``length`` quadruples of words each, a power of two up to :data:`ROW`.

    A row is a few passes over memory that stays in the processor's cache; what is left is done for all rows together.
    """

    def __init__(self, count: int, length: int = ROW) -> None:
        self.length = length
        self._odd, self._pairs = np.empty(length, np.uint64), np.empty(length, np.uint64)
        self._halves = [(half, self._pairs[:half], self._pairs[half : 2 * half]) for half in _halves(length)]
        self._odd_sums = np.zeros(count, np.uint64)
        self._half_sums = np.zeros((count, len(self._halves)), np.uint64)
        self._rest = np.zeros((count, min(length, _END)), np.uint64)

    def add(self, row: int, words: Quadruples) -> None:
        """Take in a row, (length,): a + b and c + d of each quadruple, folded by halves, weights kept."""
        odd, pairs = self._odd, self._pairs
        np.right_shift(words, _WORD, out=odd)
        np.bitwise_and(odd, _EVERY_OTHER, out=odd)  # b, d
        np.bitwise_and(words, _EVERY_OTHER, out=pairs)  # a, c
        np.add(pairs, odd, out=pairs)
        self._odd_sums[row] = np.add.reduce(odd)
        for level, (_, first, second) in enumerate(self._halves):
            self._half_sums[row, level] = np.add.reduce(second)
            np.add(first, second, out=first)
        self._rest[row] = pairs[: self._rest.shape[1]]

    def checksums(self, rows: int = 1) -> NDArray[np.uint32]:
        """Fletcher-32 of each ``rows`` rows that follow one another."""
        s1, s2 = self._sums()
        words_after = np.arange(rows)[::-1].astype(np.uint64) * np.uint64(4 * self.length % _MODULUS)
        later = (s1.reshape(-1, rows) % _MODULUS * (words_after % _MODULUS)).sum(axis=1)
        total, weighted = s1.reshape(-1, rows).sum(axis=1), (s2 % _MODULUS).reshape(-1, rows).sum(axis=1) + later
        # End-around carries leave 65535, not 0, unless there was nothing.
        low, high = ((t % _MODULUS * 256 + _MODULUS - 1) % _MODULUS + 1 for t in (total, weighted))
        return np.where(total > 0, high << _WORD | low, 0).astype(np.uint32)

    def _sums(self) -> tuple[Quadruples, Quadruples]:
        """s1 and s2 of each row: of quadruple k, (n - 4 k)(a + b + c + d) - (b + 2 c + 3 d)."""
        before = np.arange(self._rest.shape[1], dtype=np.uint64)
        halves = np.array([half for half, *_ in self._halves], dtype=np.uint64)
        four = _both(self._rest)
        s1 = four.sum(axis=1)
        position = (four * before).sum(axis=1) + (_both(self._half_sums) * halves).sum(axis=1)
        c_and_d = (self._rest >> _HALF).sum(axis=1)
        inside = _both(self._odd_sums) + 2 * c_and_d  # b + d + 2 (c + d)
        return s1, 4 * self.length * s1 - 4 * position - inside


def _halves(length: int) -> list[int]:
    return [length >> n for n in range(1, length.bit_length()) if length >> n >= _END]


def _both(sums: Quadruples) -> Quadruples:
    return (sums & _LOW) + (sums >> _HALF)


def checksum(content: NDArray[np.uint8]) -> int:
    """Fletcher-32 of ``content``, whose length must be a multiple of four [bytes]."""
    quadruples = max(1, -(-len(content) // 8))
    length = min(ROW, 1 << (quadruples - 1).bit_length())
    rows = -(-quadruples // length)
    padded = np.zeros(8 * length * rows, np.uint8)
    padded[len(padded) - len(content) :] = content
    sums = Sums(rows, length)
    for row, words in enumerate(padded.view("<u8").reshape(rows, length)):
        sums.add(row, words)
    return int(sums.checksums(rows)[0])


def is_intact(chunk: NDArray[np.uint8]) -> bool:
    """Whether a chunk as it lies in the file, its four bytes of checksum last, is as it was written."""
    return checksum(chunk[:-4]) == int(chunk[-4:].view("<u4")[0])


MUCH_BYTES = 32_000_000
"""What is written and read the slower way before the compiled checksum is asked for [bytes]."""
CHECKSUM = Kernel("store.fletcher32_kernel", "checksum", (PLACE, INTEGER))
_WORDS = 4
"""Words of 16 bits in a quadruple."""


class CompiledSums:
    """The checksums of ``count`` rows, as :class:`Sums` gives them, by the compiled loop."""

    def __init__(self, loop: Callable[..., int], count: int) -> None:
        self._loop, self._found = loop, np.empty(count, np.uint32)

    def add(self, row: int, words: Quadruples) -> None:
        """Take in a row."""
        self._found[row] = self._loop(words.ctypes.data, _WORDS * len(words))

    def checksums(self) -> NDArray[np.uint32]:
        """Fletcher-32 of each row."""
        return self._found


class CompiledChecksum:
    """The compiled checksum, made ready in a thread once there was much to do."""

    def __init__(self) -> None:
        self._done = 0
        self._loop: Callable[..., int] | None = None
        self._asked = False

    def sums(self, count: int, length: int) -> Sums | CompiledSums:
        """For the checksums of ``count`` rows of ``length`` quadruples: by the compiled loop, if it is ready."""
        self._done += 8 * count * length
        if not self._asked and self._done > MUCH_BYTES:
            self._asked = True
            threading.Thread(target=self._load, daemon=True).start()
        return Sums(count, length) if self._loop is None else CompiledSums(self._loop, count)

    def _load(self) -> None:
        self._loop = CHECKSUM.loop()


SWIFT = CompiledChecksum()
"""Of this process."""
