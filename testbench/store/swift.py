"""The compiled checksum, where so much is written or read that it is worth its start."""

import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..native import INTEGER, PLACE, Kernel
from .fletcher import Quadruples, Sums

MUCH_BYTES = 32_000_000
"""What is written and read the slower way before the compiled checksum is asked for [bytes]."""
CHECKSUM = Kernel("store.kernel", "checksum", (PLACE, INTEGER))
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


class Swift:
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


SWIFT = Swift()
"""Of this process."""
