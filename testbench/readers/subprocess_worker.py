"""What runs in the process, ``worker MODULE FUNCTION PATH ...``: it sends a file's header, and its data once asked."""

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import IO, Any

from balance.errors import CounterpoiseError

from ..recording import Finding, Recording, Refusal
from . import subprocess_reader as protocol

MOST_MEMORY = 3 << 30
"""Memory that the process may take [bytes]; a library that asks for more fails, and not the machine."""


def main(arguments: list[str]) -> None:
    """Open the file and send its header; then, if a line comes and not the end of the pipe, its data.

    A function that gives no recording is answered for at once.
    """
    module, function, path, *others = arguments
    out = os.fdopen(os.dup(1), "wb", buffering=1 << 20)  # the pipe to the parent; what libraries print goes nowhere
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    with suppress(ImportError, ValueError, OSError):  # Windows has no such limit
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (MOST_MEMORY, MOST_MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        opener: Callable[..., Any] = getattr(import_module(module), function)
        found = opener(Path(path), *others)
        if not isinstance(found, Recording):
            protocol.write_frame(out, {"answer": found})
        else:
            plain = ("format", "reader", "origin", "settings", "metadata", "comments", "stated_rate_hz")
            header = {name: getattr(found, name) for name in plain}
            header |= {name: list(map(asdict, getattr(found, name))) for name in ("groups", "ranges", "findings")}
            protocol.write_frame(out, {"recording": header})
            if sys.stdin.buffer.read(1):
                _send_data(out, found)
    except Exception as error:  # whatever a library makes of a damaged file
        protocol.write_frame(out, failure(error))
    out.flush()


def failure(error: Exception) -> dict[str, Any]:
    """What is sent of an error: a refusal, or the message of one that is no fault of the file."""
    if isinstance(error, CounterpoiseError) and not isinstance(error, Refusal):
        return {"error": str(error)}
    code, message = "damaged_file", f"cannot be read: {type(error).__name__}: {error}"[:2000]
    if isinstance(error, MemoryError):
        code, message = "too_large", f"reading it takes more than {MOST_MEMORY >> 30} GiB of memory"
    elif isinstance(error, RecursionError):
        message = "its structure is nested without end"
    finding = error.finding if isinstance(error, Refusal) else Finding(code, None, None, message)
    return {"refusal": finding.as_dict()}


def _send_data(out: IO[bytes], recording: Recording) -> None:
    known = {group.name for group in recording.groups}

    def report(finding: Finding) -> None:
        protocol.write_frame(out, {"finding": finding.as_dict()})

    for block in recording.read(report):
        if block.group.name not in known:
            known.add(block.group.name)
            protocol.write_frame(out, {"group": asdict(block.group)})
        place = (block.group.name, len(block.columns), block.start, block.bytes_read)
        protocol.write_frame(out, {"block": place}, block.columns)
    texts = recording.texts
    protocol.write_frame(out, {"texts": [asdict(series) for series in texts.kept], "given_up": sorted(texts.given_up)})
    protocol.write_frame(out, {"end": True})


if __name__ == "__main__":
    main(sys.argv[1:])
