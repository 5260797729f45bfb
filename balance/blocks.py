"""Work on many samples in blocks that stay in the processor's cache, on all its cores."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

BLOCK = 4096
"""Samples worked on at once."""

T = TypeVar("T")


def in_blocks(count: int, work: Callable[[slice], T]) -> Iterator[T]:
    """Call ``work`` on each block of samples, results in order; NumPy lets go of the interpreter's lock."""
    parts = [slice(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK)]
    if len(parts) < 2:
        yield from map(work, parts)
        return
    with ThreadPoolExecutor(max_workers=min(len(parts), os.cpu_count() or 1)) as pool:
        yield from pool.map(work, parts)
