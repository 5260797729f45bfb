"""What sensors make of what they are exposed to: true and unknown sensitivities, cross-talk, offset, drift, coupling.

A sensor that sees s shows H(A s) + b + d t: A its sensitivity matrix, near one; H its high pass; b its offset and d t
its drift from the reset before the motion. A, b and d are drawn once a campaign, from the scatter that the rig states.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from balance.arrays import Floats

from ..errors import RigError
from ..rig.effects import SensorErrors
from ..rig.scatter import range_of, scatter
from ..rig.sensors import Accelerometer
from .filters import high_pass
from .streams import stream

if TYPE_CHECKING:
    from ..rig import Column, Rig


@dataclass(frozen=True)
class Transducer:
    """One sensor as it is."""

    channels: tuple[str, ...]
    sensitivity: Floats
    """A, in SI, (k, k)."""
    offset: Floats
    """b, (k,) [SI]."""
    drift: Floats
    """d, (k,) [SI/s]."""
    corner: float | None
    """Of the high pass [Hz]."""

    def shown(self, seen: Floats, time: Floats) -> Floats:
        """What it shows, (k, n) [SI], of ``seen`` (k, n) at ``time`` (n,) [s], reset at the first instant."""
        values: Floats = self.sensitivity @ seen
        if self.corner is not None:
            values = high_pass(values.T, self.corner, float(time[1] - time[0])).T
        return values + self.offset[:, None] + self.drift[:, None] * (time - time[0])

    @property
    def truth(self) -> dict[str, Any]:
        """As the truth file has it."""
        return {
            "channels": list(self.channels),
            "sensitivity_si": self.sensitivity.tolist(),
            "offset_si": self.offset.tolist(),
            "drift_si_per_s": self.drift.tolist(),
            "high_pass_hz": self.corner,
        }


def draw(rig: "Rig", seed: int) -> dict[str, Transducer]:
    """The sensors of a campaign for which the rig states errors or a lower corner.

    Raises RigError for errors of a sensor that it does not have.
    """
    if strange := [name for name in rig.bench.errors if name not in rig.sensors]:
        raise RigError(f"bench.errors: no sensor {strange[0]!r}: there are {', '.join(rig.sensors)}")
    return {
        name: _drawn(name, list(rig.sensors[name].columns(name)), errors, stream("sensor", seed, name))
        for name, errors in _with_corners(rig).items()
    }


def _with_corners(rig: "Rig") -> dict[str, SensorErrors]:
    """Errors by sensor; the corner that a sensor's data sheet states holds where its errors name none."""
    found = dict(rig.bench.errors)
    for name, sensor in rig.of_kind(Accelerometer).items():
        errors = found.get(name, SensorErrors())
        if sensor.high_pass is not None and errors.high_pass is None:
            found[name] = errors.model_copy(update={"high_pass": sensor.high_pass})
    return found


def shown(transducers: Mapping[str, Transducer], seen: Mapping[str, Floats], time: Floats) -> dict[str, Floats]:
    """The signals of all channels, (n,) [SI], from what their sensors are exposed to."""
    found = dict(seen)
    for sensor in transducers.values():
        values = sensor.shown(np.array([seen[channel] for channel in sensor.channels]), time)
        found |= dict(zip(sensor.channels, values, strict=True))
    return found


def _drawn(name: str, columns: "Sequence[Column]", errors: "SensorErrors", rng: np.random.Generator) -> Transducer:
    count = len(columns)
    gain, cross, zero, drift = rng.normal(size=count), rng.normal(size=(count, count)), *rng.normal(size=(2, count))
    sensitivity = np.eye(count) + scatter(name, columns, errors) * np.where(np.eye(count), np.diag(gain), cross)
    ranges = np.zeros(count)
    if errors.offset or errors.drift_per_minute:
        ranges = np.array([range_of(name, column) for column in columns])
    return Transducer(
        tuple(column.channel for column in columns),
        sensitivity,
        errors.offset * ranges * zero,
        errors.drift_per_minute / 60.0 * ranges * drift,
        errors.high_pass,
    )
