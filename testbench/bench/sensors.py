"""What each sensor of a rig sees of a run, without noise: one law a kind."""

from collections.abc import Callable
from typing import Any

import numpy as np

from balance.arrays import Floats
from balance.dynamics.moving_base import acceleration_in_body, displacement_at, times
from balance.errors import ModelError

from ..errors import RigError
from ..rig import Rig
from ..rig import sensors as kinds
from ..rig.support_loads import shares
from .run import BenchRun

_WRENCH = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def signals(rig: Rig, run: BenchRun) -> dict[str, Floats]:
    """The signal of every channel, (n,) [SI], at the run's instants."""
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
    """Acceleration of a point of the base as a sensor there feels it, by axis, (n,) [m/s2]."""
    values = times(displacement_at(np.array(sensor.position)), run.felt) + run.elastic.get(sensor.position, 0.0)
    return dict(zip(kinds.AXES, values.T, strict=True))


def support_signals(rig: Rig, run: BenchRun) -> dict[str, Floats]:
    """Forces [N] and moments [N m] of all supports' channels, tared at rest, with the cross-talk of the rig."""
    found: dict[str, Floats] = {}
    for name, share in shares(rig.supports).items():
        load = dict(zip(_WRENCH, times(share, run.transmitted).T, strict=True))
        support = rig.supports[name]
        carried = [load[component] for component in support.measured]
        read = carried if support.crosstalk is None else np.array(support.crosstalk) @ np.array(carried)
        found |= {column.channel: values for column, values in zip(support.columns(name), read, strict=True)}
    return found


def _accelerometer(sensor: kinds.Accelerometer, run: BenchRun) -> dict[str, Floats]:
    if sensor.attached_to == "base":
        return base_acceleration(sensor, run)
    values = acceleration_in_body(
        run.mechanism, run.trajectory, run.felt, sensor.attached_to, np.array(sensor.position)
    )
    return dict(zip(kinds.AXES, values.T, strict=True))


def _encoder(sensor: kinds.Encoder, run: BenchRun) -> dict[str, Floats]:
    return {sensor.joint: run.trajectory.q[:, run.mechanism.coordinate_index(sensor.joint)]}


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


_LAWS: dict[type, Callable[[Any, BenchRun], dict[str, Floats]]] = {
    kinds.Accelerometer: _accelerometer,
    kinds.Encoder: _encoder,
    kinds.Torque: _torque,
    kinds.Target: _target,
}
