"""Records about the runs of a campaign: alignments, calibrations, decisions. Dated, only ever added, never changed.

A record is one JSON file in ``records/``; it names the runs that it is about with their SHA-256, so that it says of
which bytes it holds, and the SHA-256 of what it says itself. What is current is the newest of its kind: that with the
highest number, whatever the clock showed when it was written.
"""

import hashlib
import json
import os
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from uuid import uuid4

from ..errors import StoreError
from . import atomic_files, ledger
from .atomic_files import one_at_a_time, sync
from .run import identities

FOLDER = "records"
LAYOUT = 3
_KEYS = {"layout", "kind", "written", "software", "runs", "content"}
"""Of a record, without its digest, which layout 1 had not, and its number, which layouts 1 and 2 had not."""
_QUOTED = ("code", "by", "reason")
"""Of what a record says, quoted in the ledger."""


@dataclass(frozen=True)
class Record:
    """One record."""

    name: str
    kind: str
    number: int
    """Higher than that of every record that was there before; 0 of those that have none."""
    written: str
    """When, ISO 8601, UTC, by the clock of the machine."""
    runs: Mapping[str, str]
    """SHA-256 of the runs that it is about, by file name."""
    content: Mapping[str, Any]


def append_record(campaign: Path, kind: str, runs: Sequence[Path], content: Mapping[str, Any]) -> Path:
    """Add a record about stored runs of ``campaign``; returns its file. It is there whole or not at all."""
    from importlib.metadata import version

    folder = campaign / FOLDER
    try:
        with one_at_a_time(campaign):
            now = datetime.now(UTC)
            entered = (entry.details.get("number", 0) for entry in ledger.read_ledger(campaign).entries)
            document = {
                "layout": LAYOUT,
                "number": 1 + max([*(record.number for record in read_records(campaign)), *entered], default=0),
                "kind": kind,
                "written": now.isoformat(timespec="microseconds"),
                "software": {"counterpoise": version("counterpoise")},
                "runs": {run.name: atomic_files.recorded_digest(run) for run in runs},
                "content": content,
            }
            document["sha256"] = _digest(document)
            text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
            target = folder / f"{now:%Y%m%dT%H%M%S%f}Z-{kind}-{uuid4().hex[:8]}.json"
            folder.mkdir(exist_ok=True)
            _write(target, text)
            details = {"kind": kind, "number": document["number"]} | {k: content[k] for k in _QUOTED if k in content}
            try:
                ledger.enter(campaign, "record", f"{FOLDER}/{target.name}", atomic_files.sha256_of(target), details)
            except OSError:
                target.unlink()
                raise
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written ({error.strerror or error}); nothing was recorded") from error
    return target


def refuse_read_only(campaign: Path) -> None:
    """Raise StoreError if no record can be added, for those who would compute long to find that out."""
    folder = campaign / FOLDER
    place = folder if folder.exists() else campaign
    if not os.access(place, os.W_OK):
        raise StoreError(f"{place}: cannot be written, so nothing can be recorded in it; make it writable")


def read_records(campaign: Path, kind: str | None = None) -> list[Record]:
    """The records of a campaign, of one kind if named, oldest first. Raises StoreError for a file that is none."""
    found = [_record(path) for path in _files(campaign)]
    return sorted((r for r in found if kind in {None, r.kind}), key=lambda record: (record.number, record.written))


def damaged(campaign: Path) -> dict[str, str]:
    """The files that are no records, or not what was written, and what is wrong with each."""
    found = {}
    for path in _files(campaign):
        try:
            _record(path)
        except StoreError as error:
            found[path.name] = str(error)
    return found


def others(campaign: Path) -> list[str]:
    """The files in the folder of records that are none by their names, which nobody reads: renamed, or left behind."""
    folder = campaign / FOLDER
    known = {path.name for path in _files(campaign)}
    return sorted(path.name for path in folder.iterdir() if path.name not in known) if folder.exists() else []


def about(campaign: Path, kind: str, run: Path) -> list[Record]:
    """The records of a kind about a run as it is stored now, or as it was before it was archived, oldest first."""
    found = read_records(campaign, kind)
    known = identities(run) if found else frozenset()
    return [record for record in found if record.runs.get(run.name) in known]


def copy(campaign: Path, folder: Path, names: Container[str] | None = None) -> list[Path]:
    """Copy the records of ``campaign``, of these ``names`` if given, as they are into those of ``folder``.

    Returns the files that were new there.
    """
    known = [record for record in read_records(campaign) if names is None or record.name in names]
    if known:
        (folder / FOLDER).mkdir(exist_ok=True)
    added = []
    for record in known:
        source, target = campaign / FOLDER / record.name, folder / FOLDER / record.name
        if not target.exists():
            _write(target, source.read_text("utf-8"))
            added.append(target)
        elif target.read_bytes() != source.read_bytes():
            raise StoreError(f"{target}: is there already and says something else; nothing was replaced")
    return added


def _files(campaign: Path) -> list[Path]:
    if (campaign / FOLDER).exists() and not (campaign / FOLDER).is_dir():
        raise StoreError(f"{campaign / FOLDER}: is a file; expected the folder of later records, or none")
    return sorted(path for path in (campaign / FOLDER).glob("*.json") if not path.name.startswith("."))


def _digest(document: Mapping[str, Any]) -> str:
    """SHA-256 of what a record says: a digit that changes later is noticed."""
    content = {key: value for key, value in document.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(content, sort_keys=True, ensure_ascii=True).encode("ascii")).hexdigest()


def _record(path: Path) -> Record:
    if not path.is_file():
        raise StoreError(f"{FOLDER}/{path.name}: not a record: no regular file")
    try:
        document = json.loads(path.read_text("utf-8"))
    except (ValueError, RecursionError) as error:
        raise StoreError(f"{FOLDER}/{path.name}: not a record; it may be damaged: {error}") from error
    except OSError as error:
        raise StoreError(f"{FOLDER}/{path.name}: cannot be read: {error.strerror or error}") from error
    layout = document.get("layout") if isinstance(document, dict) else None
    keys = _KEYS | ({"number"} if layout == LAYOUT else set())
    if layout not in (1, 2, LAYOUT) or document.keys() - {"sha256"} != keys:
        raise StoreError(f"{FOLDER}/{path.name}: not a record that this version knows (layout {LAYOUT})")
    if layout != 1 and document.get("sha256") != _digest(document):
        raise StoreError(f"{FOLDER}/{path.name}: not what was written; it is damaged or was edited")
    if not isinstance(document["runs"], dict) or not isinstance(document["content"], dict):
        raise StoreError(f"{FOLDER}/{path.name}: not a record; it may be damaged")
    written, kind = str(document["written"]), str(document["kind"])
    return Record(path.name, kind, int(document.get("number", 0)), written, document["runs"], document["content"])


def _write(target: Path, text: str) -> None:
    """Write under a hidden name, sync, then give it its own, over nothing."""
    part = target.with_name(f".{target.name}.part")
    try:
        with part.open("x", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        os.rename(part, target)
    finally:
        part.unlink(missing_ok=True)
    sync(target.parent)
