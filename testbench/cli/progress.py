"""A bar on stderr with rate and time left: only on a terminal, and only where it is worth it."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

WORTH = 20 << 20
"""Work from which a bar is shown [bytes]."""


@contextmanager
def progress(what: str, total_bytes: int) -> Iterator[Callable[[int], None]]:
    """A function that takes the bytes that were done since its last call."""
    if not sys.stderr.isatty() or total_bytes < WORTH:
        yield lambda count: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeRemainingColumn, TransferSpeedColumn

    parts = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TransferSpeedColumn())
    with Progress(*parts, TimeRemainingColumn(), console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total_bytes)
        yield lambda count: bar.advance(task, count)
