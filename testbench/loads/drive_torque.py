"""Measured torques of the drives against the model of the mechanism as mounted, on the same motion.

The model's torque follows by inverse dynamics from the encoders' trajectory; both pass the same low-pass.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from balance.arrays import Floats
from balance.dynamics.inverse_dynamics import simulate

from ..errors import AnalysisError
from ..kinematics.gaps import gap_reach, longest_segment
from ..kinematics.smoothing_and_derivatives import low_pass
from ..rig import Column
from ..rig.sensors import Torque
from ..runs.aligned_run import AlignedRun
from ..signal.filters import correlation_lag

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
        return _rms(self._moving(self.measured) - self._moving(self.model)) / _rms(self._moving(self.measured))

    @property
    def scale(self) -> float:
        """Measured torque as a multiple of the model's: least squares, both less their means."""
        model, measured = self._moving(self.model), self._moving(self.measured)
        return float(model @ measured / (model @ model))

    def as_dict(self) -> dict[str, Any]:
        """As a JSON document."""
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
            "delay_s": correlation_lag(self.measured[self._even], self.model[self._even], self.rate_hz),
        }

    @property
    def _even(self) -> slice:
        """The longest segment without a gap."""
        close = np.diff(self.time) < 1.5 / self.rate_hz
        found = longest_segment(close)
        return slice(found.start, found.stop + 1)

    @staticmethod
    def _moving(values: Floats) -> Floats:
        return values - values.mean()


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
    grid, gaps, reach = aligned.grid, aligned.gaps(), gap_reach(bandwidth_hz)
    valid = gaps.valid_samples(grid, reach)
    if not valid.any():
        raise AnalysisError(f"{run.name}: {'; '.join(gaps.texts(reach))}: no valid sample remains")

    def smooth(values: Floats) -> Floats:
        return gaps.by_segment(lambda part: low_pass(part, bandwidth_hz, grid.rate), values, grid, reach)[valid]

    response = simulate(aligned.mechanism, aligned.trajectory(bandwidth_hz))
    return [
        DriveTorque(
            column.component,
            column.sensor,
            grid.time[valid],
            smooth(np.interp(grid.time, *_recorded(aligned, column))),
            smooth(response.torque[column.component]),
            grid.rate,
            bandwidth_hz,
            "N" if column.component in response.sliding else "Nm",
        )
        for column in columns
        if column.component in response.torque
    ]


def _recorded(aligned: AlignedRun, column: Column) -> tuple[Floats, Floats]:
    run = aligned.run
    if (group := run.group_of(column)) != aligned.reference:
        raise AnalysisError(
            f"{run.name}: torque {column.channel} is of {group}, the encoders of {aligned.reference}: two clocks"
        )
    return run.instants(column), run.values(column)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
