"""Reading ahead: the next blocks are parsed in a thread while this one is checked and written."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import Empty, Full, Queue
from typing import Generic, TypeVar

T = TypeVar("T")
_WAIT_S = 0.1


class _End(Generic[T]):
    """The end of the items, with the error that brought it, if any."""

    def __init__(self, error: BaseException | None = None) -> None:
        self.error = error


@contextmanager
def ahead(make: Callable[[], Iterator[T]], depth: int = 2) -> Iterator[Iterator[T]]:
    """Iterate over ``make()`` in a thread, at most ``depth`` items ahead; leaving the block ends the thread."""
    queue: Queue[T | _End[T]] = Queue(depth)
    stopped = threading.Event()

    def put(item: T | _End[T]) -> None:
        while not stopped.is_set():
            try:
                return queue.put(item, timeout=_WAIT_S)
            except Full:
                continue

    def produce() -> None:
        try:
            for item in make():
                put(item)
                if stopped.is_set():
                    return
            put(_End())
        except BaseException as error:  # handed over and raised where the items are used
            put(_End(error))

    def consume() -> Iterator[T]:
        while True:
            item = queue.get()
            if isinstance(item, _End):
                if item.error is not None:
                    raise item.error
                return
            yield item

    thread = threading.Thread(target=produce, name="reading ahead", daemon=True)
    thread.start()
    try:
        yield consume()
    finally:
        stopped.set()
        while thread.is_alive():
            try:
                queue.get_nowait()
            except Empty:
                thread.join(_WAIT_S)
