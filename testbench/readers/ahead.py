"""Working ahead: the next items are read and prepared in threads while this one is used."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

A = TypeVar("A")
B = TypeVar("B")

WORKERS = 2
DEPTH = 3
"""Items in the air at once: what bounds the memory."""
_END: Any = object()


def in_order(prepare: Callable[[A], B], items: Iterable[A]) -> Iterator[B]:
    """``map(prepare, items)``: items are taken by one thread and prepared by others; results in their order."""
    source = iter(items)
    waiting: deque[Future[Any]] = deque()

    def prepared(item: Future[Any]) -> object:
        return _END if (found := item.result()) is _END else prepare(found)

    with ThreadPoolExecutor(1) as reading, ThreadPoolExecutor(WORKERS) as pool:
        try:
            while True:
                while len(waiting) < DEPTH:
                    waiting.append(pool.submit(prepared, reading.submit(next, source, _END)))
                if (result := waiting.popleft().result()) is _END:
                    return
                yield result
        finally:
            for future in waiting:
                future.cancel()
