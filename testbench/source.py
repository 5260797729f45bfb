"""A log file on its way into a run: what is read from it, and its digest, computed in a thread meanwhile."""

import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .errors import RecordingError
from .findings import Finding
from .recording import Recording
from .store import digest


@dataclass
class Source:
    """One log file, its recording opened, and the findings so far."""

    path: Path
    recording: Recording
    findings: list[Finding] = field(default_factory=list)
    sha256: str = ""

    def __post_init__(self) -> None:
        self._state = _state(self.path)
        self._failed: OSError | None = None
        self._thread = threading.Thread(target=self._digest, daemon=True)
        self._thread.start()

    def _digest(self) -> None:
        try:
            self.sha256 = digest.sha256_of(self.path)
        except OSError as error:
            self._failed = error

    @property
    def size(self) -> int:
        """Size of the file when it was opened [bytes]."""
        return self._state[0]

    def digested(self) -> str:
        """The SHA-256 of the file, which must not have changed since it was opened."""
        self._thread.join()
        if self._failed is not None:
            raise self._failed
        if _state(self.path) != self._state:
            raise RecordingError(f"{self.path.name}: changed while it was read; ingest it when its logger is done")
        return self.sha256

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
