"""The ledger of a campaign, ``ledger.jsonl``: what should be in it. Only ever added to, each entry chained to the last.

An entry is a line of JSON: a run or a record that was stored, with its SHA-256; one that a person removed, and why. It
holds the digest of the entry before it and its own; that of the last, the head, stands for the whole campaign, and
whoever has it noted elsewhere can tell whether anything before it was changed. No key signs it: who can write the
folder can write all of it anew, but then to another head.

Whoever appends holds the lock of the campaign; an entry is on the disk before anybody is told that it is there.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

from balance.results import Key

from ..errors import NotConfirmedError, StoreError
from ..recording import Finding
from . import atomic_files
from .atomic_files import one_at_a_time

FILE = "ledger.jsonl"
RUNS, RECORDS = "*.h5", "records/*.json"
"""Where the files of a campaign lie that are entered."""
_KEYS = ("number", "previous", "written", "kind", "file", "sha256", "details")
"""Of an entry, without its digest."""


@dataclass(frozen=True)
class Entry:
    """One line of the ledger."""

    number: Annotated[int, Key("", "entry")]
    """From 1 on, without gaps."""
    previous: str
    """Digest of the entry before; empty of the first."""
    written: Annotated[str, Key("", "written")]
    """When, ISO 8601, UTC, by the clock of the machine."""
    kind: Annotated[str, Key("", "kind")]
    """``run``, ``record``, ``removed``; ``grown``: the log of the run has more than was stored; or ``not_stored``: a
    run of the run table that could not be stored, without bytes, so without ``sha256``."""
    file: Annotated[str, Key("", "file")]
    """In the campaign, such as ``r001.h5``."""
    sha256: Annotated[str, Key()]
    """Of that file."""
    details: Annotated[Mapping[str, Any], Key("", "details", lambda found: json.dumps(found) if found else "")]
    """Such as the findings that were accepted; by whom and why it was removed."""
    digest: Annotated[str, Key()]
    """SHA-256 of all of the above."""

    def line(self) -> bytes:
        """As it stands in the file."""
        known = {key: getattr(self, key) for key in (*_KEYS, "digest")}
        return json.dumps(known, ensure_ascii=True).encode("ascii") + b"\n"


@dataclass(frozen=True)
class Ledger:
    """The entries of a campaign, and what follows from them."""

    entries: tuple[Entry, ...]
    whole: int
    """Bytes of the file up to the last whole line: what an append that was stopped left lies behind."""
    torn: bool = False
    newest: dict[str, Entry] = field(default_factory=dict)
    """The newest entry of each file that was there."""
    grown: frozenset[str] = frozenset()
    """Runs whose logs have more than was stored."""
    not_stored: dict[str, str] = field(default_factory=dict)
    """Why, of each run of a run table that could not be stored and has neither been since nor been given up."""

    @property
    def lacking(self) -> list[Finding]:
        """A finding for each of them."""
        named = ((file.removesuffix(".h5"), why) for file, why in self.not_stored.items())
        return [Finding("not_stored", None, n, f"{n}: is in the run table and not stored: {why}") for n, why in named]

    @property
    def head(self) -> str | None:
        """Digest of the last entry; None if there is none."""
        return self.entries[-1].digest if self.entries else None

    def holds(self, file: str) -> bool:
        """Whether a run or record should be there."""
        return file in self.newest and self.newest[file].kind != "removed"


def read_ledger(campaign: Path) -> Ledger:
    """The ledger of a campaign; of one that has none, without entries. Raises StoreError for one that was changed."""
    path = campaign / FILE
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        content = b""
    except OSError as error:
        raise StoreError(f"{path}: cannot be read ({error.strerror or error})") from error
    whole = content.rfind(b"\n") + 1
    entries = tuple(_entries(content[:whole]))
    newest = {entry.file: entry for entry in entries if entry.kind not in {"grown", "not_stored"}}
    continued = {entry.details.get("continues") for entry in entries}
    grown = frozenset(e.file for e in entries if e.kind == "grown" and e.file not in continued and e.file in newest)
    not_stored: dict[str, str] = {}
    for entry in entries:
        if entry.kind == "not_stored":
            not_stored[entry.file] = str(entry.details.get("reason", ""))
        elif entry.kind != "grown":
            not_stored.pop(entry.file, None)
    return Ledger(entries, whole, whole < len(content), newest, grown, not_stored)


def ledger_heads(folders: Iterable[Path]) -> list[dict[str, Any]]:
    """What the ledgers of campaigns had come to: number of entries, digest of the last one, what people removed."""
    heads = []
    for folder in dict.fromkeys(folders):
        found = read_ledger(folder)
        removed = [{"file": e.file, "written": e.written, **e.details} for e in found.entries if e.kind == "removed"]
        name = folder.resolve().name
        heads.append({"campaign": name, "entries": len(found.entries), "head": found.head, "removed": removed})
    return heads


def _entries(content: bytes) -> Iterator[Entry]:
    previous = ""
    for at, line in enumerate(content.splitlines(), 1):
        try:
            known = json.loads(line)
            entry = Entry(**known)
        except (ValueError, TypeError, RecursionError) as error:
            raise StoreError(f"{FILE}, line {at}: no entry; it is damaged{_WAY_OUT}") from error
        if entry.digest != _digest(known):
            raise StoreError(f"{FILE}, line {at}: not what was written; it is damaged or was edited{_WAY_OUT}")
        if entry.number != at:
            what = f"entries {at} to {entry.number - 1} are missing" if entry.number > at else "out of order"
            raise StoreError(f"{FILE}, line {at}: is entry {entry.number}: {what}{_WAY_OUT}")
        if entry.previous != previous:
            raise StoreError(
                f"{FILE}, line {at}: does not follow from the entry before it: one was exchanged{_WAY_OUT}"
            )
        previous = entry.digest
        yield entry


_WAY_OUT = (
    f"; put back {FILE} as it was, from a copy, or take it out of the campaign and keep it: `testbench recover` begins "
    "a new one with what is there"
)


def enter_growth(campaign: Path, file: str) -> None:
    """Enter that the log of a stored run has more than was stored, if that is not known yet."""
    with one_at_a_time(campaign):
        ledger = read_ledger(campaign)
        if ledger.holds(file) and file not in ledger.grown:
            enter(campaign, "grown", file, ledger.newest[file].sha256)


def enter_not_stored(campaign: Path, file: str, reason: str) -> None:
    """Enter that a run of the run table could not be stored, and why, if that is not known yet."""
    campaign.mkdir(parents=True, exist_ok=True)
    with one_at_a_time(campaign):
        ledger = read_ledger(campaign)
        there = ledger.holds(file) or (campaign / file).exists()  # of a campaign whose ledger begins
        if not there and ledger.not_stored.get(file) != reason:
            enter(campaign, "not_stored", file, "", {"reason": reason})


def remove(campaign: Path, file: str, by: str, reason: str) -> Entry:
    """Take a run or record out of a campaign: entered first, by whom and why, then the file goes.

    Also where the file is gone already, and only nobody said so; done again it ends what was stopped. Raises StoreError
    for a file that is neither there nor in the ledger. A run that was not stored is given up so.
    """
    path = campaign / file
    if path.suffix != (".json" if "/" in file else ".h5"):
        raise StoreError(f"{path}: expected a run (.h5) of a campaign, or one of its records (records/*.json)")
    files = [path, atomic_files.digest_file(path)] if "/" not in file else [path]
    try:
        with one_at_a_time(campaign):
            ledger = read_ledger(campaign)
            there = [one for one in files if one.is_file() or one.is_symlink()]
            if not there and not ledger.holds(file) and file not in ledger.not_stored:
                raise StoreError(f"{file}: neither in {campaign} nor in its ledger; `testbench ledger` lists what is")
            entry = ledger.newest.get(file)
            if entry is None or entry.kind != "removed" or file in ledger.not_stored:
                known = entry.sha256 if entry else atomic_files.sha256_of(there[0]) if there else ""
                entry = enter(campaign, "removed", file, known, {"by": by, "reason": reason})
            for one in there:
                one.unlink()
            atomic_files.sync(path.parent)
    except OSError as error:
        raise StoreError(f"{campaign}: cannot be written ({error.strerror or error})") from error
    return entry


def enter(campaign: Path, kind: str, file: str, sha256: str, details: Mapping[str, Any] | None = None) -> Entry:
    """Append an entry, on the disk when this returns; the caller holds the lock of the campaign.

    A ledger that begins enters first what is there already, marked ``found``. Raises OSError if it cannot be written.
    """
    ledger = read_ledger(campaign)
    added: list[tuple[str, str, str, Mapping[str, Any]]] = [(kind, file, sha256, details or {})]
    if not ledger.entries:
        there = [one for one in _files(campaign) if one[0] != file]
        added = [(its_kind, found, digest, {"found": True}) for found, its_kind, digest in there] + added
    entries = list(ledger.entries)
    for its_kind, name, digest, about in added:
        known: dict[str, Any] = {
            "number": len(entries) + 1,
            "previous": entries[-1].digest if entries else "",
            "written": datetime.now(UTC).isoformat(timespec="milliseconds"),
            "kind": its_kind, "file": name, "sha256": digest, "details": dict(about),
        }  # fmt: skip
        entries.append(Entry(**known, digest=_digest(known)))
    path = campaign / FILE
    is_new = not path.exists()
    with path.open("r+b" if not is_new else "x+b", buffering=0) as stream:
        stream.truncate(ledger.whole)  # what a stopped append left was never acknowledged
        stream.seek(ledger.whole)
        text = b"".join(entry.line() for entry in entries[len(ledger.entries) :])
        try:
            while text:
                text = text[stream.write(text) :]
            os.fsync(stream.fileno())
        except OSError:
            with suppress(OSError):
                stream.truncate(ledger.whole)
            raise
    if is_new:
        atomic_files.sync(campaign)
    return entries[-1]


def enter_run(run: Path, sha256: str, details: Mapping[str, Any]) -> None:
    """Sync the names in the folder of a run that was placed, and enter it; the caller holds the lock.

    Raises NotConfirmedError if one of both fails: the run is there.
    """
    try:
        atomic_files.sync(run.parent)
        enter(run.parent, "run", run.name, sha256, details)
    except OSError as error:
        reason = error.strerror or error
        raise NotConfirmedError(
            f"{run.name}: was written and has its name, but the disk did not confirm it, or its entry in the ledger "
            f"({reason}): it may be lost with the machine's power; once the disk is well, `testbench recover` enters it"
        ) from error


def _digest(known: Mapping[str, Any]) -> str:
    text = json.dumps([known.get(key) for key in _KEYS], sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def _files(campaign: Path) -> Iterator[tuple[str, str, str]]:
    """Name, kind and SHA-256 of the runs, as their digest files have it, and of the records in a campaign."""
    for path in sorted(campaign.glob(RUNS)):
        with suppress(StoreError):  # whose digest cannot be read: damage, which verify names
            if path.is_file() and not path.name.startswith("."):
                yield path.name, "run", atomic_files.recorded_digest(path)
    for path in sorted(campaign.glob(RECORDS)):
        if path.is_file() and not path.name.startswith("."):
            yield f"{path.parent.name}/{path.name}", "record", atomic_files.sha256_of(path)


def enter_found(campaign: Path) -> list[str]:
    """Enter what is whole in a campaign and not in its ledger, marked ``found``; the names of these files.

    So it is after an append that was stopped, and where somebody put a file there by hand.
    """

    newest = read_ledger(campaign).newest
    if all(file in newest for file, _, _ in _files(campaign)):
        return []
    with one_at_a_time(campaign):
        newest, entered = read_ledger(campaign).newest, []
        for file, kind, sha256 in _files(campaign):
            if file in newest or atomic_files.sha256_of(campaign / file) != sha256:
                continue
            entered.append(file)
            if not read_ledger(campaign).holds(file):  # the first entry of all brings the others with it
                enter(campaign, kind, file, sha256, {"found": True})
    return entered


def remove_digests_alone(campaign: Path) -> None:
    """Take away digest files of runs that are not there and were never entered: a loss of power left the one name."""

    def alone() -> list[Path]:
        ledger = read_ledger(campaign)
        digests = [path for path in campaign.glob(f"{RUNS}{atomic_files.SUFFIX}") if not path.name.startswith(".")]
        runs = [path.with_suffix("") for path in digests if ledger.entries]
        return [run for run in runs if not run.exists() and not ledger.holds(run.name)]

    if alone():
        with one_at_a_time(campaign):  # none of them is of a run that gets its name at this moment
            for run in alone():
                atomic_files.digest_file(run).unlink()


def cross_check(campaign: Path, entered: bool) -> Iterator[tuple[str, str, str]]:
    """Where ledger and files differ: name, status and message of each.

    ``entered``: some run says, by its digests, that there was a ledger.
    """
    try:
        ledger = read_ledger(campaign)
    except StoreError as error:
        yield FILE, "damaged", str(error).removeprefix(f"{FILE}, ")
        return
    there = {file: sha256 for file, _, sha256 in _files(campaign)}
    if not ledger.entries:
        if entered:
            what = "its runs were entered into a ledger: it was removed, or they are from elsewhere"
            yield FILE, "missing", f"{what}; `testbench recover` begins a new one with what is there"
        elif there:
            yield (
                FILE,
                "absent",
                "there was none when it was stored, or these are copies: what was removed is not known",
            )
        return
    if ledger.torn:
        yield FILE, "unfinished", "its last line is not whole: an append was stopped; the next one takes its place"
    for file, entry in ledger.newest.items():
        if entry.kind == "removed":
            if file in there:
                by, reason = entry.details.get("by"), entry.details.get("reason")
                yield file, "added", f"was removed by {by} on {entry.written[:10]} ({reason}), and is there again"
        elif file not in there:
            yield file, "missing", f"was entered on {entry.written[:10]} (entry {entry.number}), and nobody removed it"
        elif there[file] != entry.sha256:
            yield file, "damaged", f"other bytes than were entered on {entry.written[:10]} (entry {entry.number})"
    for file in there.keys() - ledger.newest.keys():
        what = "not in the ledger: its append was stopped, or it is from elsewhere; `testbench recover` enters it"
        yield file, "added", what
