"""One channel of a log as the rig describes it.

What all sensors have in common: their logger, their calibration, and how the log's units are told.

How far a sensor's sensitivity matrix may be from one, as the rig states it.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np
from pydantic import PrivateAttr, model_validator

from balance.arrays import Floats
from balance.errors import UnitError
from balance.input_files import Table
from balance.units import factor_to_si

from ..calibration import evaluation
from ..calibration.definition import Calibration
from ..calibration.teds import Teds
from ..errors import RigError

if TYPE_CHECKING:
    from .bench import SensorErrors


@dataclass(frozen=True)
class Column:
    """A channel: which component of which sensor, in which unit the logger writes it. Everything else in SI."""

    channel: str
    """Its name in the log, without the unit."""
    sensor: str
    component: str
    """``x``, ``Fz``, ``Mx``, or the joint."""
    logger: str
    unit: str
    """As the logger writes it; empty where the rig does not say so."""
    dimensions: tuple[str, ...]
    """What it may be the unit of, such as ("angle", "length")."""
    range: float | None = None
    """Largest absolute value that the sensor gives [SI]."""
    noise: float = 0.0
    """Standard deviation of one sample [SI]."""
    resolution: float = 0.0
    """Step between two values [SI]."""
    commanded: bool = False
    """Computed by the controller and not measured: flat tops and constant values are no fault of it."""
    stated: bool = True
    """Whether the rig states the unit, and it is not the usual one of the kind."""
    calibration: Calibration | None = None
    """Of the sensor, as the rig has it; a later record of the campaign goes before it."""
    crosstalk: tuple[tuple[float, ...], ...] | None = None
    """Of the sensor: readings = crosstalk @ loads, in SI."""
    delay: float = 0.0
    """By which its logger's stated filter delays what is slow [s]; zero where the rig states no filter."""
    siblings: "tuple[Column, ...]" = ()
    """All channels of the sensor in the order of the rig, this one among them."""

    @property
    def factor(self) -> float:
        """SI units in one unit of the log, where the log is in physical units. Raises UnitError elsewhere."""
        return factor_to_si(self.unit, *self.dimensions)

    @property
    def index(self) -> int:
        """Which of the sensor's channels it is."""
        return [s.channel for s in self.siblings].index(self.channel)

    def written(self, values: Floats) -> Floats:
        """Values (n,) [SI] as the logger writes them. Raises UnitError where the calibration cannot be turned round."""
        if self.calibration is None:
            return values / self.factor
        from ..calibration.evaluation import bind_law

        units = [s.unit or self.calibration.unit or "" for s in self.siblings]
        if not all(units):
            raise UnitError(
                f"sensors.{self.sensor}: no unit in which its logger writes: say sensors.{self.sensor}.unit"
            )
        return bind_law(self.calibration, self.siblings, units).written(self.index, values)

    def written_range(self) -> float | None:
        """Largest absolute value in the unit of the log; None where it is not known, or not the same at both ends."""
        if self.range is None or not self.unit:
            return None
        try:
            ends = self.written(np.array([-self.range, self.range]))
        except UnitError:
            return None
        return abs(float(ends[1])) if float(ends[0]) == -float(ends[1]) else None


def together(columns: "list[Column]") -> "list[Column]":
    """The columns of one sensor, each knowing all."""
    return [replace(column, siblings=tuple(columns)) for column in columns]


class LoggedSensor(Table, ABC):
    """A sensor whose channels a logger writes."""

    logger: str
    """Logger that records it."""
    model: str = ""
    """Maker and model."""
    calibration: Calibration | None = None
    """Where the logger does not write physical units, or writes them with an offset."""
    teds: Teds | None = None
    """What the sensor says of itself (IEEE 1451.4)."""
    _delay: float = PrivateAttr(0.0)
    """Of its logger's filter [s], as the rig says when it is read."""

    def columns(self, name: str) -> Iterator[Column]:
        """The channels of the sensor called ``name``."""
        cross = getattr(self, "crosstalk", None)
        yield from together(
            [
                replace(c, calibration=self.calibration, crosstalk=cross, delay=self._late(c))
                for c in self._channels(name)
            ]
        )

    def delayed(self, delay: float) -> None:
        """Take in the delay of the logger's filter [s]."""
        self._delay = delay

    def _late(self, column: Column) -> float:
        """What a controller computes passes no filter."""
        return 0.0 if column.commanded else self._delay

    @abstractmethod
    def _channels(self, name: str) -> Iterator[Column]:
        """The channels as the kind of sensor has them, before calibration, cross-talk and delay."""

    def _written_in(self, unit: str | None) -> tuple[str, bool]:
        """The unit of the log and whether the rig states it. The usual one of a kind is not that of raw values."""
        if "unit" in self.model_fields_set:
            return unit or "", bool(unit)
        return ("", False) if self.calibration is not None else (unit or "", False)

    @model_validator(mode="after")
    def _calibrated(self) -> Self:
        """A calibration that fits the components, and the unit where the rig states one."""
        if self.calibration is None:
            return self
        channels = list(self.columns(""))
        given = [c.unit or self.calibration.unit for c in channels]
        if wrong := [c for c in channels if c.unit and self.calibration.unit not in {None, c.unit}]:
            raise ValueError(f"calibration.unit: {self.calibration.unit!r}, but unit is {wrong[0].unit!r}: say it once")
        if self.calibration.matrix is not None and getattr(self, "crosstalk", None) is not None:
            raise ValueError("crosstalk: the calibration has a matrix: expected one of the two")
        try:
            evaluation.check_law(self.calibration, channels)
            if all(given):
                evaluation.bind_law(self.calibration, channels, [unit or "" for unit in given])
        except UnitError as error:
            raise ValueError(f"calibration: {error}") from error
        return self


def scatter(name: str, columns: "Sequence[Column]", errors: "SensorErrors") -> Floats:
    """Standard deviation of the entries of a sensor's sensitivity matrix, in SI, (k, k).

    Raises RigError where channels of unlike units talk and one has no range.
    """
    own: Floats = np.diag(np.full(len(columns), errors.sensitivity))
    if not errors.cross:
        return own
    return own + errors.cross * _between(name, columns) * (1.0 - np.eye(len(columns)))


def _between(name: str, columns: "Sequence[Column]") -> Floats:
    """What a cross-talk of one means between channels: one, and between unlike units the ratio of the ranges."""
    like = np.array([[a.dimensions == b.dimensions for b in columns] for a in columns])
    if like.all():
        return np.ones(like.shape)
    ranges = np.array([range_of(name, column) for column in columns])
    return np.where(like, 1.0, ranges[:, None] / ranges[None, :])


def range_of(name: str, column: "Column") -> float:
    """Of a channel of a sensor [SI], of which the rig states shares. Raises RigError where it states no range."""
    if column.range is None:
        raise RigError(
            f"bench.errors.{name}: channel {column.channel!r} has no range, of which offset, drift and cross-talk "
            f"between unlike units are shares: state sensors.{name}.range"
        )
    return column.range
