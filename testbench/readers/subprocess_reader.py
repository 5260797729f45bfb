"""Reading in a process of its own, where a library may crash, hang or swallow memory on a damaged file.

The process opens the file, sends the header, waits, and sends the data when it is asked for them; whatever befalls it
is a refusal of the file. Numbers and JSON go through the pipe (``subprocess_protocol``), never code.
"""

import os
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import RecordingError
from ..recording import Block, Finding, Recording, Refusal, Report
from . import subprocess_protocol as protocol
from .byte_source import damaged

PATIENCE_S = 60.0
"""Longest silence of the process, for a small file [s]."""
_BYTES_PER_SECOND = 1 << 20


class Process:
    """A process that reads one file by ``module.function(path)``; whoever starts it ends it."""

    def __init__(self, path: Path, module: str, function: str) -> None:
        command = [
            sys.executable,
            "-P",
            "-m",
            f"{__package__}.subprocess_worker",
            module,
            function,
            str(path.absolute()),
        ]
        threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS"), "1")
        self._path = path
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **threads, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )

    def header(self) -> dict[str, Any]:
        """The recording's header. Raises Refusal or RecordingError, and ends the process, if there is none."""
        try:
            document: dict[str, Any] = self._frame()[0]["recording"]
        except BaseException:
            self.end()
            raise
        return document

    def data(self) -> Iterator[tuple[dict[str, Any], Any]]:
        """Blocks, groups and findings, one after the other, after the header; the process ends with the last one."""
        try:
            with suppress(OSError):  # it died while it waited; its silence says so
                self._stdin.write(b"\n")
                self._stdin.flush()
            while True:
                document, columns = self._frame()
                if "end" in document:
                    return
                yield document, columns
        finally:
            self.end()

    def end(self) -> None:
        """End the process, if it still is."""
        self._process.kill()
        self._process.wait()
        self._stdout.close()
        with suppress(OSError):
            self._stdin.close()

    def _frame(self) -> tuple[dict[str, Any], Any]:
        """The next frame; a process that is silent for too long, that refuses, or that died, is an error."""
        patience = PATIENCE_S + self._path.stat().st_size / _BYTES_PER_SECOND
        silent = threading.Timer(patience, self._process.kill)
        silent.start()
        try:
            document, data = protocol.read_frame(self._stdout)
        except protocol.Broken as error:
            raise self._died(patience, silent.finished.is_set()) from error
        finally:
            silent.cancel()
        if "refusal" in document:
            raise Refusal(self._path.name, protocol.finding_from_dict(document["refusal"]))
        if "error" in document:
            raise RecordingError(document["error"])
        return document, data

    def _died(self, patience: float, was_silent: bool) -> Refusal:
        """Why the process brought nothing more."""
        status = self._process.wait()
        if was_silent:
            message = f"reading it came to no end within {patience:.0f} s; it is damaged, or made to do so"
            return Refusal(self._path.name, Finding("too_large", None, None, message))
        died = signal.Signals(-status).name if status < 0 else f"exit code {status}"
        return damaged(self._path, f"the library that reads it crashed on it ({died}); it is damaged")

    @property
    def _stdin(self) -> Any:  # noqa: ANN401
        return self._process.stdin

    @property
    def _stdout(self) -> Any:  # noqa: ANN401
        return self._process.stdout


class _Waiting:
    """The one process that has sent its header and waits to be asked for the data, which spares opening twice.

    It is the last one that was started; where a run has several files, those before are opened again.
    """

    def __init__(self) -> None:
        self._process: Process | None = None

    def keep(self, process: Process) -> None:
        self.end(self._process)
        self._process = process

    def take(self, process: Process) -> Process | None:
        """The process, if it still waits; it is then the caller's."""
        if self._process is not process:
            return None
        self._process = None
        return process

    def end(self, process: Process | None) -> None:
        if process is not None and self.take(process) is not None:
            process.end()


_WAITING = _Waiting()


def open_in_subprocess(path: Path, module: str, function: str = "open_library") -> Recording:
    """The recording that ``module.function(path)`` gives, opened and read in a process of its own."""
    process = Process(path, module, function)
    header = process.header()
    _WAITING.keep(process)
    groups = tuple(protocol.group_from_dict(group) for group in header["groups"])

    def read(report: Report) -> Iterator[Block]:
        known = {group.name: group for group in groups}
        for document, data in (_WAITING.take(process) or _anew(path, module, function)).data():
            if "finding" in document:
                report(protocol.finding_from_dict(document["finding"]))
            elif "group" in document:
                group = protocol.group_from_dict(document["group"])
                known[group.name] = group
            elif "block" in document:
                block = document["block"]
                columns = tuple(data.reshape(block["columns"], -1))
                yield Block(known[block["group"]], columns, block["start"], None, block["read"])

    recording = Recording(
        path=path,
        format=header["format"],
        reader=header["reader"],
        groups=groups,
        read=read,
        origin=header["origin"],
        settings=header["settings"],
        metadata=header["metadata"],
        comments=tuple(header["comments"]),
        ranges=tuple(protocol.range_from_list(each) for each in header["ranges"]),
        stated_rate_hz=header["stated_rate_hz"],
        findings=tuple(protocol.finding_from_dict(finding) for finding in header["findings"]),
    )
    weakref.finalize(recording, _WAITING.end, process)
    return recording


def _anew(path: Path, module: str, function: str) -> Process:
    """A process that has opened the file once more."""
    process = Process(path, module, function)
    process.header()
    return process
