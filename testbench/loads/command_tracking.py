"""How well a commanded acceleration is reached: target against accelerometer and differentiated encoders."""

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.dynamics.moving_base import acceleration_in_body
from balance.results import Key

from ..errors import AnalysisError
from ..kinematics.encoder_motion import moving_interval
from ..kinematics.gaps import gap_reach, longest_segment
from ..kinematics.smoothing_and_derivatives import grid_of, noise_gain
from ..rig import Column
from ..rig.sensors import Accelerometer, Encoder, Target
from ..runs.aligned_run import AlignedRun
from ..runs.si_run import SIRun
from ..signal.filters import Band, correlation_lag

NEAR_S = 0.02
"""Largest bias of a correlation's lag by a gap [s]."""
BANDWIDTH_HZ = 80.0
"""Of the accelerations [Hz]: twice that of the motions, and below most of the encoders' quantization noise."""
DEFINITIONS = {
    "peak": "largest absolute value over the record",
    "rms": "root mean square from the first to the last movement that is commanded along the axis",
    "error_rms": "of what is shown less the target, over the same span, no delay taken off",
    "delay_s": "by which what is shown follows the target, by correlation",
    "accelerometer_shifted_s": "by which the accelerometer's record is shifted to correlate best with the target",
    "encoder_noise": "standard deviation that the encoders' steps alone give an acceleration of their joint [rad/s2]",
    "left_out_s": "of the controller's clock, where gaps of its record touch it: in no other number",
    "bandwidth_hz": "of the zero-phase low-pass of what is measured; the target is not filtered",
}
"""What each number is."""


@dataclass(frozen=True)
class CommandPerformance:
    """Acceleration of a body by axis, (n,) [m/s2], on the controller's clock; measured ones are band-limited."""

    time: Floats
    """(n,) [s]"""
    target: dict[str, Floats]
    accelerometer: dict[str, Floats]
    encoders: dict[str, Floats]
    bandwidth_hz: float
    lag_s: float
    """Start of the controller's logger less that of the accelerometer's, by correlation [s]."""
    valid: NDArray[np.bool_]
    """Instants that no gap touches, (n,); others are in no number."""
    group: str = ""
    """The group of the accelerometer."""
    first: float = 0.0
    """Its first instant on its own clock [s]."""
    encoder_noise: dict[str, float] = field(default_factory=dict)
    """Standard deviation of a joint's acceleration by the encoder's quantization alone, by joint [rad/s2, m/s2]."""

    @property
    def left_out_s(self) -> float:
        """Duration of what gaps touch [s]."""
        return float(np.mean(~self.valid) * (self.time[-1] - self.time[0]))

    def reached(self) -> list["ReachedValue"]:
        """How well the command was reached, by axis and by source."""
        rate = (len(self.time) - 1) / float(self.time[-1] - self.time[0])
        shown = {"encoders": self.encoders, "accelerometer": self.accelerometer}
        return [
            ReachedValue.of(axis, by, self.target[axis], values[axis], rate, self.valid)
            for axis in self.target
            for by, values in shown.items()
            if axis in values
        ]


@dataclass(frozen=True)
class ReachedValue:
    """Commanded acceleration of one axis and the same by one source [m/s2]."""

    axis: Annotated[str, Key("", "axis")]
    by: Annotated[str, Key("", "by")]
    """``encoders`` or ``accelerometer``."""
    target_peak: Annotated[float, Key("target_peak_m_s2", "target peak", ".4g")]
    """Largest absolute value."""
    peak: Annotated[float, Key("peak_m_s2", "peak", ".4g")]
    target_rms: Annotated[float, Key("target_rms_m_s2", "target RMS", ".4g")]
    """Over the span in which this axis is commanded to move; zero where it never is."""
    error_rms: Annotated[float, Key("error_rms_m_s2", "RMS error", ".4g")]
    """Of the source less the target, over the same span."""
    delay_s: Annotated[float | None, Key("", "delay [ms]", lambda delay: f"{1e3 * delay:z.2f}")]
    """By which the source follows the target, by correlation. None for the accelerometer, whose clock is set by that
    correlation, and where nothing is commanded."""

    @classmethod
    def of(
        cls, axis: str, by: str, target: Floats, shown: Floats, rate_hz: float, valid: NDArray[np.bool_]
    ) -> "ReachedValue":
        """Compare signals (n,) [m/s2] of one clock at ``valid`` samples (n,) [-]; without a command, over all."""
        moved, even = bool(np.ptp(target) > 0.0), longest_segment(valid)
        span = np.zeros(len(target), dtype=bool)
        span[moving_interval(target, rate_hz) if moved else slice(None)] = True
        span &= valid
        error = shown[span] - target[span]
        timed = by == "encoders" and bool(np.ptp(target[even]) > 0.0)
        return cls(
            axis,
            by,
            float(np.abs(target[valid]).max()),
            float(np.abs(shown[valid]).max()),
            float(np.sqrt(np.mean(target[span] ** 2))),
            float(np.sqrt(np.mean(error**2))),
            correlation_lag(shown[even], target[even], rate_hz) if timed else None,
        )


def command_performance(aligned: AlignedRun, bandwidth_hz: float = BANDWIDTH_HZ) -> CommandPerformance:
    """Target, accelerometer and encoders of a run on one clock; what gaps of that clock touch is masked.

    Raises AnalysisError if the rig lacks one of the three, or encoders and target are on two loggers.
    """
    run = aligned.run
    columns = _columns(run, Target)
    commanded = {column.component: run.values(column) for column in columns}
    time, rate = run.instants(columns[0]), run.rate(columns[0])
    name, sensor = _moving_accelerometer(run)
    sensor_columns, band = list(sensor.columns(name)), Band(0.0, bandwidth_hz)
    measured = {c.component: (band.filtered(*run.signal(c)), run.even_instants(c)) for c in sensor_columns}
    encoders = _columns(run, Encoder)
    if run.group_of(columns[0]) != aligned.reference:
        raise AnalysisError(
            f"{run.name}: encoders and target are on two loggers, whose clocks are not aligned: record both on one"
        )
    target, valid = dict(commanded), np.ones(len(time), dtype=bool)
    if gaps := aligned.gaps():
        even = grid_of(time, f"{run.name}: target", bridged=True)
        target = {axis: np.interp(even.time, time, values) for axis, values in target.items()}
        time, valid = even.time, gaps.valid_samples(even, gap_reach(bandwidth_hz))
        if not valid.any():
            raise AnalysisError(f"{run.name}: {'; '.join(gaps.descriptions)}: no valid sample remains")
    lag_s = _lag(target, measured, rate, valid)
    grid, moved = encoder_acceleration(aligned, sensor, bandwidth_hz)
    gain = noise_gain(bandwidth_hz, (len(grid) - 1) / float(grid[-1] - grid[0]))
    return CommandPerformance(
        time,
        target,
        {axis: np.interp(time - time[0] + lag_s, t - t[0], values) for axis, (values, t) in measured.items()},
        {axis: np.interp(time, grid, moved[:, "xyz".index(axis)]) for axis in target},
        bandwidth_hz,
        lag_s,
        valid,
        run.group_of(sensor_columns[0]),
        float(run.instants(sensor_columns[0])[0]),
        {c.component: c.resolution / np.sqrt(12.0) * gain for c in encoders},
    )


def encoder_acceleration(run: AlignedRun, sensor: Accelerometer, bandwidth_hz: float) -> tuple[Floats, Floats]:
    """Instants (n,) [s], and the acceleration of the point where ``sensor`` is mounted, body axes, (n, 3) [m/s2].

    From the encoders, differentiated below ``bandwidth_hz``, through the loops of the mechanism; not valid in gaps.
    """
    trajectory = run.trajectory(bandwidth_hz)
    still, mounted = np.zeros((run.grid.count, 6)), run.unloaded.anchor(sensor.attached_to, np.array(sensor.position))
    return run.grid.time, acceleration_in_body(run.unloaded, trajectory, still, mounted)


def _columns(run: SIRun, kind: type[Target] | type[Encoder]) -> list[Column]:
    """The channels of all sensors of a kind, of which there must be one."""
    found = run.rig.columns_of(kind)
    if not found:
        raise AnalysisError(f"{run.name}: its rig has no sensor of kind {kind.__name__.lower()}")
    return found


def _moving_accelerometer(run: SIRun) -> tuple[str, Accelerometer]:
    for name, sensor in run.rig.of_kind(Accelerometer).items():
        if sensor.attached_to != "base":
            return name, sensor
    raise AnalysisError(f"{run.name}: its rig has no accelerometer on a body that moves")


def _lag(
    commanded: dict[str, Floats], measured: dict[str, tuple[Floats, Floats]], rate_hz: float, valid: NDArray[np.bool_]
) -> float:
    """Lag of the accelerometer's record behind the target's, along the axis that moves most [s]."""
    shared = [axis for axis in commanded if axis in measured]
    if not shared:
        raise AnalysisError("target and accelerometer share no axis")
    axis = max(shared, key=lambda a: float(np.ptp(commanded[a])))
    values, time = measured[axis]
    regular = np.arange(0.0, float(time[-1] - time[0]), 1.0 / rate_hz)
    lag_s = correlation_lag(np.interp(regular, time - time[0], values), commanded[axis] * valid, rate_hz)
    return lag_s if valid.all() else _refined_lag(lag_s, time - time[0], values, commanded[axis], rate_hz, valid)


def _refined_lag(
    lag_s: float, time: Floats, measured: Floats, commanded: Floats, rate_hz: float, valid: NDArray[np.bool_]
) -> float:
    """The lag within NEAR_S of a first one at which the readings differ least from the target outside gaps [s].

    A correlation over a gap is biased by it.
    """
    shifts = lag_s + np.arange(-NEAR_S, NEAR_S, 0.1 / rate_hz)
    own = np.flatnonzero(valid) / rate_hz
    residuals = [float(np.sum((np.interp(own + shift, time, measured) - commanded[valid]) ** 2)) for shift in shifts]
    return float(shifts[int(np.argmin(residuals))])
