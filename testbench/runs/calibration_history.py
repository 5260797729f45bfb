"""Calibrations as records of a campaign: dated, with a reason, only ever added; the newest about a run is in force."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import ValidationError

from balance.results import Key

from ..calibration.definition import Calibration
from ..errors import StoreError
from ..store import append_only_records, atomic_files

KIND = "calibration"


@dataclass(frozen=True)
class CalibrationRecord:
    """One stored correction of a sensor's calibration."""

    record: Annotated[str, Key()]
    """Name of its file."""
    written: Annotated[str, Key("", "written (UTC)", lambda written: written[:19])]
    """When, ISO 8601, UTC."""
    runs: Mapping[str, str]
    """SHA-256 of the runs that it is about, by file name."""
    sensor: Annotated[str, Key("", "sensor")]
    calibration: Annotated[Calibration, Key("", "calibration", str, to=Calibration.document)]
    reason: Annotated[str, Key("", "reason")]

    @property
    def run_names(self) -> Annotated[list[str], Key("runs")]:
        """Names of the runs."""
        return [Path(name).stem for name in self.runs]


@dataclass(frozen=True)
class CalibrationInForce:
    """The calibration in force for a sensor, and its source."""

    sensor: Annotated[str, Key("", "sensor")]
    calibration: Annotated[Calibration, Key("", "calibration", to=str)]
    source: Annotated[str, Key("from")]
    """``rig``, or the name of the record."""
    written: Annotated[str | None, Key()] = None
    """When the record was written, ISO 8601, UTC."""
    reason: Annotated[str | None, Key("", "reason", lambda reason: reason or "")] = None
    runs: Annotated[tuple[str, ...], Key("", "runs", " ".join)] = ()

    @property
    def since(self) -> Annotated[str, Key(None, "since")]:
        """When it was recorded, or ``rig``."""
        return "rig" if self.written is None else self.written[:19]

    @classmethod
    def by_record(cls, found: CalibrationRecord, run: str) -> "CalibrationInForce":
        """That of a record, in one run."""
        return cls(found.sensor, found.calibration, found.record, found.written, found.reason, (run,))

    def __str__(self) -> str:
        since = "of the rig" if self.source == "rig" else f"recorded {(self.written or '')[:16]} UTC: {self.reason}"
        return f"{self.sensor}: {self.calibration} ({since})"


def write_calibration(campaign: Path, runs: Sequence[Path], sensor: str, calibration: Calibration, reason: str) -> Path:
    """Add a calibration of a sensor in stored runs of ``campaign``; returns the record's file."""
    content = {"sensor": sensor, "reason": reason, "calibration": calibration.document()}
    return append_only_records.append_record(campaign, KIND, runs, content)


def read_calibrations(campaign: Path) -> tuple[CalibrationRecord, ...]:
    """The calibrations of a campaign, oldest first. Raises StoreError, naming the file, for one that is damaged."""
    return _read(campaign.resolve(), _state(campaign)) if (campaign / append_only_records.FOLDER).exists() else ()


def newest_by_sensor(run: Path) -> dict[str, CalibrationRecord]:
    """The newest calibration of each sensor that names a run, whatever bytes it is about."""
    return {found.sensor: found for found in read_calibrations(run.parent) if run.name in found.runs}


def refuse_other_bytes(found: CalibrationRecord, run: Path) -> None:
    """Raise StoreError where a record that names a run is about other bytes of it than those stored."""
    if found.record not in _about(run.resolve(), atomic_files.recorded_digest(run), _state(run.parent)):
        raise StoreError(
            f"{append_only_records.FOLDER}/{found.record}: calibrates {found.sensor} in other bytes of {run.name} than "
            f"those stored now; if the new run is right, calibrate it: testbench calibrate {run} {found.sensor} ..."
        )


def _state(campaign: Path) -> tuple[Any, ...]:
    """Key that changes when a record is added or touched: what is cached under it is what is stored."""
    files = (campaign / append_only_records.FOLDER).glob("*.json")
    return tuple(sorted((p.name, p.stat().st_mtime_ns, p.stat().st_size) for p in files))


@lru_cache(maxsize=256)
def _about(run: Path, sha256: str, state: tuple[Any, ...]) -> frozenset[str]:
    return frozenset(record.name for record in append_only_records.about(run.parent, KIND, run))


@lru_cache(maxsize=8)
def _read(campaign: Path, state: tuple[Any, ...]) -> tuple[CalibrationRecord, ...]:
    return tuple(_stored(record) for record in append_only_records.read_records(campaign, KIND))


def _stored(record: append_only_records.Record) -> CalibrationRecord:
    where = f"{append_only_records.FOLDER}/{record.name}"
    content = record.content
    if content.keys() - {"sha256"} != {"sensor", "reason", "calibration"}:  # a digest of its own in layout 1
        raise StoreError(f"{where}: not a calibration; it is damaged or was edited")
    try:
        calibration = Calibration.model_validate(content["calibration"])
    except ValidationError as error:
        message = error.errors(include_url=False)[0]["msg"]
        raise StoreError(f"{where}: not a calibration that this version knows: {message}") from error
    return CalibrationRecord(
        record.name, record.written, record.runs, content["sensor"], calibration, content["reason"]
    )
