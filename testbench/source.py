"""A log file on its way into a run: what is read from it, and its digest, computed in a thread meanwhile."""

import contextlib
import hashlib
import os
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .errors import RecordingError
from .findings import Finding
from .readers import ReadOptions, open_recording
from .recording import Recording

_AT_ONCE = 16 << 20
"""Bytes between two waits for Python's lock, which whoever runs Python holds for milliseconds."""
_NICE = 10
"""How far a digest stands back where processors are few: nobody waits for it before all else is stored."""


class FileDigest:
    """The SHA-256 of a file, computed in a thread from now on; and whether the file changes meanwhile.

    The thread takes what processors have to spare; who asks for the result computes what is missing.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.sha256 = path, ""
        self._state = _state(path)
        self._failed: OSError | None = None
        self._total, self._read, self._asked = hashlib.sha256(), 0, False
        self._thread = threading.Thread(target=self._compute, daemon=True)
        self._thread.start()

    def _compute(self) -> None:
        if sys.platform == "linux":  # where a thread has a priority of its own
            with contextlib.suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
        try:
            self._go_on(lambda: self._asked)
        except OSError as error:
            self._failed = error

    def _go_on(self, stopped: Callable[[], bool]) -> None:
        """Take in the file from where the digest stands to its end, unless stopped before."""
        room = memoryview(bytearray(max(4096, min(_AT_ONCE, self.size))))
        with self.path.open("rb", buffering=0) as stream:
            stream.seek(self._read)
            while not stopped():
                count = stream.readinto(room)
                self._total.update(room[:count])
                self._read += count
                if not count:
                    self.sha256 = self._total.hexdigest()
                    return

    @property
    def size(self) -> int:
        """Size of the file when this began [bytes]."""
        return self._state[0]

    def result(self) -> str:
        """The SHA-256. Raises RecordingError if the file has changed since this began."""
        self._asked = True
        self._thread.join()
        if self._failed is not None:
            raise self._failed
        if not self.sha256:
            self._go_on(lambda: False)
        if _state(self.path) != self._state:
            raise RecordingError(f"{self.path.name}: changed while it was read; ingest it when its logger is done")
        return self.sha256


@dataclass
class Source:
    """One log file, its recording opened, its digest under way, and the findings so far."""

    path: Path
    recording: Recording
    digest: FileDigest
    findings: list[Finding] = field(default_factory=list)

    @classmethod
    def opened(cls, path: Path, options: ReadOptions | None) -> "Source":
        """Open a log file; its digest begins before that, so that no moment of the processors is lost."""
        if not path.is_file():
            open_recording(path, options)  # says what is there instead
        computed = FileDigest(path)
        return cls(path, open_recording(path, options), computed)

    @property
    def size(self) -> int:
        """Size of the file when it was opened [bytes]."""
        return self.digest.size

    @property
    def sha256(self) -> str:
        """The digest, if it is known already; else empty."""
        return self.digest.sha256

    def digested(self) -> str:
        """The SHA-256 of the file, which must not have changed since it was opened."""
        return self.digest.result()

    def provenance(self) -> dict[str, Any]:
        """What is kept of the source: never its folder, which is no business of those who get the run."""
        recording = self.recording
        return {
            "name": self.path.name,
            "size_bytes": self.size,
            "sha256": self.sha256,
            "format": recording.format,
            "reader": recording.reader,
            "origin": recording.origin,
            "groups": [group.name for group in recording.groups],
            "settings": dict(recording.settings),
            "metadata": dict(recording.metadata),
            "comments": list(recording.comments),
        }


def _state(path: Path) -> tuple[int, int]:
    stat = path.stat()
    return stat.st_size, stat.st_mtime_ns
