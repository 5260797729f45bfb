"""Amplitudes of the base's vibration in a stored run, in m/s2: every one names its metric and band."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from balance.arrays import Floats
from balance.errors import UnitError

from . import units
from .errors import AnalysisError
from .signals import Band, without_offset

if TYPE_CHECKING:
    from .rig import Column, Rig
    from .store import Run

Metric = Literal["peak", "peak_to_peak", "rms"]
METRICS: dict[Metric, tuple[str, Callable[[Floats], float]]] = {
    "peak": ("largest absolute value", lambda a: float(np.abs(a).max())),
    "peak_to_peak": ("largest value less smallest", lambda a: float(np.ptp(a))),
    "rms": ("root mean square over the whole record", lambda a: float(np.sqrt(np.mean(a**2)))),
}
"""What each metric is, of a record whose mean was removed and whose band was cut out."""
DEFAULT_METRIC: Metric = "peak_to_peak"
"""It does not depend on what counts as zero."""
DEFAULT_BAND = Band(0.0, 200.0)
"""Holds the motion (below 60 Hz) and the base's modes; above lies the noise of the accelerometer."""


@dataclass(frozen=True)
class Measure:
    """How an amplitude is taken: mean over the record removed, then the band, then the metric."""

    metric: Metric = DEFAULT_METRIC
    band: Band | None = DEFAULT_BAND

    def __str__(self) -> str:
        return f"{self.metric} ({METRICS[self.metric][0]}), mean removed, band {self.band or 'not limited'}"

    @property
    def band_hz(self) -> list[float] | None:
        """The band as it is printed."""
        return [self.band.low_hz, self.band.high_hz] if self.band else None

    def of(self, values: Floats, rate_hz: float) -> float:
        """Amplitude of a signal (n,), in the signal's unit."""
        return METRICS[self.metric][1](self.shape(values, rate_hz))

    def shape(self, values: Floats, rate_hz: float) -> Floats:
        """The signal (n,) of which the metric is taken."""
        values = without_offset(values)
        return self.band.of(values, rate_hz) if self.band else values


def base_accelerations(run: "Run", rig: "Rig") -> dict[tuple[str, str], tuple[Floats, float]]:
    """Acceleration (n,) [m/s2] and rate [Hz] of each axis of each accelerometer on the base, by (sensor, axis)."""
    sensors = rig.base_accelerometers
    if not sensors:
        raise AnalysisError(
            f"{run.name}: its rig has no accelerometer that is attached_to the base: there is no base vibration to "
            "judge; add the sensor to the rig and ingest again"
        )
    return {
        (name, column.component): acceleration(run, column)
        for name, sensor in sensors.items()
        for column in sensor.columns(name)
    }


def acceleration(run: "Run", column: "Column") -> tuple[Floats, float]:
    """One channel of a run, (n,) [m/s2], and its rate [Hz]. In an acceleration, ``g`` is g0 = 9.81 m/s2."""
    group, index = run.find(column.channel)
    factor = _to_si(run.name, column, group.channels[index].unit)
    if group.rate_hz is None:
        raise AnalysisError(f"{run.name}: channel {column.channel!r} has no sampling rate: expected a regular clock")
    values = run.channel(column.channel)
    if not np.isfinite(values).all():
        where = int(np.flatnonzero(~np.isfinite(values))[0])
        raise AnalysisError(
            f"{run.name}: channel {column.channel!r} holds no number at sample {where}; cut or repair it"
        )
    return values * factor, group.rate_hz


def _to_si(run: str, column: "Column", written: str | None) -> float:
    """SI per unit; the log's unit and the rig's must agree where both are given."""
    from .rig.fields import unit_factor

    where = f"{run}: channel {column.channel!r}"
    if written and column.unit and not units.same(written, column.unit):
        raise AnalysisError(f"{where} is in {written!r} by its log and in {column.unit!r} by the rig: correct one")
    unit = written or column.unit
    if not unit:
        raise AnalysisError(f"{where} has no unit, neither in its log nor in the rig: say sensors.{column.sensor}.unit")
    try:
        return unit_factor(unit, *column.dimensions)
    except UnitError as error:
        raise AnalysisError(f"{where}: {error}") from error
