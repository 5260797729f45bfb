"""A log file on its way into a run: what is read from it, and its digest, computed in a thread meanwhile."""

import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import RecordingError
from ..findings import Finding
from ..readers import ReadOptions, open_recording
from ..recording import Recording
from ..store import digest

_AT_ONCE = 16 << 20
"""Bytes between two waits for Python's lock, which whoever runs Python holds for milliseconds."""


class FileDigest:
    """The SHA-256 of a file, computed in a thread from now on; and whether the file changes meanwhile."""

    def __init__(self, path: Path) -> None:
        self.path, self.sha256 = path, ""
        self._state = _state(path)
        self._failed: OSError | None = None
        self._thread = threading.Thread(target=self._compute, daemon=True)
        self._thread.start()

    def _compute(self) -> None:
        try:
            self.sha256 = digest.sha256_of(self.path, at_once=_AT_ONCE)
        except OSError as error:
            self._failed = error

    @property
    def size(self) -> int:
        """Size of the file when this began [bytes]."""
        return self._state[0]

    def result(self) -> str:
        """The SHA-256. Raises RecordingError if the file has changed since this began."""
        self._thread.join()
        if self._failed is not None:
            raise self._failed
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
