"""Amplitudes of the base's vibration in a stored run, in m/s2: every one names its metric and band."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

import numpy as np

from balance.arrays import Floats
from balance.errors import suggestion
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
"""Of levels of any channel: contains the motion (below 60 Hz); above lies the noise of the accelerometer."""
VIBRATION_BAND = Band(1.0, 200.0)
"""Of vibration. The base rests before and after a motion, so that its acceleration and the first moment of it over time
are zero: its spectrum rises with the square of the frequency, and below 1 Hz there are offsets, ramps and drift only,
as long as a leg lasts less than half a second (shipped motions: 0.05 to 0.3 s). It moves no shipped reduction by 0.05
%."""


@dataclass(frozen=True)
class Measure:
    """How an amplitude is taken: what is slow is removed, then the band cut out, then the metric read.

    Slow is a straight line (offset and ramp) where the band has a lower end, else the mean over the record.

    >>> import testbench
    >>> testbench.Measure("rms", testbench.Band(1.0, 100.0)).metric
    'rms'

    ``testbench.analyze``, ``compare`` and ``plan_next`` take one as ``metric``, ``testbench.report.html_report`` as
    ``measure``. Raises AnalysisError for a metric that is none.
    """

    metric: Annotated[Metric, Key()] = DEFAULT_METRIC
    band: Annotated[Band | None, Key("band_hz", to=Band.limits)] = VIBRATION_BAND

    def __post_init__(self) -> None:
        """Refuse a metric that is none."""
        if self.metric not in METRICS:
            hint = suggestion(str(self.metric), METRICS)
            raise AnalysisError(f"metric: {self.metric!r}: expected {', '.join(METRICS)}{hint}")

    def __str__(self) -> str:
        slow = "offset and ramp" if self.detrends else "mean"
        return f"{self.metric} ({METRICS[self.metric][0]}), {slow} removed, band {self.band or 'not limited'}"

    @property
    def detrends(self) -> bool:
        """Whether a ramp is no vibration: the band has a lower end."""
        return self.band is not None and self.band.low_hz > 0.0

    def amplitude(self, values: Floats, rate_hz: float) -> float:
        """Amplitude [unit] of a signal (n,) [unit]."""
        return METRICS[self.metric][1](self.shape(values, rate_hz))

    def shape(self, values: Floats, rate_hz: float) -> Floats:
        """The signal (n,) [unit] without what is slow and in the band, (n,) [unit]."""
        values = self.without_trend(values)
        return self.band.filtered(values, rate_hz) if self.band else values

    def without_trend(self, values: Floats) -> Floats:
        """The signal (n,) [unit] less its mean, and less its ramp where that is no vibration, (n,) [unit]."""
        values = without_mean(values)
        if not self.detrends:
            return values
        along, square = _straight_line(len(values))
        return values - along * (along @ values / square)


@lru_cache(maxsize=4)
def _straight_line(count: int) -> tuple[Floats, float]:
    """From -1 to 1, (count,) [-], and the sum of its squares."""
    along = np.linspace(-1.0, 1.0, count)
    return along, float(along @ along)


@lru_cache(maxsize=16)
def gain_of_record(measure: Measure, count: int, seconds: float, rate_hz: float = np.inf) -> Floats:
    """Factor of a measure's band on amplitudes at multiples of half a period a record, (count,) [-]."""
    if measure.band is None:
        return np.ones(count)
    return measure.band.gain(np.arange(count) / (2.0 * seconds), min(rate_hz, 50.0 * measure.band.high_hz))


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
