"""Amplitudes of the base's vibration in a stored run, in m/s2: every one names its metric and band."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from balance.arrays import Floats
from balance.results import Key

from ..errors import AnalysisError
from ..signal import Metric
from ..signal.filters import Band, without_mean

if TYPE_CHECKING:
    from ..runs.si_run import SIRun

METRICS: dict[Metric, tuple[str, Callable[[Floats], float]]] = {
    "peak": ("largest absolute value", lambda a: float(np.abs(a).max())),
    "peak_to_peak": ("largest value less smallest", lambda a: float(np.ptp(a))),
    "rms": ("root mean square over the whole record", lambda a: float(np.sqrt(np.mean(a**2)))),
}
"""What each metric is, of a record whose mean was removed and whose band was cut out."""
DEFAULT_METRIC: Metric = "peak_to_peak"
"""It does not depend on what counts as zero."""
DEFAULT_BAND = Band(0.0, 200.0)
"""Contains the motion (below 60 Hz) and the base's modes; above lies the noise of the accelerometer."""


@dataclass(frozen=True)
class Measure:
    """How an amplitude is taken: mean over the record removed, then the band, then the metric."""

    metric: Annotated[Metric, Key()] = DEFAULT_METRIC
    band: Annotated[Band | None, Key("band_hz", to=Band.limits)] = DEFAULT_BAND

    def __str__(self) -> str:
        return f"{self.metric} ({METRICS[self.metric][0]}), mean removed, band {self.band or 'not limited'}"

    def amplitude(self, values: Floats, rate_hz: float) -> float:
        """Amplitude [unit] of a signal (n,) [unit]."""
        return METRICS[self.metric][1](self.shape(values, rate_hz))

    def shape(self, values: Floats, rate_hz: float) -> Floats:
        """The signal (n,) [unit] without its mean and in the band, (n,) [unit]."""
        values = without_mean(values)
        return self.band.filtered(values, rate_hz) if self.band else values


def base_accelerations(run: "SIRun") -> dict[tuple[str, str], tuple[Floats, float]]:
    """Acceleration (n,) [m/s2] and rate [Hz] of each axis of each accelerometer on the base, by (sensor, axis).

    Raises AnalysisError for a rig without one.
    """
    columns = run.rig.base_columns
    if not columns:
        raise AnalysisError(
            f'{run.name}: its rig has no accelerometer with attached_to = "base", so there is no base vibration to '
            "analyse: add the sensor to the rig and ingest again"
        )
    return {(column.sensor, column.component): run.signal(column) for column in columns}
