"""Records beside the runs of a campaign: alignments, calibrations, decisions. Dated, only ever added, never changed.

A record is one JSON file in ``records/``; it names the runs that it is about with their SHA-256, so that it says of
which bytes it holds, and the SHA-256 of what it says itself. What is current is the newest of its kind.
"""

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from uuid import uuid4

from ..errors import StoreError
from . import digest
from .archive import identities
from .placing import sync

FOLDER = "records"
LAYOUT = 2
_KEYS = {"layout", "kind", "written", "software", "runs", "content"}
"""Of a record, beside its digest; one of layout 1 has none."""


@dataclass(frozen=True)
class Record:
    """One record."""

    name: str
    kind: str
    written: str
    """When, ISO 8601, UTC."""
    runs: Mapping[str, str]
    """SHA-256 of the runs that it is about, by file name."""
    content: Mapping[str, Any]


def append(campaign: Path, kind: str, runs: Sequence[Path], content: Mapping[str, Any]) -> Path:
    """Add a record about stored runs of ``campaign``; returns its file. It is there whole or not at all."""
    from importlib.metadata import version

    now = datetime.now(UTC)
    document = {
        "layout": LAYOUT,
        "kind": kind,
        "written": now.isoformat(timespec="microseconds"),
        "software": {"counterpoise": version("counterpoise")},
        "runs": {run.name: digest.recorded(run) for run in runs},
        "content": content,
    }
    document["sha256"] = _digest(document)
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    folder = campaign / FOLDER
    target = folder / f"{now:%Y%m%dT%H%M%S%f}Z-{kind}-{uuid4().hex[:8]}.json"
    try:
        folder.mkdir(exist_ok=True)
        _write(target, text)
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written ({error.strerror or error}); nothing was recorded") from error
    return target


def refuse_read_only(campaign: Path) -> None:
    """Raise StoreError if no record can be added, for those who would compute long to find that out."""
    folder = campaign / FOLDER
    place = folder if folder.exists() else campaign
    if not os.access(place, os.W_OK):
        raise StoreError(f"{place}: cannot be written, so nothing can be recorded in it; make it writable")


def read(campaign: Path, kind: str | None = None) -> list[Record]:
    """The records of a campaign, of one kind if named, oldest first. Raises StoreError for a file that is none."""
    found = [_record(path) for path in _files(campaign)]
    return sorted((r for r in found if kind in {None, r.kind}), key=lambda record: record.written)


def damaged(campaign: Path) -> dict[str, str]:
    """The files that are no records, or not what was written, and what is wrong with each."""
    found = {}
    for path in _files(campaign):
        try:
            _record(path)
        except StoreError as error:
            found[path.name] = str(error)
    return found


def about(campaign: Path, kind: str, run: Path) -> list[Record]:
    """The records of a kind about a run as it is stored now, or as it was before it was archived, oldest first."""
    found = read(campaign, kind)
    known = identities(run) if found else frozenset()
    return [record for record in found if record.runs.get(run.name) in known]


def copy(campaign: Path, folder: Path) -> list[Path]:
    """Copy the records of ``campaign`` as they are into that in ``folder``; returns the files that were new there."""
    if not (campaign / FOLDER).is_dir():
        return []
    (folder / FOLDER).mkdir(exist_ok=True)
    added = []
    for record in read(campaign):
        source, target = campaign / FOLDER / record.name, folder / FOLDER / record.name
        if not target.exists():
            _write(target, source.read_text("utf-8"))
            added.append(target)
        elif target.read_bytes() != source.read_bytes():
            raise StoreError(f"{target}: is there already and says something else; nothing was replaced")
    return added


def _files(campaign: Path) -> list[Path]:
    return sorted(path for path in (campaign / FOLDER).glob("*.json") if not path.name.startswith("."))


def _digest(document: Mapping[str, Any]) -> str:
    """SHA-256 of what a record says: a digit that changes later is noticed."""
    said = {key: document[key] for key in _KEYS}
    return hashlib.sha256(json.dumps(said, sort_keys=True, ensure_ascii=True).encode("ascii")).hexdigest()


def _record(path: Path) -> Record:
    try:
        document = json.loads(path.read_text("utf-8"))
    except (ValueError, RecursionError) as error:
        raise StoreError(f"{FOLDER}/{path.name}: not a record; it may be damaged: {error}") from error
    except OSError as error:
        raise StoreError(f"{FOLDER}/{path.name}: cannot be read: {error.strerror or error}") from error
    if not isinstance(document, dict) or document.keys() - {"sha256"} != _KEYS or document["layout"] not in {1, LAYOUT}:
        raise StoreError(f"{FOLDER}/{path.name}: not a record that this version knows (layout {LAYOUT})")
    if document["layout"] == LAYOUT and document.get("sha256") != _digest(document):
        raise StoreError(f"{FOLDER}/{path.name}: not what was written; it is damaged or was edited")
    if not isinstance(document["runs"], dict) or not isinstance(document["content"], dict):
        raise StoreError(f"{FOLDER}/{path.name}: not a record; it may be damaged")
    written, kind = str(document["written"]), str(document["kind"])
    return Record(path.name, kind, written, document["runs"], document["content"])


def _write(target: Path, text: str) -> None:
    """Write beside, sync, then give it its name, over nothing."""
    part = target.with_name(f".{target.name}.part")
    try:
        with part.open("x", encoding="utf-8") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        os.rename(part, target)
    finally:
        part.unlink(missing_ok=True)
    sync(target.parent)
