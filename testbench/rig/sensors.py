"""The kinds of sensors, and the channels that each writes.

Supports of a rig: the force sensors that carry the mechanism.

Mechanism and base are rigid between the supports, each support is a spring along the axes that its sensor measures and
free along the others. A relative displacement d then loads support i at p_i with f_i = k_i J_i d, and the wrench on the
base is w = sum J_i' f_i, so f_i = k_i J_i (sum J_i' k_i J_i)^-1 w: of all distributions that add up to w, the one of
least elastic energy.
"""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, get_args

import numpy as np
from pydantic import BeforeValidator, Field

from balance.arrays import Floats
from balance.dynamics.moving_base import skew
from balance.errors import DataError
from balance.input_files import Table

from ..errors import RigError
from . import key_types
from .sensor_channels import LoggedSensor

Axis = Literal["x", "y", "z"]
WrenchAxis = Literal["Fx", "Fy", "Fz", "Mx", "My", "Mz"]
AXES: tuple[Axis, ...] = ("x", "y", "z")
STIFFNESS = 1e8
"""Of a support along each axis that its sensor measures, where the rig states none [N/m]: that of a load cell."""
TURNING_STIFFNESS = 1e6
"""Of a support with a six-axis sensor about each axis, where the rig states none [N m/rad]."""


class Accelerometer(LoggedSensor):
    """Acceleration of a point of a body, along axes of that body. Its level at rest does not count; what tilt shows of
    the weight does: readings that a sensor or a program freed of weight are not those of an accelerometer.
    """

    dimensions: ClassVar = ("acceleration",)
    kind: Literal["accelerometer"]
    """Kind of sensor."""
    channels: dict[Axis, str] = Field(min_length=1)
    """Channel of each measured axis."""
    unit: key_types.AccelerationUnit | None = None
    """Unit in which the log is written."""
    range: key_types.Accelerations | None = None
    """Measuring range of each axis [m/s2]."""
    noise: key_types.Accelerations | None = None
    """Standard deviation of its noise, each axis [m/s2]."""
    resolution: key_types.Accelerations | None = None
    """Least step of its readings, each axis [m/s2]."""
    position: key_types.Point
    """Its place in the frame of that body [m]."""
    attached_to: str = "base"
    """Body that it is mounted on, or ``base``."""
    high_pass: key_types.Frequency | None = None
    """Lower corner of an AC-coupled sensor, first order, by its data sheet [Hz]; left out: it responds down to zero."""

    @property
    def components(self) -> Mapping[str, str]:
        """Channel of each measured axis."""
        return dict(self.channels.items())


class _ForceAndMoment(Table):
    """One value for the forces, and one for the moments."""

    F: key_types.Forces | None = None
    """Of forces, the same or one each along x, y, z [N]."""
    M: key_types.Moments | None = None
    """Of moments, the same or one each about x, y, z [N m]."""


class _Support(LoggedSensor):
    """A support of the mechanism on the base that measures components of the wrench it carries."""

    unloaded: tuple[WrenchAxis, ...] | Literal["rest"] = ()
    """Components that the support does not carry; ``rest``: all that it does not measure."""
    crosstalk: tuple[tuple[float, ...], ...] | None = None
    """Readings = crosstalk @ loads, in SI, rows and columns in the order of the channels; left out: no cross-talk."""

    @property
    def measured(self) -> tuple[str, ...]:
        """The measured components, ``Fx`` ... ``Mz``, in the order of the channels."""
        return tuple(self.components)

    def carries(self, component: str) -> bool:
        """Whether the support may carry a component, as far as the rig says."""
        if self.unloaded == "rest":
            return component in self.components
        return component not in self.unloaded

    def _check(self) -> None:
        """Nothing both measured and unloaded; a cross-talk matrix that fits the channels and can be inverted."""
        super()._check()
        if self.unloaded != "rest" and (both := [c for c in self.unloaded if c in self.components]):
            raise DataError(f"unloaded names {both[0]}, which the sensor measures")
        if self.crosstalk is None:
            return
        size = len(self.components)
        if len(self.crosstalk) != size or any(len(row) != size for row in self.crosstalk):
            raise DataError(f"crosstalk: expected {size} rows of {size} numbers, for {', '.join(self.components)}")
        if not 1.0 / np.linalg.cond(np.array(self.crosstalk)) > 1e-6:
            raise DataError("crosstalk: cannot be inverted")


class _WrenchUnits(Table):
    """Units of the forces and of the moments."""

    F: key_types.ForceUnit = "N"
    """Unit of the forces."""
    M: key_types.MomentUnit = "N m"
    """Unit of the moments."""


def _both(unit: object) -> object:
    """One unit for forces and moments, as a logger writes volts."""
    return {"F": unit, "M": unit} if isinstance(unit, str) else unit


class Wrench(_Support):
    """Force and moment about the sensor's position, that the mechanism exerts on the base through this support."""

    kind: Literal["wrench"]
    """Kind of sensor."""
    channels: dict[WrenchAxis, str] = Field(min_length=1)
    """Channel of each measured component."""
    unit: Annotated[_WrenchUnits, BeforeValidator(_both, json_schema_input_type=_WrenchUnits | str)] = _WrenchUnits()
    """Units in which the log is written."""
    range: _ForceAndMoment = _ForceAndMoment()
    """Measuring ranges [N, N m]."""
    noise: _ForceAndMoment = _ForceAndMoment()
    """Standard deviations of the noise [N, N m]."""
    resolution: _ForceAndMoment = _ForceAndMoment()
    """Least steps of the readings [N, N m]."""
    position: key_types.Point
    """Its origin in the base frame [m]."""
    between: tuple[str, str] = ("mechanism", "base")
    """What it is between: the wrench is that of the first on the second. Analyses take what is between these two alone
    for what the mechanism shakes with."""
    stiffness: key_types.Stiffness = STIFFNESS
    """Stiffness of the support along each measured axis [N/m]."""
    turning_stiffness: key_types.TurningStiffness = TURNING_STIFFNESS
    """Stiffness of the support about each measured axis [N m/rad]."""

    @property
    def components(self) -> Mapping[str, str]:
        """Channel of each measured component."""
        return dict(self.channels.items())

    def _dimensions(self, component: str) -> tuple[str, ...]:
        return ("force",) if component[0] == "F" else ("moment",)

    def _unit_of_log(self, component: str) -> tuple[str, bool]:
        letter = component[0]
        unit, stated = self._unit_unless_raw(getattr(self.unit, letter))
        return unit, stated and letter in self.unit.model_fields_set

    @property
    def axis_stiffness(self) -> tuple[float, ...]:
        """Stiffness of the support along and about x, y, z [N/m, N m/rad]; zero where the sensor measures nothing."""
        along = (self.stiffness if f"F{axis}" in self.channels else 0.0 for axis in AXES)
        about = (self.turning_stiffness if f"M{axis}" in self.channels else 0.0 for axis in AXES)
        return (*along, *about)


class ForceSensor(_Support):
    """Force along one or three axes, that the mechanism exerts on the base through this support."""

    dimensions: ClassVar = ("force",)
    kind: Literal["force"]
    """Kind of sensor."""
    channel: str | None = None
    """Its one channel."""
    axis: Axis | None = None
    """Its one axis."""
    channels: dict[Axis, str] | None = None
    """Channel of each measured axis, in place of channel and axis."""
    unit: key_types.ForceUnit = "N"
    """Unit in which the log is written."""
    range: key_types.Forces | None = None
    """Measuring range of each axis [N]."""
    noise: key_types.Forces | None = None
    """Standard deviation of its noise, each axis [N]."""
    resolution: key_types.Forces | None = None
    """Least step of its readings, each axis [N]."""
    position: key_types.Point
    """Its place in the base frame [m]."""
    between: tuple[str, str] = ("mechanism", "base")
    """What it is between: the force is that of the first on the second. Analyses take what is between these two alone
    for what the mechanism shakes with."""
    stiffness: key_types.Stiffness = STIFFNESS
    """Stiffness of the support along each measured axis [N/m]."""

    def _check(self) -> None:
        if bool(self.channels) == (self.channel is not None and self.axis is not None):
            raise DataError("expected either channel and axis, or channels = { x = ..., y = ..., z = ... }")
        super()._check()

    @property
    def components(self) -> Mapping[str, str]:
        """Channel of each measured axis, ``Fx`` ... ``Fz``."""
        by_axis = self.channels or {self.axis or "z": self.channel or ""}
        return {f"F{axis}": channel for axis, channel in by_axis.items()}

    @property
    def axis_stiffness(self) -> tuple[float, ...]:
        """Stiffness of the support along and about x, y, z [N/m, N m/rad]; zero where the sensor measures nothing."""
        return (*(self.stiffness if f"F{axis}" in self.components else 0.0 for axis in AXES), 0.0, 0.0, 0.0)


class Encoder(LoggedSensor):
    """Position of a joint."""

    dimensions: ClassVar = ("angle", "length")
    kind: Literal["encoder"]
    """Kind of sensor."""
    channel: str
    """Its channel."""
    joint: str
    """Joint that it measures."""
    unit: key_types.JointUnit = "rad"
    """Unit in which the log is written."""
    noise: key_types.JointStep | None = None
    """Standard deviation of its noise [rad or m]."""
    resolution: key_types.JointStep | None = None
    """Least step of its readings [rad or m]."""

    @property
    def components(self) -> Mapping[str, str]:
        """Its one channel, by its joint."""
        return {self.joint: self.channel}


class Torque(LoggedSensor):
    """Torque of a drive on its joint, as the drive reports it."""

    dimensions: ClassVar = ("moment", "force")
    kind: Literal["torque"]
    """Kind of sensor."""
    channel: str
    """Its channel."""
    joint: str
    """Joint that the drive acts on."""
    unit: key_types.DriveUnit = "N m"
    """Unit in which the log is written."""
    range: key_types.DriveLoad | None = None
    """Measuring range [N m or N]."""
    noise: key_types.DriveLoad | None = None
    """Standard deviation of its noise [N m or N]."""
    resolution: key_types.DriveLoad | None = None
    """Least step of its readings [N m or N]."""

    @property
    def components(self) -> Mapping[str, str]:
        """Its one channel, by its joint."""
        return {self.joint: self.channel}


class Target(LoggedSensor):
    """Commanded acceleration of what is driven, base axes, as the controller writes it."""

    dimensions: ClassVar = ("acceleration",)
    commanded: ClassVar = True
    kind: Literal["target"]
    """Kind of sensor."""
    channels: dict[Axis, str] = Field(min_length=1)
    """Channel of each axis."""
    unit: key_types.AccelerationUnit = "m/s^2"
    """Unit in which the log is written."""

    @property
    def components(self) -> Mapping[str, str]:
        """Channel of each axis."""
        return dict(self.channels.items())


class Trigger(LoggedSensor):
    """A line that several loggers record, each by a trigger sensor of its own: its rising edges align their clocks."""

    dimensions: ClassVar = ("voltage",)
    level: ClassVar = False
    kind: Literal["trigger"]
    """Kind of sensor."""
    channel: str
    """Its channel."""
    line: str = "trigger"
    """Which line it is, where a logger records several: those of one line are compared."""
    unit: str = "V"
    """Unit in which the log is written; of no effect, since edges alone count."""

    @property
    def components(self) -> Mapping[str, str]:
        """Its one channel."""
        return {"trigger": self.channel}

    def _unit_of_log(self, component: str) -> tuple[str, bool]:
        return self.unit, False


Support = Wrench | ForceSensor
Sensor = Annotated[
    Accelerometer | Wrench | ForceSensor | Encoder | Torque | Target | Trigger, Field(discriminator="kind")
]


def wrench_transport(point: Floats) -> Floats:
    """Matrix from the wrench (F, M) about ``point`` (3,) [m] to that about the origin, (6, 6): M_0 = M + point x F."""
    return np.block([[np.eye(3), np.zeros((3, 3))], [skew(point), np.eye(3)]])


_CARRIED = 1e-12
"""Share of the largest flexibility, in units of each component, below which supports carry nothing of a wrench."""


def support_wrenches(supports: Mapping[str, Support]) -> dict[str, Floats]:
    """For each support, the matrix from the wrench about the origin to its own about its position, (6, 6) [SI].

    Where the rig says of every support that it does not carry what it does not measure (``unloaded``), components that
    none of them can carry go elsewhere, as weight and tilt of a planar mechanism through its bearings on the table.
    Raises RigError if the supports cannot carry every wrench else, or leave open what goes elsewhere.
    """
    if not supports:
        return {}
    stiffness = {name: np.diag(support.axis_stiffness) for name, support in supports.items()}
    to_origin = {name: wrench_transport(np.array(support.position)) for name, support in supports.items()}
    total = sum((to_origin[n] @ stiffness[n] @ to_origin[n].T for n in supports), np.zeros((6, 6)))
    scale = np.sqrt(np.where(np.diag(total) > 0.0, np.diag(total), 1.0))
    scaled = total / np.outer(scale, scale)
    unstated = [
        name
        for name, support in supports.items()
        if any(c not in support.components and support.carries(c) for c in get_args(WrenchAxis))
    ]
    if not unstated:
        outside = np.eye(6) - scaled @ np.linalg.pinv(scaled, rcond=_CARRIED, hermitian=True)
        own = np.sum([np.diag(one) for one in stiffness.values()], axis=0) > 0.0
        elsewhere = ~own & (np.linalg.norm(outside, axis=0) > np.sqrt(_CARRIED))
        if round(np.trace(outside)) == np.count_nonzero(elsewhere):
            scaled = scaled + np.diag(elsewhere.astype(float))
    if np.linalg.cond(scaled) > 1.0 / _CARRIED:
        raise RigError(
            f"sensors: the supports {', '.join(supports)} cannot carry every force and moment between mechanism and "
            "base: add the supports that are missing, or remove the force sensors"
            + (f'; or say that {", ".join(unstated)} carry nothing else (unloaded = "rest")' if unstated else "")
        )
    flexibility = np.linalg.inv(scaled) / np.outer(scale, scale)
    return {name: stiffness[name] @ to_origin[name].T @ flexibility for name in supports}
