"""What runs in the process, ``worker MODULE FUNCTION PATH``: it sends a file's header, and its data once asked."""

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import IO

from balance.errors import CounterpoiseError

from ..recording import Finding, Recording, Refusal
from . import subprocess_reader as protocol

MOST_MEMORY = 3 << 30
"""Memory that the process may take [bytes]; a library that asks for more fails, and not the machine."""


def main(arguments: list[str]) -> None:
    """Open the file and send its header; then, if a line comes and not the end of the pipe, its data."""
    module, function, path = arguments
    out = _private_output()
    _limit_memory()
    try:
        opener: Callable[[Path], Recording] = getattr(import_module(module), function)
        recording = opener(Path(path))
        _send_header(out, recording)
        if sys.stdin.buffer.read(1):
            _send_data(out, recording)
    except Refusal as refusal:
        protocol.write_frame(out, {"refusal": refusal.finding.as_dict()})
    except CounterpoiseError as error:
        protocol.write_frame(out, {"error": str(error)})
    except MemoryError:
        message = f"reading it takes more than {MOST_MEMORY >> 30} GiB of memory"
        protocol.write_frame(out, {"refusal": Finding("too_large", None, None, message).as_dict()})
    except RecursionError:
        message = "its structure is nested without end"
        protocol.write_frame(out, {"refusal": Finding("damaged_file", None, None, message).as_dict()})
    except Exception as error:  # whatever a library makes of a damaged file
        message = f"cannot be read: {type(error).__name__}: {error}"
        protocol.write_frame(out, {"refusal": Finding("damaged_file", None, None, message[:2000]).as_dict()})
    out.flush()


def _private_output() -> IO[bytes]:
    """The pipe to the parent; what libraries print goes nowhere."""
    out = os.fdopen(os.dup(1), "wb", buffering=1 << 20)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    return out


def _limit_memory() -> None:
    with suppress(ImportError, ValueError, OSError):  # Windows has no such limit
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (MOST_MEMORY, MOST_MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _send_header(out: IO[bytes], recording: Recording) -> None:
    document = {
        "format": recording.format,
        "reader": recording.reader,
        "groups": [protocol.group_as_dict(group) for group in recording.groups],
        "origin": recording.origin,
        "settings": dict(recording.settings),
        "metadata": dict(recording.metadata),
        "comments": list(recording.comments),
        "ranges": [[each.limit, each.unit, each.bits] for each in recording.ranges],
        "stated_rate_hz": recording.stated_rate_hz,
        "findings": [finding.as_dict() for finding in recording.findings],
    }
    protocol.write_frame(out, {"recording": document})


def _send_data(out: IO[bytes], recording: Recording) -> None:
    known = {group.name for group in recording.groups}

    def report(finding: Finding) -> None:
        protocol.write_frame(out, {"finding": finding.as_dict()})

    for block in recording.blocks(report):
        if block.group.name not in known:
            known.add(block.group.name)
            protocol.write_frame(out, {"group": protocol.group_as_dict(block.group)})
        protocol.write_frame(out, {"block": protocol.block_as_dict(block)}, block.columns)
    protocol.write_frame(out, {"end": True})


if __name__ == "__main__":
    main(sys.argv[1:])
