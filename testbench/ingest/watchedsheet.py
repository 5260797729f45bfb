"""A sheet of run conditions that a person goes on writing while runs are made."""

from dataclasses import dataclass, field
from pathlib import Path

from ..errors import RigError
from .sheetrows import SheetRow, read

State = tuple[int, int]
"""Size [bytes] and time of the last change [ns] of a file."""


@dataclass
class WatchedSheet:
    """The rows of a sheet, read again whenever it has changed and its saving is done."""

    path: Path
    settle_s: float
    """It must not have changed for so long [s]."""
    rows: list[SheetRow] | None = field(default=None, init=False)
    """None while it is not there, is being saved, or cannot be read."""
    _state: State | None = field(default=None, init=False)
    _since: float = field(default=0.0, init=False)
    _read: State | None = field(default=None, init=False)
    _known: dict[str, SheetRow] = field(default_factory=dict, init=False)

    def note(self, now: float) -> None:
        """Note the state of the file at ``now`` [s], and since when it has been in it."""
        state = state_of(self.path)
        if state != self._state:
            self._state, self._since = state, now

    def look(self, now: float) -> set[str]:
        """Read what has changed; the files whose rows say something else than before. Raises RigError, once a state."""
        self.note(now)
        if self._state is None or now - self._since < self.settle_s:
            self.rows, self._read = None, None
            return set()
        if self._state == self._read:
            return set()
        self._read, self.rows = self._state, None
        try:
            self.rows = read(self.path)
        except OSError as error:
            raise RigError(f"{self.path.name}: cannot be read: {error.strerror or error}") from error
        before, self._known = self._known, {row.file: row for row in self.rows}
        names = before.keys() | self._known.keys()
        return {Path(name).name for name in names if _says(before.get(name)) != _says(self._known.get(name))}


def state_of(path: Path) -> State | None:
    """Size and time of the last change of a file; None if it is not there."""
    try:
        stat = path.stat()
    except FileNotFoundError:
        return None
    return stat.st_size, stat.st_mtime_ns


def _says(row: SheetRow | None) -> object:
    """What a row says; the line where it stands is no part of it."""
    return None if row is None else (row.run, row.origin, row.conditions)
