"""What a stopped ingest leaves in a campaign: found, finished if it was whole, saved as far as it was acknowledged."""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import StoreError
from . import archive, digest, fletcher, journal, lock
from .journal import Journal, Kept
from .placing import PART, place, unfinished
from .run import Run, open_run

MARK = ".recovered"
"""At the end of a recovered run's name: the name of the run itself stays free for the whole log."""


@dataclass(frozen=True)
class Recovery:
    """What became of a leftover: ``recovered``, ``completed``, ``superseded``, ``empty``, ``running`` or ``failed``."""

    run: str
    status: str
    message: str
    file: str | None = None
    samples: dict[str, int] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """The recovery as it is printed."""
        return asdict(self)


Save = Callable[["Leftover", Journal], Recovery]
"""How acknowledged samples become a run."""


@dataclass(frozen=True)
class Leftover:
    """The files that one stopped ingest left: its journal, and the unfinished run."""

    journal: Path
    part: Path
    run: str
    """The name of the run that it was to become."""
    tag: str
    """What its unfinished files have in common."""

    @property
    def target(self) -> Path:
        """Where the run was to be."""
        return self.part.with_name(f"{self.run}.h5")

    def recover(self, save: Save) -> Recovery | None:
        """Finish or save what is here, then remove it; what cannot be read stays. None: it was stopped before it began.

        A journal says what is meant before anything else is made: without that there is no run, unless the machine
        itself lost what was noted.
        """
        try:
            with self.journal.open("rb") as stream:
                if not lock.hold(stream) or (lock.fcntl is None and lock.is_held(self.journal)):
                    return Recovery(self.run, "running", "an ingest is writing it at this moment; left alone")
                found = self._recovered(save)
        except FileNotFoundError:
            return Recovery(self.run, "superseded", "another process has taken care of it")
        except (StoreError, OSError) as error:
            return Recovery(self.run, "failed", f"{error}; {self.part.name} and its journal stay where they are")
        self.part.unlink(missing_ok=True)
        self.journal.unlink(missing_ok=True)
        return found

    def _recovered(self, save: Save) -> Recovery | None:
        known = journal.read(self.journal)
        if not known.intent:
            if self.part.exists():
                raise StoreError(f"{self.journal.name}: is empty, as after a loss of power; ingest the log again")
            return None
        if self._complete(known.sealed):
            return Recovery(self.run, "completed", "was written whole; nothing is lost", self.target.name)
        if archive.INTENT in known.intent:
            message = (
                f"the archive of {known.intent[archive.INTENT]} was not finished; that run is whole: archive it again"
            )
            return Recovery(self.run, "superseded", message)
        if not any(kept.samples for kept in known.groups):
            return Recovery(self.run, "empty", "no sample had been acknowledged; ingest the log again")
        if (stored := self._superseded(known)) is not None:
            return Recovery(
                self.run, "superseded", f"the campaign holds all of it as {stored}; nothing is lost", stored
            )
        return save(self, known)

    def _complete(self, sealed: str | None) -> bool:
        """Whether the run was written to its end and is in its place, where it is put if it is not."""
        if sealed is None:
            return False
        if not self.part.exists():
            return self.target.exists()  # the part goes only after the run is there
        if digest.sha256_of(self.part) != sealed:
            return False
        beside = digest.beside(self.target)
        if self.target.exists():
            return beside.exists() and digest.recorded(self.target) == sealed
        if beside.exists() and digest.recorded(self.target) == sealed:
            beside.unlink()
        place(self.part, self.target, digest.line_for(self.target.name, sealed))
        return True

    def _superseded(self, known: Journal) -> str | None:
        """The stored run that holds every acknowledged sample, if there is one."""
        if not self.target.exists():
            return None
        run = open_run(self.target)
        whole = all(_holds(run, kept, self.part) for kept in known.groups if kept.samples)
        return self.target.name if whole else None


def leftovers(campaign: Path) -> list[Leftover]:
    """What stopped ingests left in a campaign, those that are running included."""
    found = []
    for path in journal.beside(campaign):
        if (named := unfinished(path)) is not None:
            part = path.with_name(f".{named.name}.{named.tag}{PART}")
            found.append(Leftover(path, part, named.name, named.tag))
    return found


def orphans(campaign: Path) -> list[Path]:
    """Unfinished files without a journal: digests whose ingest was killed, and what nobody can read."""
    there = [(path, named.tag) for path in sorted(campaign.iterdir()) if (named := unfinished(path)) is not None]
    with_journal = {left.tag for left in leftovers(campaign)}
    return [path for path, tag in there if tag not in with_journal]


def is_digest(orphan: Path) -> bool:
    """Whether an unfinished file is a digest on its way, and no run."""
    named = unfinished(orphan)
    return named is not None and named.name.endswith(f".h5{digest.SUFFIX}")


def blocks(part: Path, kept: Kept) -> Iterator[tuple[NDArray[np.float64], ...]]:
    """The acknowledged samples of a group, chunk by chunk. Raises StoreError if one is not as it was written."""
    with part.open("rb") as stream:
        for row in zip(*kept.pieces, strict=True):
            columns = []
            for piece in row:
                stream.seek(piece.at)
                chunk = np.frombuffer(stream.read(piece.size), dtype=np.uint8)
                if len(chunk) != piece.size or not fletcher.is_intact(chunk):
                    raise StoreError(f"{part.name}: damaged at byte {piece.at}; its checksum does not match")
                columns.append(chunk[:-4].view(np.float64)[: piece.count])
            yield tuple(columns)


def _holds(run: Run, kept: Kept, part: Path) -> bool:
    """Whether a stored run begins with the acknowledged samples of a group."""
    names = [group.name for group in run.groups]
    if kept.group.name not in names or run.group(kept.group.name).channels != kept.group.channels:
        return False
    stored = [run.channel_at(kept.group.name, i) for i in range(len(kept.group.channels))]
    start = 0
    for columns in blocks(part, kept):
        stop = start + len(columns[0])
        if any(s[start:stop].tobytes() != c.tobytes() for s, c in zip(stored, columns, strict=True)):
            return False
        start = stop
    return True
