"""Reading in a process of its own, where a library may crash, hang or use all memory on a damaged file.

The process (``serve``) opens the file, sends the header, waits, and sends the data when it is asked for them; whatever
happens to it is a refusal of the file. Through the pipe go numbers and JSON, never code: a frame is a line of JSON,
which says how many bytes of float64 follow it.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import IO, Any

import numpy as np

from balance.errors import CounterpoiseError

from ..errors import RecordingError
from ..recording import (
    Block,
    Finding,
    Recording,
    Refusal,
    Report,
    Samples,
    SensorRange,
    TextLog,
    TextSeries,
    group_from_dict,
)
from .format_findings import damaged

_LONGEST_DOCUMENT, _LONGEST_COLUMNS = 256 << 20, 2 << 30
MOST_MEMORY = 3 << 30
"""Memory that the process may take [bytes]; a library that asks for more fails, and not the machine."""
PATIENCE_S = 60.0
"""Longest silence of the process, for a small file [s]."""
_BYTES_PER_SECOND = 1 << 20


def serve(arguments: list[str]) -> None:
    """What the process does: open the file by ``MODULE FUNCTION PATH ...`` and send its header; its data once asked.

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
        found = getattr(import_module(module), function)(Path(path), *others)
        if not isinstance(found, Recording):
            _send(out, answer=found)
        else:
            plain = ("format", "reader", "origin", "settings", "metadata", "comments", "stated_rate_hz")
            header = {name: getattr(found, name) for name in plain}
            header |= {name: list(map(asdict, getattr(found, name))) for name in ("groups", "ranges", "findings")}
            _send(out, recording=header)
            if sys.stdin.buffer.read(1):
                _send_data(out, found)
    except Exception as error:  # whatever a library makes of a damaged file
        _send(out, **failure(error))


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
    for block in recording.read(lambda finding: _send(out, finding=finding.as_dict())):
        if block.group.name not in known:
            known.add(block.group.name)
            _send(out, group=asdict(block.group))
        place = (block.group.name, len(block.columns), block.start, block.bytes_read)
        _send(out, block.columns, block=place)
    texts = recording.texts
    _send(out, texts=[asdict(series) for series in texts.kept], given_up=sorted(texts.given_up))
    _send(out, end=True)


def _send(out: IO[bytes], columns: tuple[Samples, ...] = (), **document: object) -> None:
    """Send a document and columns of one length."""
    data = [np.ascontiguousarray(column, dtype=np.float64) for column in columns]
    line = json.dumps({"bytes": sum(column.nbytes for column in data), **document})
    out.write(line.encode() + b"\n")
    for column in data:
        out.write(column.data)
    out.flush()


def raise_failure(path: Path, document: Mapping[str, Any]) -> None:
    """Raise what the pipe brings in place of a recording, if it does."""
    if "refusal" in document:
        raise Refusal(path.name, Finding(**document["refusal"]))
    if "error" in document:
        raise RecordingError(document["error"])


class Process:
    """A process that reads one file by ``module.function(path)``; whoever starts it ends it."""

    def __init__(self, path: Path, module: str, function: str, *others: str) -> None:
        threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
        start = f"import sys, {__name__} as reader; reader.serve(sys.argv[1:])"
        self._path = path
        self._process: Any = subprocess.Popen(
            [sys.executable, "-P", "-c", start, module, function, str(path.absolute()), *others],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **threads, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )

    def first(self, key: str) -> Any:  # noqa: ANN401
        """The header of a ``recording``, or the ``answer`` of a function that gives none, as JSON carries it.

        Raises Refusal or RecordingError, and ends the process, if there is none.
        """
        try:
            return self._frame()[0][key]
        except BaseException:
            self.end()
            raise

    def data(self) -> Iterator[tuple[dict[str, Any], Samples]]:
        """Blocks, groups and findings, one after the other, after the header; the process ends with the last one."""
        try:
            with suppress(OSError):  # it died while it waited; its silence says so
                self._process.stdin.write(b"\n")
                self._process.stdin.flush()
            while "end" not in (frame := self._frame())[0]:
                yield frame
        finally:
            self.end()

    def end(self) -> None:
        """End the process, if it still is."""
        self._process.kill()
        self._process.wait()
        self._process.stdout.close()
        with suppress(OSError):
            self._process.stdin.close()

    def _frame(self) -> tuple[dict[str, Any], Samples]:
        """The next document, and its columns one behind the other.

        A process that is silent for too long, that refuses, or that died, is an error.
        """
        patience = PATIENCE_S + self._path.stat().st_size / _BYTES_PER_SECOND
        silent, pipe = threading.Timer(patience, self._process.kill), self._process.stdout
        silent.start()
        try:
            document = json.loads(pipe.readline(_LONGEST_DOCUMENT))
            data = np.frombuffer(pipe.read(min(document["bytes"], _LONGEST_COLUMNS)), dtype=np.float64)
            if data.nbytes != document["bytes"]:
                raise ValueError("the pipe ended inside a frame")
        except ValueError as error:
            was_silent, status = silent.finished.is_set(), self._process.wait()
            if was_silent:
                message = f"reading it came to no end within {patience:.0f} s; it is damaged, or made to do so"
                raise Refusal(self._path.name, Finding("too_large", None, None, message)) from error
            died = signal.Signals(-status).name if status < 0 else f"exit code {status}"
            message = f"the library that reads it crashed on it ({died}); it is damaged"
            raise damaged(self._path, message) from error
        finally:
            silent.cancel()
        raise_failure(self._path, document)
        return document, data


_WAITING: list[Process] = []
"""The process that has sent its header and waits to be asked for the data, which spares opening twice.

It is the last one that was started; where a run has several files, those before are opened again.
"""


def _end_waiting(process: Process) -> None:
    """End the process if it is the one that waits."""
    if process in _WAITING:
        _WAITING.remove(process)
        process.end()


def answer_in_subprocess(path: Path, module: str, function: str, *others: str) -> Any:  # noqa: ANN401
    """What ``module.function(path, *others)`` gives, as JSON carries it, from a process of its own."""
    process = Process(path, module, function, *others)
    answer = process.first("answer")
    process.end()
    return answer


def open_in_subprocess(path: Path, module: str, function: str = "open_library") -> Recording:
    """The recording that ``module.function(path)`` gives, opened and read in a process of its own."""
    process = Process(path, module, function)
    header = process.first("recording")
    for other in [*_WAITING]:
        _end_waiting(other)
    _WAITING.append(process)
    groups, texts = tuple(group_from_dict(group) for group in header["groups"]), TextLog()

    def read(report: Report) -> Iterator[Block]:
        known, asked = {group.name: group for group in groups}, process
        if process in _WAITING:
            _WAITING.remove(process)
        else:
            asked = Process(path, module, function)
            asked.first("recording")
        for document, data in asked.data():
            if "finding" in document:
                report(Finding(**document["finding"]))
            elif "group" in document:
                known[document["group"]["name"]] = group_from_dict(document["group"])
            elif "block" in document:
                name, count, start, bytes_read = document["block"]
                yield Block(known[name], tuple(data.reshape(count, -1)), start, None, bytes_read)
            elif "texts" in document:
                texts.series |= {(each["group"], each["channel"]): TextSeries(**each) for each in document["texts"]}
                texts.given_up |= {(group, channel) for group, channel in document["given_up"]}

    lists = {
        "groups": groups,
        "comments": tuple(header["comments"]),
        "ranges": tuple(SensorRange(**each) for each in header["ranges"]),
        "findings": tuple(Finding(**each) for each in header["findings"]),
    }
    recording = Recording(path=path, read=read, texts=texts, **header | lists)
    weakref.finalize(recording, _end_waiting, process)
    return recording
