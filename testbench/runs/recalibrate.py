"""A corrected calibration of a sensor in stored runs: checked against each of them, then recorded."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from balance.errors import UnitError, suggestion

from ..calibration import certificate
from ..calibration.definition import Calibration
from ..calibration.evaluation import CalibrationLaw, bind_sensor
from ..errors import AnalysisError, RigError, StoreError
from ..rig import Column
from ..store import Run, atomic_files
from . import calibration_history
from .si_run import SIRun


@dataclass(frozen=True)
class Corrected:
    """What was recorded: the record, the runs that it is about, and those that do not hold the sensor."""

    record: Path
    runs: tuple[str, ...]
    without: tuple[str, ...]
    left_out: dict[str, str]
    """Why a run cannot be named in a record, by its name: its digest file is missing or damaged."""
    changes: bool
    """Whether a reading is another than before in any of the runs."""


def calibrate(runs: Sequence[Run], sensor: str, calibration: Calibration, reason: str) -> Corrected:
    """Record a calibration of ``sensor`` in ``runs`` of one campaign. Nothing is recorded unless it fits all of them.

    Raises RigError where a rig has no such sensor, no run holds its channels, or the units do not lead to what it
    measures; StoreError where no run that holds them has its digest.
    """
    if not reason.strip():
        raise RigError("a corrected calibration needs a reason, such as 'certificate 4711 of March'")
    folders = {run.path.parent for run in runs}
    if len(folders) != 1:
        raise RigError("a record is about runs of one campaign: give each campaign a command of its own")
    calibrated: list[Run] = []
    without: list[str] = []
    left_out: dict[str, str] = {}
    changes = False
    for run in runs:
        si = SIRun.of(run)
        columns = _columns(si, sensor)
        if not any(si.holds(column) for column in columns):
            without.append(run.name)
            continue
        try:
            law = bind_sensor(calibration, columns, [si.written_unit(column) for column in columns])
        except UnitError as error:
            raise RigError(f"{run.name}: sensor {sensor}: {error}") from error
        try:
            atomic_files.recorded_digest(run.path)
        except StoreError as error:
            left_out[run.name] = str(error)
        else:
            calibrated.append(run)
            changes = changes or not _reads_as_before(si, columns, law)
    if left_out and not calibrated:
        raise StoreError("; ".join(left_out.values()))
    if not calibrated:
        raise RigError(f"sensor {sensor}: none of the runs holds a channel of it: give the runs that do")
    record = calibration_history.write_calibration(
        folders.pop(), [run.path for run in calibrated], sensor, calibration, reason.strip()
    )
    return Corrected(record, tuple(run.name for run in calibrated), tuple(without), left_out, changes)


def _reads_as_before(run: SIRun, columns: Sequence[Column], law: CalibrationLaw) -> bool:
    """Whether a law leads the readings of a sensor to what they are already."""
    try:
        before = [run.readings(column) for column in columns]
    except (AnalysisError, StoreError):  # nothing led to SI before, or a calibration of other bytes
        return False
    converted = [law.component(column.index, lambda i: run.as_recorded(columns[i])) for column in columns]
    return all(np.allclose(*pair, rtol=1e-9, atol=0.0, equal_nan=True) for pair in zip(converted, before, strict=True))


def certified(run: Run, sensor: str, file: Path, frequency_hz: float | None, quantity: str) -> dict[str, Any]:
    """Keys of a calibration of ``sensor`` by a digital calibration certificate (see ``certificate``).

    Raises RigError where the certificate does not say it, or is of another serial number than the sensor's data sheet.
    """
    si = SIRun.of(run)
    columns = _columns(si, sensor)
    found = certificate.read_certificate(file)
    sheet = si.rig.sensors[sensor].teds
    if sheet is not None and sheet.serial and found.serials and sheet.serial not in found.serials:
        raise RigError(
            f"{file.name}: is of serial number {' or '.join(found.serials)}, sensors.{sensor}.teds.serial is "
            f"{sheet.serial}: give the certificate of this sensor"
        )
    return found.calibration(columns[0].dimensions, frequency_hz, quantity)


def _columns(run: SIRun, sensor: str) -> list[Column]:
    sensors = run.rig.sensors
    if sensor not in sensors:
        known = ", ".join(sensors)
        raise RigError(
            f"{run.name}: its rig has no sensor {sensor!r}{suggestion(sensor, sensors)} (there are: {known})"
        )
    return list(sensors[sensor].columns(sensor))
