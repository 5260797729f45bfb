"""The sensors of the simulated bench: the true signal at each, by its kind, and what the transducer makes of it.

A transducer exposed to s outputs H(A s) + b + d t: A its sensitivity matrix, near one; H its high pass; b its offset
and d t its drift since the reset before the motion. A, b and d are drawn once a campaign, from the scatter in the rig.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from balance.arrays import Floats
from balance.dynamics.moving_base import acceleration_in_body, displacement_at, times
from balance.errors import ModelError

from ..errors import RigError
from ..rig import Column, Rig
from ..rig import sensors as kinds
from ..rig.bench import SensorErrors
from ..rig.sensor_channels import sensitivity_scatter, stated_range
from ..rig.sensors import Accelerometer, support_wrenches
from .disturbances import random_stream
from .elastic_joints import part_at
from .loggers import high_pass
from .run import BenchRun

TRIGGER_V = 5.0
"""Level of a simulated trigger [V]."""


@dataclass(frozen=True)
class Transducer:
    """One sensor with its errors."""

    channels: tuple[str, ...]
    sensitivity: Floats
    """A, (k, k) [-, between channels in SI]."""
    offset: Floats
    """b, (k,) [SI]."""
    drift: Floats
    """d, (k,) [SI/s]."""
    corner: float | None
    """Corner of the high pass [Hz]; None without one."""

    def output(self, signal: Floats, time: Floats) -> Floats:
        """Output (k, n) [SI] for a true ``signal`` (k, n) [SI] at ``time`` (n,) [s], reset at the first instant."""
        values: Floats = self.sensitivity @ signal
        if self.corner is not None:
            values = high_pass(values.T, self.corner, float(time[1] - time[0])).T
        return values + self.offset[:, None] + self.drift[:, None] * (time - time[0])

    @property
    def truth(self) -> dict[str, Any]:
        """As it stands in the truth file."""
        return {
            "channels": list(self.channels),
            "sensitivity_si": self.sensitivity.tolist(),
            "offset_si": self.offset.tolist(),
            "drift_si_per_s": self.drift.tolist(),
            "high_pass_hz": self.corner,
        }


def draw_transducers(rig: "Rig", seed: int) -> dict[str, Transducer]:
    """The sensors of a campaign for which the rig states errors or a lower corner.

    Raises RigError for errors of an unknown sensor.
    """
    if strange := [name for name in rig.bench.errors if name not in rig.sensors]:
        raise RigError(f"bench.errors: no sensor {strange[0]!r}: there are {', '.join(rig.sensors)}")
    return {
        name: _drawn(name, list(rig.sensors[name].columns(name)), errors, random_stream("sensor", seed, name))
        for name, errors in _with_corners(rig).items()
    }


def _with_corners(rig: "Rig") -> dict[str, SensorErrors]:
    """Errors by sensor; a corner in the sensor's own table applies where its errors name none."""
    found = dict(rig.bench.errors)
    for name, sensor in rig.of_kind(Accelerometer).items():
        errors = found.get(name, SensorErrors())
        if sensor.high_pass is not None and errors.high_pass is None:
            found[name] = errors.model_copy(update={"high_pass": sensor.high_pass})
    return found


def transduced_signals(
    transducers: Mapping[str, Transducer], seen: Mapping[str, Floats], time: Floats
) -> dict[str, Floats]:
    """Signals of all channels (n,) [SI] after the transducers, from the true ones (n,) [SI] at ``time`` (n,) [s]."""
    found = dict(seen)
    for sensor in transducers.values():
        values = sensor.output(np.array([seen[channel] for channel in sensor.channels]), time)
        found |= dict(zip(sensor.channels, values, strict=True))
    return found


def _drawn(name: str, columns: Sequence[Column], errors: "SensorErrors", rng: np.random.Generator) -> Transducer:
    count = len(columns)
    gain, cross, zero, drift = rng.normal(size=count), rng.normal(size=(count, count)), *rng.normal(size=(2, count))
    sensitivity = np.eye(count) + sensitivity_scatter(name, columns, errors) * np.where(
        np.eye(count), np.diag(gain), cross
    )
    ranges = np.zeros(count)
    if errors.offset or errors.drift_per_minute:
        ranges = np.array([stated_range(name, column) for column in columns])
    return Transducer(
        tuple(column.channel for column in columns),
        sensitivity,
        errors.offset * ranges * zero,
        errors.drift_per_minute / 60.0 * ranges * drift,
        errors.high_pass,
    )


_WRENCH = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def true_signals(rig: Rig, run: BenchRun) -> dict[str, Floats]:
    """True signal of every channel at the run's instants, (n,) [SI]."""
    found = support_signals(rig, run)
    for name, sensor in rig.sensors.items():
        if (law := _LAWS.get(type(sensor))) is None:
            continue
        try:
            values = law(sensor, run)
        except ModelError as error:
            raise RigError(f"sensors.{name}: {error}") from error
        found |= {column.channel: values[column.component] for column in sensor.columns(name)}
    return found


def base_acceleration(sensor: kinds.Accelerometer, run: BenchRun) -> dict[str, Floats]:
    """Acceleration of a point of the base as a sensor there senses it, by axis, (n,) [m/s2]."""
    values = times(displacement_at(np.array(sensor.position)), run.sensed_acceleration) + run.modal_acceleration.get(
        sensor.position, 0.0
    )
    return dict(zip(kinds.AXES, values.T, strict=True))


def support_signals(rig: Rig, run: BenchRun) -> dict[str, Floats]:
    """True forces (n,) [N] and moments (n,) [N m] of all supports' channels, tared at rest, with cross-talk."""
    found: dict[str, Floats] = {}
    for name, share in support_wrenches(rig.supports).items():
        load = dict(zip(_WRENCH, times(share, run.supported_wrench).T, strict=True))
        support = rig.supports[name]
        carried = [load[component] for component in support.measured]
        read = carried if support.crosstalk is None else np.array(support.crosstalk) @ np.array(carried)
        found |= {column.channel: values for column, values in zip(support.columns(name), read, strict=True)}
    return found


def _accelerometer(sensor: kinds.Accelerometer, run: BenchRun) -> dict[str, Floats]:
    if sensor.attached_to == "base":
        return base_acceleration(sensor, run)
    mounted = part_at(run.mechanism, sensor.attached_to, np.array(sensor.position))
    values = acceleration_in_body(run.mechanism, run.trajectory, run.sensed_acceleration, mounted)
    return dict(zip(kinds.AXES, values.T, strict=True))


def _torque(sensor: kinds.Torque, run: BenchRun) -> dict[str, Floats]:
    torque = run.torque
    if sensor.joint not in torque:
        raise ModelError(f"joint {sensor.joint!r} is not driven: expected {', '.join(torque) or 'one that is'}")
    return {sensor.joint: torque[sensor.joint]}


def _target(sensor: kinds.Target, run: BenchRun) -> dict[str, Floats]:
    if run.command.joints:
        raise ModelError("a target acceleration along axes, but the motion drives joints")
    driven = dict(zip(run.command.axes, run.command.acceleration.T, strict=True))
    return {axis: driven.get(axis, np.zeros_like(run.time)) for axis in sensor.channels}


def _trigger(sensor: kinds.Trigger, run: BenchRun) -> dict[str, Floats]:
    """High while the command moves."""
    moves = (run.command.velocity != 0.0) | (run.command.acceleration != 0.0)
    return {"trigger": TRIGGER_V * moves.any(axis=1)}


_LAWS: dict[type, Callable[[Any, BenchRun], dict[str, Floats]]] = {
    kinds.Accelerometer: _accelerometer,
    kinds.Encoder: lambda sensor, run: {sensor.joint: run.shown(sensor.joint)},
    kinds.Torque: _torque,
    kinds.Target: _target,
    kinds.Trigger: _trigger,
}
