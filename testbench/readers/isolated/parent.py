"""Starting the process, taking in what it sends, and making a refusal of whatever befalls it."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ...errors import RecordingError
from ...findings import Finding, Refusal
from ...recording import Block, Recording, Report
from ..stream import damaged
from . import frames

PATIENCE_S = 60.0
"""Longest silence of the process, for a small file [s]."""
_BYTES_PER_SECOND = 1 << 20


def open_isolated(path: Path, module: str, function: str) -> Recording:
    """The recording that ``module.function(path)`` gives, opened and read in a process of its own."""
    with _process(path, module, function, "open") as listen:
        document, _ = next(listen)
    said = document["recording"]
    groups = tuple(frames.group_from_dict(group) for group in said["groups"])

    def read(report: Report) -> Iterator[Block]:
        known = {group.name: group for group in groups}
        with _process(path, module, function, "read") as listen:
            for document, data in listen:
                if "finding" in document:
                    report(frames.finding_from_dict(document["finding"]))
                elif "group" in document:
                    group = frames.group_from_dict(document["group"])
                    known[group.name] = group
                elif "block" in document:
                    block = document["block"]
                    columns = tuple(data.reshape(block["columns"], -1))
                    yield Block(known[block["group"]], columns, block["start"], None, block["read"])

    return Recording(
        path=path,
        format=said["format"],
        reader=said["reader"],
        groups=groups,
        read=read,
        origin=said["origin"],
        settings=said["settings"],
        metadata=said["metadata"],
        comments=tuple(said["comments"]),
        ranges=tuple(frames.range_from_list(each) for each in said["ranges"]),
        stated_rate_hz=said["stated_rate_hz"],
        findings=tuple(frames.finding_from_dict(finding) for finding in said["findings"]),
    )


@contextmanager
def _process(path: Path, module: str, function: str, mode: str) -> Iterator[Iterator[tuple[dict[str, Any], Any]]]:
    """The frames that the process sends; leaving ends it."""
    command = [sys.executable, "-P", "-m", f"{__package__}.worker", module, function, mode, str(path.absolute())]
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS"), "1")
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **threads, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    try:
        yield _frames(process, path)
    finally:
        process.kill()
        process.wait()
        assert process.stdout is not None
        process.stdout.close()


def _frames(process: "subprocess.Popen[bytes]", path: Path) -> Iterator[tuple[dict[str, Any], Any]]:
    """Frames up to the last one; a process that is silent for too long, or that died, is a refusal."""
    assert process.stdout is not None
    patience = PATIENCE_S + path.stat().st_size / _BYTES_PER_SECOND
    while True:
        silent = threading.Timer(patience, process.kill)
        silent.start()
        try:
            document, data = frames.read(process.stdout)
        except frames.Broken as error:
            raise _died(process, path, patience, silent.finished.is_set()) from error
        finally:
            silent.cancel()
        if "refusal" in document:
            raise Refusal(path.name, frames.finding_from_dict(document["refusal"]))
        if "error" in document:
            raise RecordingError(document["error"])
        if "end" in document:
            return
        yield document, data
        if "recording" in document:
            return


def _died(process: "subprocess.Popen[bytes]", path: Path, patience: float, was_silent: bool) -> Refusal:
    """Why the process brought nothing more."""
    status = process.wait()
    if was_silent:
        message = f"reading it came to no end within {patience:.0f} s; it is damaged, or made to do so"
        return Refusal(path.name, Finding("too_large", None, None, message))
    died = signal.Signals(-status).name if status < 0 else f"exit code {status}"
    return damaged(path, f"the library that reads it crashed on it ({died}); it is damaged")
