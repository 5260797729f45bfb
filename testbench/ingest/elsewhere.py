"""Logs that are ingested together, each a run of its own: which of them holds what one does not."""

from collections.abc import Collection, Sequence
from pathlib import Path

from ..errors import RecordingError
from ..readers import ReadOptions, open_recording


class OtherLogs:
    """The channels of several logs, by their headers, of which no more are read than are asked for."""

    def __init__(self, files: Sequence[Path], options: ReadOptions | None = None) -> None:
        self._unread = list(files)
        self._options = options
        self._labels: dict[Path, frozenset[str]] = {}

    def changed(self, path: Path) -> None:
        """A log is there or says something else than before: its header is to be read."""
        self.gone(path)
        self._unread.append(path)

    def gone(self, path: Path) -> None:
        """A log is no longer there."""
        self._labels.pop(path, None)
        self._unread = [other for other in self._unread if other != path]

    def holding(self, channels: Collection[str]) -> str | None:
        """The name of the first log that holds one of ``channels`` (without unit); None if none does."""
        for path, labels in self._labels.items():
            if not labels.isdisjoint(channels):
                return path.name
        while self._unread:
            path = self._unread.pop(0)
            self._labels[path] = labels = self._read(path)
            if not labels.isdisjoint(channels):
                return path.name
        return None

    def _read(self, path: Path) -> frozenset[str]:
        """What the header of a log names; nothing where it cannot be read, which is said where it is ingested."""
        try:
            groups = open_recording(path, self._options).groups
        except (RecordingError, OSError):
            return frozenset()
        return frozenset(channel.label for group in groups for channel in group.channels)
