"""What all sensors have in common: their logger, calibration and channels, each with its unit and component.

For a simulated or estimated sensor, the rig also states how far its sensitivity matrix may be from the identity.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Self

import numpy as np
from pydantic import PrivateAttr, model_validator

from balance.arrays import Floats
from balance.errors import UnitError
from balance.input_files import Table
from balance.results import Key
from balance.units import SI_UNITS, factor_to_si

from ..calibration import evaluation
from ..calibration.definition import Calibration, Teds
from ..errors import RigError
from .bench import SensorErrors


@dataclass(frozen=True)
class Column:
    """A channel: which component of which sensor, in which unit the logger writes it. Everything else in SI."""

    channel: Annotated[str, Key()]
    """Its name as in the log, with the unit in brackets or without."""
    sensor: Annotated[str, Key()]
    component: Annotated[str, Key()]
    """``x``, ``Fz``, ``Mx``, or the joint."""
    logger: str
    unit: str
    """Of the log; empty where the rig states none."""
    dimensions: tuple[str, ...]
    """Quantities that it may measure, such as ("angle", "length")."""
    range: float | None = None
    """Largest absolute value that the sensor gives [SI]."""
    noise: float = 0.0
    """Standard deviation of one sample [SI]."""
    resolution: float = 0.0
    """Step between two values [SI]."""
    commanded: bool = False
    """Computed by the controller and not measured: flat tops and constant values are no fault of it."""
    level: bool = True
    """Whether its values count; of a trigger the instants of its edges alone do."""
    stated: bool = True
    """Whether the rig states the unit, rather than the usual one of the kind being taken."""
    calibration: Calibration | None = None
    """Of the sensor by the rig; a later record of the campaign takes precedence."""
    crosstalk: tuple[tuple[float, ...], ...] | None = None
    """Of the sensor: readings = crosstalk @ loads, in SI."""
    delay: float = 0.0
    """Delay of its logger's filter at low frequencies [s]; zero where the rig states no filter."""
    siblings: "tuple[Column, ...]" = ()
    """All channels of the sensor in the order of the rig, this one among them."""

    @property
    def total_noise(self) -> float:
        """Standard deviation of one sample [SI], a resolution of q counted as noise of q^2 / 12."""
        return float(np.hypot(self.noise, self.resolution / np.sqrt(12.0)))

    @property
    def index(self) -> int:
        """Which of the sensor's channels it is."""
        return [s.channel for s in self.siblings].index(self.channel)

    @property
    def assumed_unit(self) -> str:
        """Unit in which its logger is taken to write: that of the rig, else that of SI, as the log would state it."""
        return self.unit if self.unit or self.calibration is not None else SI_UNITS[self.dimensions[0]]

    def written(self, values: Floats) -> Floats:
        """Values (n,) [SI] in the unit of the log, (n,). Raises UnitError where the calibration cannot be inverted."""
        if self.calibration is None:
            return values / factor_to_si(self.assumed_unit, *self.dimensions)
        from ..calibration.evaluation import bind_law

        units = [s.unit or self.calibration.unit or "" for s in self.siblings]
        if not all(units):
            raise UnitError(
                f"sensors.{self.sensor}: no unit in which its logger writes: state sensors.{self.sensor}.unit"
            )
        return bind_law(self.calibration, self.siblings, units).written(self.index, values)

    def written_range(self, unit: str) -> float | None:
        """Range in ``unit``, that of the log; None where it is not known, or not symmetric."""
        if self.range is None or not unit:
            return None
        try:
            column = self if self.calibration is not None else replace(self, unit=unit)
            ends = column.written(np.array([-self.range, self.range]))
        except UnitError:
            return None
        return abs(float(ends[1])) if float(ends[0]) == -float(ends[1]) else None


class LoggedSensor(Table, ABC):
    """A sensor whose channels a logger writes."""

    logger: str
    """Logger that records it."""
    model: str = ""
    """Maker and model."""
    calibration: Calibration | None = None
    """Where the logger does not write physical units, or writes them with an offset."""
    teds: Teds | None = None
    """Electronic data sheet (IEEE 1451.4)."""
    _delay: float = PrivateAttr(0.0)
    """Of its logger's filter [s], set when the rig is read."""

    @cached_property
    def _columns(self) -> dict[str, tuple[Column, ...]]:  # no private attribute: those count when rigs are compared
        return {}

    def columns(self, name: str) -> tuple[Column, ...]:
        """The channels of the sensor called ``name``, each knowing its siblings; commands pass no filter."""
        if name not in self._columns:
            cross = getattr(self, "crosstalk", None)
            columns = tuple(
                replace(c, calibration=self.calibration, crosstalk=cross, delay=0.0 if c.commanded else self._delay)
                for c in self._channels(name)
            )
            self._columns[name] = tuple(replace(column, siblings=columns) for column in columns)
        return self._columns[name]

    def set_delay(self, delay: float) -> None:
        """Set the delay of the logger's filter [s]."""
        self._delay = delay
        self._columns.clear()

    def __copy__(self) -> Self:
        copied = super().__copy__()
        copied.__dict__.pop("_columns", None)
        return copied

    @abstractmethod
    def _channels(self, name: str) -> Iterator[Column]:
        """The channels of this kind of sensor, before calibration, cross-talk and delay."""

    def _unit_of_log(self, unit: str | None) -> tuple[str, bool]:
        """The unit of the log and whether the rig states it; raw values are not in the usual unit of a kind."""
        if "unit" in self.model_fields_set:
            return unit or "", bool(unit)
        return ("", False) if self.calibration is not None and self.calibration.scales else (unit or "", False)

    @model_validator(mode="after")
    def _calibrated(self) -> Self:
        """A calibration that fits the components, and the unit where the rig states one."""
        if self.calibration is None:
            return self
        channels = list(self.columns(""))
        given = [c.unit or self.calibration.unit for c in channels]
        if wrong := [c for c in channels if c.unit and self.calibration.unit not in {None, c.unit}]:
            raise ValueError(
                f"calibration.unit: {self.calibration.unit!r}, but unit is {wrong[0].unit!r}: state it once"
            )
        if self.calibration.matrix is not None and getattr(self, "crosstalk", None) is not None:
            raise ValueError("crosstalk: the calibration has a matrix: expected one of the two")
        try:
            evaluation.check_law(self.calibration, channels)
            if all(given):
                evaluation.bind_law(self.calibration, channels, [unit or "" for unit in given])
        except UnitError as error:
            raise ValueError(f"calibration: {error}") from error
        return self


def sensitivity_scatter(name: str, columns: "Sequence[Column]", errors: SensorErrors) -> Floats:
    """Standard deviations of the entries of a sensor's sensitivity matrix, (k, k) [SI].

    Cross-talk between channels of different units is a share of the ratio of their ranges. Raises RigError where one of
    them has no range.
    """
    own: Floats = np.diag(np.full(len(columns), errors.sensitivity))
    if not errors.cross:
        return own
    scale = np.ones(own.shape)
    if not (same := np.array([[a.dimensions == b.dimensions for b in columns] for a in columns])).all():
        ranges = np.array([stated_range(name, column) for column in columns])
        scale = np.where(same, 1.0, ranges[:, None] / ranges[None, :])
    return own + errors.cross * scale * (1.0 - np.eye(len(columns)))


def stated_range(name: str, column: "Column") -> float:
    """The range of a sensor's channel [SI], of which its errors are shares. Raises RigError where none is stated."""
    if column.range is None:
        raise RigError(
            f"bench.errors.{name}: channel {column.channel!r} has no range, of which offset, drift and cross-talk "
            f"between different units are shares: state sensors.{name}.range"
        )
    return column.range
