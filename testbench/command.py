"""How well a commanded acceleration is reached: target, accelerometer, and encoders differentiated."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.closure import Closure
from balance.mechanism import Mechanism
from balance.motion import Samples

from .bench.carried import acceleration_in_body
from .channels import in_si, instants
from .errors import AnalysisError
from .pairing import rig_of
from .rig.sensors import Accelerometer, Encoder, Target
from .signals import Band, derivatives, lag

if TYPE_CHECKING:
    from .rig import Rig
    from .store import Run

BANDWIDTH_HZ = 80.0
"""Of the accelerations [Hz]: twice what the moves need, and little of the encoders' steps."""


@dataclass(frozen=True)
class CommandPerformance:
    """Acceleration of a body by axis, (n,) [m/s2], on the controller's clock; what was measured is band-limited."""

    time: Floats
    """(n,) [s]"""
    target: dict[str, Floats]
    accelerometer: dict[str, Floats]
    encoders: dict[str, Floats]
    bandwidth_hz: float
    lag_s: float
    """By how much the accelerometer's logger was started earlier than the controller's, found by correlation [s]."""


def performance(run: "Run", mechanism: Mechanism, bandwidth_hz: float = BANDWIDTH_HZ) -> CommandPerformance:
    """Target, accelerometer and encoders of a run on one clock. Raises AnalysisError if the rig lacks one of them."""
    rig = rig_of(run)
    target_name, target = next(iter(rig.of_kind(Target).items()), (None, None))
    name, sensor = next(
        ((n, s) for n, s in rig.of_kind(Accelerometer).items() if s.attached_to != "base"), (None, None)
    )
    if target_name is None or target is None or name is None or sensor is None:
        raise AnalysisError(f"{run.name}: its rig lacks a target or an accelerometer on a moving body")
    columns = {column.component: column for column in target.columns(target_name)}
    wanted = {axis: in_si(run, column)[0] for axis, column in columns.items()}
    time = instants(run, next(iter(columns.values())))
    rate = in_si(run, next(iter(columns.values())))[1]
    band = Band(0.0, bandwidth_hz)
    felt = {c.component: (band.of(in_si(run, c)[0], in_si(run, c)[1]), instants(run, c)) for c in sensor.columns(name)}
    late = _lag(wanted, felt, rate)
    shown = {axis: np.interp(time - time[0] + late, t - t[0], values) for axis, (values, t) in felt.items()}
    moved = encoder_acceleration(run, rig, mechanism, sensor, bandwidth_hz)
    by_encoders = {axis: moved[:, "xyz".index(axis)] for axis in wanted}
    return CommandPerformance(time, wanted, shown, by_encoders, bandwidth_hz, late)


def encoder_acceleration(
    run: "Run", rig: "Rig", mechanism: Mechanism, sensor: Accelerometer, bandwidth_hz: float
) -> Floats:
    """Acceleration of the point where ``sensor`` sits, by encoders and loops alone, body axes, (n, 3) [m/s2]."""
    columns = [column for name, encoder in rig.of_kind(Encoder).items() for column in encoder.columns(name)]
    if not columns:
        raise AnalysisError(f"{run.name}: its rig has no encoder")
    signals = [in_si(run, column) for column in columns]
    position, velocity, acceleration = (
        np.column_stack(values)
        for values in zip(*(derivatives(signal, rate, bandwidth_hz) for signal, rate in signals), strict=True)
    )
    time = instants(run, columns[0])
    samples = Samples(time, position, velocity, acceleration, tuple(column.component for column in columns))
    trajectory = Closure(mechanism).follow(samples)
    still = np.zeros((len(time), 6))
    return acceleration_in_body(mechanism, trajectory, still, sensor.attached_to, np.array(sensor.position))


def _lag(wanted: dict[str, Floats], felt: dict[str, tuple[Floats, Floats]], rate_hz: float) -> float:
    """Lag of the accelerometer's record behind the target's, along the axis that moves most [s]."""
    shared = [axis for axis in wanted if axis in felt]
    if not shared:
        raise AnalysisError("target and accelerometer share no axis")
    axis = max(shared, key=lambda a: float(np.ptp(wanted[a])))
    values, time = felt[axis]
    regular = np.arange(0.0, float(time[-1] - time[0]), 1.0 / rate_hz)
    return lag(np.interp(regular, time - time[0], values), wanted[axis], rate_hz)
