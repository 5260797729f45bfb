"""The compiled checksum, where so much is written that it is worth its start."""

import threading
from collections.abc import Callable

from ..native import INTEGER, PLACE, Kernel

MUCH_BYTES = 32_000_000
"""What is written the slower way before the compiled checksum is asked for [bytes]."""
CHECKSUM = Kernel("store.kernel", "checksum", (PLACE, INTEGER))


class Swift:
    """The compiled checksum, made ready in a thread once much was written."""

    def __init__(self) -> None:
        self._written = 0
        self._loop: Callable[..., int] | None = None
        self._asked = False

    def loop(self, count: int) -> Callable[..., int] | None:
        """The loop of ``kernel.checksum`` for ``count`` bytes more, if it is ready."""
        self._written += count
        if not self._asked and self._written > MUCH_BYTES:
            self._asked = True
            threading.Thread(target=self._load, daemon=True).start()
        return self._loop

    def _load(self) -> None:
        self._loop = CHECKSUM.loop()
