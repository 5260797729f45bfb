"""The process: it opens the file, sends the header, waits, and sends the data when it is asked for them."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from ...errors import RecordingError
from ...findings import Finding, Refusal
from ..stream import damaged
from . import frames

PATIENCE_S = 60.0
"""Longest silence of the process, for a small file [s]."""
_BYTES_PER_SECOND = 1 << 20


class Process:
    """A process that reads one file by ``module.function(path)``; whoever starts it ends it."""

    def __init__(self, path: Path, module: str, function: str) -> None:
        command = [sys.executable, "-P", "-m", f"{__package__}.worker", module, function, str(path.absolute())]
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
            document, data = frames.read(self._stdout)
        except frames.Broken as error:
            raise self._died(patience, silent.finished.is_set()) from error
        finally:
            silent.cancel()
        if "refusal" in document:
            raise Refusal(self._path.name, frames.finding_from_dict(document["refusal"]))
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
