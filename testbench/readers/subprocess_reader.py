"""Reading in a process of its own, where a library may crash, hang or use all memory on a damaged file.

The process (``subprocess_worker``) opens the file, sends the header, waits, and sends the data when it is asked for
them; whatever happens to it is a refusal of the file. Through the pipe go numbers and JSON, never code: a frame is two
lengths, a JSON document, and columns of float64.
"""

import json
import os
import signal
import struct
import subprocess
import sys
import threading
import weakref
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import numpy as np

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

_HEAD = struct.Struct("<IQ")
_LONGEST_DOCUMENT, _LONGEST_COLUMNS = 256 << 20, 2 << 30


class BrokenPipe(Exception):
    """The pipe ended, or brought something that is no frame."""


def write_frame(stream: IO[bytes], document: Mapping[str, Any], columns: tuple[Samples, ...] = ()) -> None:
    """Send a document and columns of one length."""
    text = json.dumps(document).encode()
    data = [np.ascontiguousarray(column, dtype=np.float64) for column in columns]
    stream.write(_HEAD.pack(len(text), sum(column.nbytes for column in data)) + text)
    for column in data:
        stream.write(column.data)
    stream.flush()


def _read_frame(stream: IO[bytes]) -> tuple[dict[str, Any], Samples]:
    """The next document, and its columns one behind the other. Raises BrokenPipe where there is no such frame."""

    def exactly(count: int) -> bytes:
        data = stream.read(count)
        if len(data) != count:
            raise BrokenPipe
        return data

    text_length, data_length = _HEAD.unpack(exactly(_HEAD.size))
    if text_length > _LONGEST_DOCUMENT or data_length > _LONGEST_COLUMNS or data_length % 8:
        raise BrokenPipe
    try:
        document = json.loads(exactly(text_length))
    except ValueError as error:
        raise BrokenPipe from error
    return document, np.frombuffer(exactly(data_length), dtype=np.float64)


def raise_failure(path: Path, document: Mapping[str, Any]) -> None:
    """Raise what the pipe brings in place of a recording, if it does."""
    if "refusal" in document:
        raise Refusal(path.name, Finding(**document["refusal"]))
    if "error" in document:
        raise RecordingError(document["error"])


PATIENCE_S = 60.0
"""Longest silence of the process, for a small file [s]."""
_BYTES_PER_SECOND = 1 << 20


class Process:
    """A process that reads one file by ``module.function(path)``; whoever starts it ends it."""

    def __init__(self, path: Path, module: str, function: str, *others: str) -> None:
        worker = f"{__package__}.subprocess_worker"
        threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
        self._path = path
        self._process: Any = subprocess.Popen(
            [sys.executable, "-P", "-m", worker, module, function, str(path.absolute()), *others],
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

    def answer(self) -> Any:  # noqa: ANN401
        """What a function gives that gives no recording, as JSON carries it; the process ends."""
        try:
            return self._frame()[0]["answer"]
        finally:
            self.end()

    def data(self) -> Iterator[tuple[dict[str, Any], Any]]:
        """Blocks, groups and findings, one after the other, after the header; the process ends with the last one."""
        try:
            with suppress(OSError):  # it died while it waited; its silence says so
                self._process.stdin.write(b"\n")
                self._process.stdin.flush()
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
        self._process.stdout.close()
        with suppress(OSError):
            self._process.stdin.close()

    def _frame(self) -> tuple[dict[str, Any], Any]:
        """The next frame; a process that is silent for too long, that refuses, or that died, is an error."""
        patience = PATIENCE_S + self._path.stat().st_size / _BYTES_PER_SECOND
        silent = threading.Timer(patience, self._process.kill)
        silent.start()
        try:
            document, data = _read_frame(self._process.stdout)
        except BrokenPipe as error:
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
    return Process(path, module, function, *others).answer()


def open_in_subprocess(path: Path, module: str, function: str = "open_library") -> Recording:
    """The recording that ``module.function(path)`` gives, opened and read in a process of its own."""
    process = Process(path, module, function)
    header = process.header()
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
            asked.header()
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
