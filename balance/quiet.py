"""Keeping standard output clean while a solver runs."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def stdout_discarded() -> Iterator[None]:
    """Discard what compiled code writes to standard output: HiGHS prints there even when told to be silent.

    A command with ``--json`` prints one document on standard output and nothing else.
    """
    sys.stdout.flush()
    kept = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
