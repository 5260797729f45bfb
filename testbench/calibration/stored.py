"""Calibrations as records of a campaign: dated, with a reason, only ever added; the newest about a run holds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import StoreError
from ..store import digest, records
from .document import Calibration

KIND = "calibration"


@dataclass(frozen=True)
class Stored:
    """One record."""

    record: str
    """Name of its file."""
    written: str
    """When, ISO 8601, UTC."""
    runs: Mapping[str, str]
    """SHA-256 of the runs that it is about, by file name."""
    sensor: str
    reason: str
    calibration: Calibration


def write(campaign: Path, runs: Sequence[Path], sensor: str, calibration: Calibration, reason: str) -> Path:
    """Add a calibration of a sensor in stored runs of ``campaign``; returns the record's file."""
    content = {"sensor": sensor, "reason": reason, "calibration": calibration.document()}
    return records.append(campaign, KIND, runs, content)


def read(campaign: Path) -> tuple[Stored, ...]:
    """The calibrations of a campaign, oldest first. Raises StoreError, naming the file, for one that is damaged."""
    return _read(campaign.resolve(), _state(campaign)) if (campaign / records.FOLDER).exists() else ()


def newest(run: Path, sensor: str) -> Stored | None:
    """The newest calibration of a sensor that names a run. Raises StoreError if it is about other bytes."""
    found = [stored for stored in read(run.parent) if stored.sensor == sensor and run.name in stored.runs]
    if not found:
        return None
    if found[-1].record not in _about(run.resolve(), digest.recorded(run), _state(run.parent)):
        raise StoreError(
            f"{records.FOLDER}/{found[-1].record}: calibrates {sensor} in other bytes of {run.name} than those stored "
            f"now; if the new run is right, calibrate it: testbench calibrate {run} {sensor} ..."
        )
    return found[-1]


def _state(campaign: Path) -> tuple[Any, ...]:
    """What changes when a record is added or touched, so that what is remembered is what is there."""
    files = (campaign / records.FOLDER).glob("*.json")
    return tuple(sorted((p.name, p.stat().st_mtime_ns, p.stat().st_size) for p in files))


@lru_cache(maxsize=256)
def _about(run: Path, sha256: str, state: tuple[Any, ...]) -> frozenset[str]:
    return frozenset(record.name for record in records.about(run.parent, KIND, run))


@lru_cache(maxsize=8)
def _read(campaign: Path, state: tuple[Any, ...]) -> tuple[Stored, ...]:
    return tuple(_stored(record) for record in records.read(campaign, KIND))


def _stored(record: records.Record) -> Stored:
    where = f"{records.FOLDER}/{record.name}"
    content = record.content
    if content.keys() - {"sha256"} != {"sensor", "reason", "calibration"}:  # a digest of its own in layout 1
        raise StoreError(f"{where}: not a calibration; it is damaged or was edited")
    try:
        calibration = Calibration.model_validate(content["calibration"])
    except ValidationError as error:
        message = error.errors(include_url=False)[0]["msg"]
        raise StoreError(f"{where}: not a calibration that this version knows: {message}") from error
    return Stored(record.name, record.written, record.runs, content["sensor"], content["reason"], calibration)
