"""Working ahead: the next items are prepared in threads while this one is used."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

A = TypeVar("A")
B = TypeVar("B")

WORKERS = 3
DEPTH = 4
"""Items in the air at once: what bounds the memory."""


def in_order(prepare: Callable[[A], B], items: Iterable[A]) -> Iterator[B]:
    """``map(prepare, items)``, prepared in threads a few items ahead; results in the order of the items."""
    waiting: deque[Future[B]] = deque()
    with ThreadPoolExecutor(WORKERS) as pool:
        try:
            for item in items:
                waiting.append(pool.submit(prepare, item))
                if len(waiting) >= DEPTH:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()
