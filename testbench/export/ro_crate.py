"""RO-Crate 1.1: a campaign for other people, each run with its origin, licence and logs, in one JSON-LD file.

https://www.researchobject.org/ro-crate/specification/1.1/
"""

import json
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..errors import StoreError
from ..recordings import registry
from ..store import Campaign, Run, digest
from .target import Exported

NAME = "ro-crate-metadata.json"
SPECIFICATION = "https://w3id.org/ro/crate/1.1"
_UNSTATED = "No licence is stated: all rights stay with the owner of the recording; ask before using it."


def write(campaign: Campaign, runs: Sequence[Run], folder: Path, licence: str | None) -> Exported:
    """Copy runs with their digests into ``folder``, checked, and describe them; the campaign may be the crate."""
    target = folder / NAME
    if target.exists():
        raise StoreError(f"{target}: is there already; nothing is overwritten, name another folder")
    text = json.dumps(document(campaign.path.resolve().name, runs, licence), indent=1, ensure_ascii=False)
    with _whole_or_not(folder) as made:
        if folder.resolve() != campaign.path.resolve():
            for run in runs:
                _copy(run.path, folder, made)
        part = folder / f".{NAME}.new"
        made.append(part)
        part.write_text(text + "\n", encoding="utf-8")
        part.rename(target)
    without = [run.name for run in runs if licence is None and not _known_licences(run)]
    losses = (f"no licence is stated for {', '.join(without)}: say --licence",) if without else ()
    return Exported(target, losses)


def document(name: str, runs: Sequence[Run], licence: str | None) -> dict[str, Any]:
    """The description as JSON-LD."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    parts = [node for run in runs for node in _run(run, licence)]
    licences = {text: _licence(text) for node in parts for text in _texts(node)}
    simulated = any(run.origin == "simulated" for run in runs)
    root: dict[str, Any] = {
        "@id": "./",
        "@type": "Dataset",
        "name": name,
        "description": f"{len(runs)} runs of test benches in HDF5, stored by counterpoise"
        + ("; runs of origin 'simulated' were not measured." if simulated else "."),
        "datePublished": now,
        "license": _reference(licence or _UNSTATED),
        "hasPart": [{"@id": node["@id"]} for node in parts if node["@type"] == "File"],
    }
    about = {"@id": "./"}
    metadata: dict[str, Any] = {
        "@id": NAME,
        "@type": "CreativeWork",
        "conformsTo": {"@id": SPECIFICATION},
        "about": about,
    }
    software: dict[str, Any] = {
        "@id": "#counterpoise",
        "@type": "SoftwareApplication",
        "name": "counterpoise",
        "version": version("counterpoise"),
    }
    known = {text: _licence(text) for text in (licence or _UNSTATED,)} | licences
    graph = [metadata, root, *parts, software, *known.values()]
    return {"@context": f"{SPECIFICATION}/context", "@graph": list({node["@id"]: node for node in graph}.values())}


def _run(run: Run, licence: str | None) -> list[dict[str, Any]]:
    """A run, its digest, and the logs that it was made of, which are not in the crate."""
    logs = [_log(source) for source in run.provenance["sources"]]
    known = _known_licences(run) or [licence or _UNSTATED]
    conditions = [
        {"@type": "PropertyValue", "name": key, "value": value if isinstance(value, str | int | float) else str(value)}
        for key, value in {"origin": run.origin, **run.conditions}.items()
    ]
    properties = [{**value, "@id": f"#{run.path.stem}-{value['name']}"} for value in conditions]
    node = {
        "@id": run.path.name,
        "@type": "File",
        "name": run.name,
        "description": f"origin: {run.origin}",
        "encodingFormat": ["application/x-hdf5", {"@id": "https://www.nationalarchives.gov.uk/PRONOM/fmt/807"}],
        "contentSize": str(run.path.stat().st_size),
        "sha256": digest.recorded(run.path),
        "dateCreated": run.provenance.get("written", ""),
        "license": [_reference(text) for text in known] if len(known) > 1 else _reference(known[0]),
        "isBasedOn": [{"@id": log["@id"]} for log in logs],
        "additionalProperty": [{"@id": value["@id"]} for value in properties],
        "creator": {"@id": "#counterpoise"},
    }
    name = digest.beside(run.path).name
    beside = {"@id": name, "@type": "File", "name": name, "encodingFormat": "text/plain"}
    return [node, beside, *logs, *properties]


def _log(source: dict[str, Any]) -> dict[str, Any]:
    recording = _recordings().get(source.get("sha256", ""))
    node: dict[str, Any] = {
        "@id": f"#log-{source.get('sha256') or source['name']}",
        "@type": "CreativeWork",
        "name": source["name"],
        "description": f"the log as it was recorded, {source.get('size_bytes')} bytes; not in this crate",
        "sha256": source.get("sha256", ""),
    }
    return node if recording is None else {**node, "creditText": recording.credit, "url": recording.url}


def _recordings() -> dict[str, Any]:
    return {recording.sha256: recording for recording in registry().values()}


def _known_licences(run: Run) -> list[str]:
    """Licences of the public recordings that a run was made of."""
    known = _recordings()
    found = [known[s["sha256"]].licence for s in run.provenance["sources"] if s.get("sha256") in known]
    return list(dict.fromkeys(found))


def _reference(licence: str) -> dict[str, str]:
    return {"@id": _identity(licence)}


def _identity(licence: str) -> str:
    if licence.startswith(("http://", "https://")):
        return licence
    short = all(c.isalnum() or c in "-.+" for c in licence)
    return f"https://spdx.org/licenses/{licence}" if short else "#licence-unstated"


def _licence(licence: str) -> dict[str, Any]:
    return {"@id": _identity(licence), "@type": "CreativeWork", "name": licence, "description": licence}


def _texts(node: dict[str, Any]) -> list[str]:
    """The licences that a node refers to, as they are written."""
    given = node.get("license", [])
    identities = [one["@id"] for one in (given if isinstance(given, list) else [given])]
    return [_UNSTATED if i == "#licence-unstated" else i.removeprefix("https://spdx.org/licenses/") for i in identities]


@contextmanager
def _whole_or_not(folder: Path) -> Iterator[list[Path]]:
    """A folder for a crate, and the list of what is made in it, which is taken away again where something fails."""
    made: list[Path] = []
    is_new = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield made
    except BaseException as error:
        for path in made:
            path.unlink(missing_ok=True)
        if is_new and folder.is_dir():
            folder.rmdir()
        if isinstance(error, OSError):
            reason = error.strerror or error
            raise StoreError(f"{folder}: the crate cannot be written ({reason}); nothing of it is left") from error
        raise


def _copy(run: Path, folder: Path, made: list[Path]) -> None:
    """Copy a run and its digest, which must match; never over another file. What is made is added to ``made``."""
    target = folder / run.name
    for path in (target, digest.beside(target)):
        if path.exists():
            raise StoreError(f"{path}: is there already; nothing is overwritten, name another folder")
    made += [target, digest.beside(target)]
    shutil.copyfile(run, target)
    shutil.copyfile(digest.beside(run), digest.beside(target))
    if digest.sha256_of(target) != digest.recorded(run):
        raise StoreError(f"{run.name}: is not what was stored, see `testbench verify`; it was not copied")
