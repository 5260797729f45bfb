"""RO-Crate 1.1: a campaign for other people, each run with its origin, licence and logs, in one JSON-LD file.

https://www.researchobject.org/ro-crate/specification/1.1/
"""

import json
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from ..errors import StoreError
from ..public_recordings import recordings_by_file
from ..store import Campaign, Run, append_only_records, atomic_files
from ..store.campaign import SUMS
from ..store.ledger import read_ledger
from . import Exported

NAME = "ro-crate-metadata.json"
SPECIFICATION = "https://w3id.org/ro/crate/1.1"
HDF5 = "https://www.nationalarchives.gov.uk/PRONOM/fmt/807"
_UNSTATED = "No licence is stated: all rights stay with the owner of the recording; ask before using it."


def export_crate(campaign: Campaign, runs: Sequence[Run], folder: Path, licence: str | None) -> Exported:
    """Copy runs with their digests into ``folder``, checked, and describe them; the campaign may be the crate."""
    target = folder / NAME
    if target.exists():
        raise StoreError(f"{target}: is there already; nothing is overwritten, name another folder")
    # The later records about ``runs``: without them, a calibration that was corrected would be wrong again.
    names = {run.path.name for run in runs}
    later = [record for record in append_only_records.read_records(campaign.path) if names & record.runs.keys()]
    head = read_ledger(campaign.path).head
    metadata = crate_metadata(campaign.path.resolve().name, runs, licence, later, head)
    text = json.dumps(metadata, indent=1, ensure_ascii=False)
    with _whole_or_not(folder) as made:
        if folder.resolve() != campaign.path.resolve():
            for run in runs:
                _copy(run.path, folder, made)
            copies = [folder / append_only_records.FOLDER / record.name for record in later]
            made += [path for path in copies if not path.exists()]
            append_only_records.copy(campaign.path, folder, {path.name for path in copies})
        part = folder / f".{NAME}.new"
        made.append(part)
        part.write_text(text + "\n", encoding="utf-8")
        part.rename(target)
        made += [target, folder / SUMS]
        described = sorted(folder / unquote(one["@id"]) for one in metadata["@graph"][1]["hasPart"])
        lines = [atomic_files.line_for(path.relative_to(folder).as_posix(), atomic_files.sha256_of(path))
                 for path in [target, *described]]  # fmt: skip
        (folder / SUMS).write_text("".join(lines), encoding="utf-8", newline="")
    without = [run.name for run in runs if _UNSTATED in _licences(run, licence)]
    losses = (f"no licence is stated for {', '.join(without)}: say --licence",) if without else ()
    return Exported(target, losses)


def crate_metadata(
    name: str,
    runs: Sequence[Run],
    licence: str | None,
    later: Sequence[append_only_records.Record] = (),
    head: str | None = None,
) -> dict[str, Any]:
    """The description of ``runs`` and the ``later`` records about them as JSON-LD; ``head`` is that of the ledger."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    parts = [node for run in runs for node in _run(run, licence)]
    parts += [
        {
            "@id": _uri(f"{append_only_records.FOLDER}/{record.name}"),
            "@type": "File",
            "name": record.name,
            "description": f"{record.kind}, recorded later about runs, which never change",
            "encodingFormat": "application/json",
            "dateCreated": record.written,
            "about": [{"@id": _uri(run.path.name)} for run in runs if run.path.name in record.runs],
        }
        for record in later
    ]
    licences = list(dict.fromkeys(text for run in runs for text in _licences(run, licence)))
    simulated = any(run.origin == "simulated" for run in runs)
    root: dict[str, Any] = {
        "@id": "./",
        "@type": "Dataset",
        "name": name,
        "description": f"{len(runs)} runs of test benches in HDF5, stored by counterpoise"
        + ("; runs of origin 'simulated' were not measured." if simulated else "."),
        "datePublished": now,
        "license": _references(licences),
        **({} if head is None else {"identifier": f"sha256:{head}"}),
        "hasPart": [{"@id": node["@id"]} for node in parts if node["@type"] == "File"],
    }
    metadata = {"@id": NAME, "@type": "CreativeWork", "conformsTo": {"@id": SPECIFICATION}, "about": {"@id": "./"}}
    software = {"@id": "#counterpoise", "@type": "SoftwareApplication", "name": "counterpoise"}
    form = {"@id": HDF5, "@type": "WebSite", "name": "Hierarchical Data Format 5"}
    stated = [{"@id": _identity(text), "@type": "CreativeWork", "name": text, "description": text} for text in licences]
    graph = [metadata, root, *parts, {**software, "version": version("counterpoise")}, form, *stated]
    return {"@context": f"{SPECIFICATION}/context", "@graph": list({node["@id"]: node for node in graph}.values())}


def _run(run: Run, licence: str | None) -> list[dict[str, Any]]:
    """A run, its digest, and the logs that it was made of, which are not in the crate."""
    logs = [_log(source) for source in run.provenance["sources"]]
    properties = [
        {
            "@id": f"#{_uri(run.name)}-{key}",
            "@type": "PropertyValue",
            "name": key,
            "value": value if isinstance(value, str | int | float) else json.dumps(value, ensure_ascii=False),
        }
        for key, value in {"origin": run.origin, **run.conditions}.items()
    ]
    node = {
        "@id": _uri(run.path.name),
        "@type": "File",
        "name": run.name,
        "description": f"origin: {run.origin}",
        "encodingFormat": ["application/x-hdf5", {"@id": HDF5}],
        "contentSize": str(run.path.stat().st_size),
        "sha256": atomic_files.recorded_digest(run.path),
        "dateCreated": run.provenance.get("written", ""),
        "license": _references(_licences(run, licence)),
        "isBasedOn": [{"@id": log["@id"]} for log in logs],
        "additionalProperty": [{"@id": value["@id"]} for value in properties],
        "creator": {"@id": "#counterpoise"},
    }
    name = atomic_files.digest_file(run.path).name
    beside = {"@id": _uri(name), "@type": "File", "name": name, "encodingFormat": "text/plain"}
    return [node, beside, *logs, *properties]


def _uri(name: str) -> str:
    """A name as JSON-LD refers to it: signs that mean something in a URI are escaped, letters of any script are not."""
    return "".join(quote(c, safe="/+()@,=~") if c.isascii() else c for c in name)


def _log(source: dict[str, Any]) -> dict[str, Any]:
    recording = _recordings().get(source.get("sha256", ""))
    node: dict[str, Any] = {
        "@id": f"#log-{source.get('sha256') or _uri(source['name'])}",
        "@type": "CreativeWork",
        "name": source["name"],
        "description": f"the log as it was recorded, {source.get('size_bytes')} bytes; not in this crate",
    }
    if source.get("sha256"):  # that of a log whose ingest was stopped is not known
        node["sha256"] = source["sha256"]
    return node if recording is None else {**node, "creditText": recording.credit, "url": recording.url}


def _recordings() -> dict[str, Any]:
    return {recording.sha256: recording for recording in recordings_by_file().values()}


def _licences(run: Run, licence: str | None) -> list[str]:
    """Licences of what a run was made of: of public recordings their own, of any other log ``licence``."""
    known, other = _recordings(), licence or _UNSTATED
    digests = [source.get("sha256") for source in run.provenance["sources"]]
    found = [known[sha256].licence if sha256 in known else other for sha256 in digests]
    return list(dict.fromkeys(found)) or [other]


def _references(licences: Sequence[str]) -> dict[str, str] | list[dict[str, str]]:
    found = [{"@id": _identity(licence)} for licence in licences]
    return found[0] if len(found) == 1 else found


def _identity(licence: str) -> str:
    """What a licence is called: its address, that of its SPDX name, else a name in this file for what was said."""
    if licence.startswith(("http://", "https://")):
        return licence
    if licence == _UNSTATED:
        return "#licence-unstated"
    short = licence.isascii() and all(c.isalnum() or c in "-.+" for c in licence)
    return f"https://spdx.org/licenses/{licence}" if short else f"#licence-{_uri(licence)}"


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
        for made_folder in (folder / append_only_records.FOLDER, folder) if is_new else ():
            with suppress(OSError):  # it was not made yet
                made_folder.rmdir()
        if isinstance(error, OSError):
            reason = error.strerror or error
            raise StoreError(f"{folder}: the crate cannot be written ({reason}); nothing of it is left") from error
        raise


def _copy(run: Path, folder: Path, made: list[Path]) -> None:
    """Copy a run and its digest, which must match; never over another file. What is made is added to ``made``."""
    target = folder / run.name
    for path in (target, atomic_files.digest_file(target)):
        if path.exists():
            raise StoreError(f"{path}: is there already; nothing is overwritten, name another folder")
    made += [target, atomic_files.digest_file(target)]
    shutil.copyfile(run, target)
    shutil.copyfile(atomic_files.digest_file(run), atomic_files.digest_file(target))
    if atomic_files.sha256_of(target) != atomic_files.recorded_digest(run):
        raise StoreError(f"{run.name}: is not what was stored, see `testbench verify`; it was not copied")
