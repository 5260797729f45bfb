"""What a stopped ingest leaves in a campaign: found, finished if it was whole, saved as far as it was acknowledged."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Annotated

from balance.results import Key

from ..errors import StoreError
from ..recording import Samples
from . import archive, atomic_files
from .atomic_files import Journal, Kept, Leftover, one_at_a_time, place_with_digest, read_journal
from .chunk_io import checked_samples, digest
from .ledger import enter_run, read_ledger
from .run import Run, open_run

MARK = ".recovered"
"""At the end of a recovered run's name: the name of the run itself stays free for the whole log."""


@dataclass(frozen=True)
class Recovery:
    """What became of a leftover: ``recovered``, ``completed``, ``superseded``, ``empty``, ``running`` or ``failed``."""

    run: Annotated[str, Key("", "run")]
    status: Annotated[str, Key("", "status")]
    message: Annotated[str, Key("", "what")]
    file: Annotated[str | None, Key("", "file")] = None
    samples: Annotated[dict[str, int], Key()] = field(default_factory=dict)


Save = Callable[[Leftover, Journal], Recovery]
"""How acknowledged samples become a run."""


def finish(leftover: Leftover, save: Save) -> Recovery | None:
    """Finish or save what is here, then remove it; what cannot be read stays. None: it was stopped before it began.

    A journal says what is meant before anything else is made: without that there is no run, unless the machine
    itself lost what was noted.
    """
    try:
        with atomic_files.taken(leftover.journal) as is_ours:
            if not is_ours:
                return Recovery(leftover.run, "running", "an ingest is writing it at this moment; left alone")
            found = _recovered(leftover, save)
            leftover.part.unlink(missing_ok=True)
            leftover.journal.unlink(missing_ok=True)
    except FileNotFoundError:
        return Recovery(leftover.run, "superseded", "another process has taken care of it")
    except (StoreError, OSError) as error:
        return Recovery(leftover.run, "failed", f"{error}; {leftover.part.name} and its journal stay where they are")
    return found


def _recovered(leftover: Leftover, save: Save) -> Recovery | None:
    known = read_journal(leftover.journal)
    if not known.intent:
        if leftover.part.exists():
            raise StoreError(f"{leftover.journal.name}: is empty, as after a loss of power; ingest the log again")
        return None
    if known.sealed is not None:
        with one_at_a_time(leftover.target.parent):
            if _is_placed(leftover, known.sealed):
                if not read_ledger(leftover.target.parent).holds(leftover.target.name):
                    enter_run(leftover.target, known.sealed, {"recovered": True})
                message = "was written whole; nothing is lost"
                return Recovery(leftover.run, "completed", message, leftover.target.name)
    if archive.INTENT in known.intent:
        message = f"the archive of {known.intent[archive.INTENT]} was not finished; that run is whole: archive it again"
        return Recovery(leftover.run, "superseded", message)
    if not leftover.part.exists():
        return save(leftover, Journal(known.intent))
    _cut_to_the_disk(leftover, known)
    if not any(kept.samples for kept in known.groups):
        return Recovery(leftover.run, "empty", "no sample had been acknowledged; ingest the log again")
    if leftover.target.exists():
        run, stored = open_run(leftover.target), leftover.target.name
        if all(_holds(run, kept, leftover) for kept in known.groups if kept.samples):
            message = f"the campaign holds all of it as {stored}; nothing is lost"
            return Recovery(leftover.run, "superseded", message, stored)
    return save(leftover, known)


def _is_placed(leftover: Leftover, sealed: str) -> bool:
    """Whether a run that was written to its end is in its place, where it is put if it is not."""
    if not leftover.part.exists():
        return leftover.target.exists()  # the part goes only after the run is there
    if atomic_files.sha256_of(leftover.part) != sealed:
        return False
    digest = atomic_files.digest_file(leftover.target)
    if leftover.target.exists():
        return digest.exists() and atomic_files.recorded_digest(leftover.target) == sealed
    if digest.exists() and atomic_files.recorded_digest(leftover.target) == sealed:
        digest.unlink()
    place_with_digest(leftover.part, leftover.target, sealed)
    return True


def _cut_to_the_disk(leftover: Leftover, known: Journal) -> None:
    """Leave out of the journal what a loss of power took: of each group what follows the first chunk that is not there.

    Raises StoreError for a chunk that is damaged though it was synced, or though the machine has not stopped since.
    """
    for kept in known.groups:
        whole = 0
        try:
            for _ in blocks(leftover, kept):
                whole += 1
        except StoreError:
            has_not_stopped = bool(known.boot) and known.boot == atomic_files.boot_id()
            if whole < kept.synced or has_not_stopped:
                raise
            kept.pieces = [column[:whole] for column in kept.pieces]


def blocks(leftover: Leftover, kept: Kept) -> Iterator[tuple[Samples, ...]]:
    """The acknowledged samples of a group, (n,) a channel as recorded [-], chunk by chunk.

    Raises StoreError if one is not as it was written.
    """
    first = 0
    with leftover.part.open("rb") as stream:
        for row in zip(*kept.pieces, strict=True):
            columns = []
            for channel, piece in enumerate(row):
                stream.seek(piece.at)
                try:
                    samples = checked_samples(stream.read(piece.size))[: piece.count]
                except (OSError, ValueError) as error:
                    message = f"{leftover.part.name}: damaged at byte {piece.at}; its checksum does not match"
                    raise StoreError(message) from error
                found = digest(samples, leftover.tag, kept.number, channel, first).hex()
                if piece.digest and piece.digest != found:
                    raise StoreError(f"{leftover.part.name}: damaged at byte {piece.at}: not the samples written there")
                columns.append(samples)
            yield tuple(columns)
            first += row[0].count


def _holds(run: Run, kept: Kept, leftover: Leftover) -> bool:
    """Whether a stored run begins with the acknowledged samples of a group."""
    names = [group.name for group in run.groups]
    if kept.group.name not in names or run.group(kept.group.name).channels != kept.group.channels:
        return False
    stored = [run.channel_at(kept.group.name, i) for i in range(len(kept.group.channels))]
    start = 0
    for columns in blocks(leftover, kept):
        stop = start + len(columns[0])
        if any(s[start:stop].tobytes() != c.tobytes() for s, c in zip(stored, columns, strict=True)):
            return False
        start = stop
    return True
