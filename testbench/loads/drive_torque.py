"""Measured torques of the drives against the model of the mechanism as mounted, on the same motion.

The model's torque follows by inverse dynamics from the encoders' trajectory; both pass the same low-pass.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from balance.arrays import Floats
from balance.dynamics.inverse_dynamics import simulate

from ..errors import AnalysisError
from ..kinematics.gaps import longest_segment
from ..rig.sensors import Torque
from ..runs.aligned_run import AlignedRun
from ..signal.filters import correlation_lag, without_mean

BANDWIDTH_HZ = 80.0
"""Bandwidth of both [Hz]: twice that of the motions, and below most of the encoders' quantization noise."""


@dataclass(frozen=True)
class DriveTorque:
    """Measured and modelled torque of one drive in the same band [N m, or N of a joint that slides].

    Samples near gaps are not in it.
    """

    joint: str
    sensor: str
    time: Floats
    """On the encoders' clock, (n,) [s]."""
    measured: Floats
    model: Floats
    rate_hz: float
    bandwidth_hz: float
    unit: str = "Nm"
    """``Nm``, or ``N`` of a joint that slides."""

    @property
    def residual_share(self) -> float:
        """Root mean square of measured less model, both less their means, as a share of the measured one's."""
        return float(np.std(self.measured - self.model) / np.std(self.measured))

    @property
    def scale(self) -> float:
        """Measured torque as a multiple of the model's: least squares, both less their means."""
        model, measured = without_mean(self.model), without_mean(self.measured)
        return float(model @ measured / (model @ model))

    def as_dict(self) -> dict[str, Any]:
        """As a JSON document."""
        even = longest_segment(np.diff(self.time) < 1.5 / self.rate_hz)
        even = slice(even.start, even.stop + 1)  # instants without a gap
        return {
            "joint": self.joint,
            "sensor": self.sensor,
            "bandwidth_hz": self.bandwidth_hz,
            f"measured_rms_{self.unit}": _rms(self.measured),
            f"model_rms_{self.unit}": _rms(self.model),
            "rms_ratio": _rms(self.measured) / _rms(self.model),
            f"measured_peak_{self.unit}": float(np.abs(self.measured).max()),
            f"model_peak_{self.unit}": float(np.abs(self.model).max()),
            f"mean_difference_{self.unit}": float(np.mean(self.measured - self.model)),
            "residual_share": self.residual_share,
            "scale": self.scale,
            "left_out_s": float(self.time[-1] - self.time[0]) - (len(self.time) - 1) / self.rate_hz,
            "delay_s": correlation_lag(self.measured[even], self.model[even], self.rate_hz),
        }


DEFINITIONS = {
    "rms": "root mean square over the record, gravity included",
    "peak": "largest absolute value over the record, gravity included",
    "mean_difference": "mean of measured less model: an offset of the sensor, static friction, or gravity",
    "residual_share": "RMS of measured less model over RMS of measured, means removed",
    "scale": "least-squares factor of the model, means removed",
    "left_out_s": "what gaps of the encoders' record touch: in no other number",
    "delay_s": "by which the measured torque follows the model, by correlation",
}
"""What each number of a drive is."""


def drive_torques(aligned: AlignedRun, bandwidth_hz: float = BANDWIDTH_HZ) -> list[DriveTorque]:
    """Each drive of a run against the model as mounted.

    Raises AnalysisError where the rig has no torque, it is on another clock than the encoders, or gaps leave nothing.
    """
    run = aligned.run
    columns = run.rig.columns_of(Torque)
    if not columns:
        raise AnalysisError(f"{run.name}: its rig has no sensor of kind torque: describe one to compare the drives")
    grid, valid = aligned.grid, aligned.valid_samples(bandwidth_hz)
    kept = valid.kept > 0.0
    if not kept.any():
        raise AnalysisError(f"{run.name}: {valid.texts}: no valid sample remains")
    response = simulate(aligned.mechanism, aligned.trajectory(bandwidth_hz))
    found = []
    for column in (column for column in columns if column.component in response.torque):
        if (group := run.group_of(column)) != aligned.reference:
            raise AnalysisError(
                f"{run.name}: torque {column.channel} is of {group}, the encoders of {aligned.reference}: two clocks"
            )
        both = np.interp(grid.time, run.instants(column), run.values(column)), response.torque[column.component]
        measured, model = valid.low_pass(np.column_stack(both), bandwidth_hz)[kept].T
        unit = "N" if column.component in response.sliding else "Nm"
        time = grid.time[kept]
        found.append(DriveTorque(column.component, column.sensor, time, measured, model, grid.rate, bandwidth_hz, unit))
    return found


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
