"""What all sensors have in common: their logger, calibration and channels, each with its unit and component.

For a simulated or estimated sensor, the rig also states how far its sensitivity matrix may be from the identity.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from pydantic import PrivateAttr

from balance.arrays import Floats
from balance.errors import DataError, UnitError
from balance.input_files import Measured, Table
from balance.units import dimension_of

from ..calibration.definition import Calibration, Teds, is_electrical
from ..calibration.evaluation import Column, bind_law, check_law
from ..errors import RigError
from .bench import SensorErrors


class LoggedSensor(Table, ABC):
    """A sensor whose channels a logger writes."""

    dimensions: ClassVar[tuple[str, ...]] = ()
    """Quantities that its channels may measure."""
    commanded: ClassVar[bool] = False
    """Whether it is computed by the controller and not measured."""
    level: ClassVar[bool] = True
    """Whether its values count, and not the instants of its edges alone."""
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
            columns = tuple(
                self._column(name, component, channel, *self._unit_of_log(component))
                for component, channel in self.components.items()
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

    @property
    @abstractmethod
    def components(self) -> Mapping[str, str]:
        """The channel of each component that it measures, in the order of the rig."""

    def _column(self, name: str, component: str, channel: str, unit: str, stated: bool) -> Column:
        levels = {key: self._level(key, component) for key in ("range", "noise", "resolution")}
        return Column(
            channel, name, component, self.logger, unit, self._dimensions(component),
            range=levels["range"], noise=levels["noise"] or 0.0, resolution=levels["resolution"] or 0.0,
            commanded=self.commanded, level=self.level, stated=stated,
            calibration=self.calibration, crosstalk=getattr(self, "crosstalk", None),
            delay=0.0 if self.commanded else self._delay,
        )  # fmt: skip

    def _dimensions(self, component: str) -> tuple[str, ...]:
        """Quantities that a component may be of."""
        return self.dimensions

    def _level(self, key: str, component: str) -> float | None:
        """The range, noise or resolution of a component [SI], of all axes, of forces and moments, or of the joint."""
        stated: Any = getattr(self, key, None)
        if isinstance(stated, Table):
            stated = getattr(stated, component[0])
        if isinstance(stated, Measured):
            return float(stated.value)
        return None if stated is None else stated["xyz".index(component[-1])]

    def _unit_of_log(self, component: str) -> tuple[str, bool]:
        """The unit of a component in the log, and whether the rig states it."""
        return self._unit_unless_raw(getattr(self, "unit", None))

    def _unit_unless_raw(self, unit: str | None) -> tuple[str, bool]:
        """The unit, stated or the usual one of the kind, in which raw values are not."""
        stated = "unit" in self.model_fields_set
        is_raw = not stated and self.calibration is not None and self.calibration.scales
        return "" if is_raw else unit or "", stated and bool(unit)

    def _check(self) -> None:
        """Levels of the kind of the unit, and a calibration that fits components and unit."""
        levels = {key: getattr(self, key, None) for key in ("range", "noise", "resolution")}
        measured = {key: level for key, level in levels.items() if isinstance(level, Measured)}
        if measured and not is_electrical(unit := getattr(self, "unit", "")):
            kind = dimension_of(f"1 {unit}", *self.dimensions)
            for key, level in measured.items():
                if level.dimension != kind:
                    raise DataError(f"{key}: is of {level.dimension}, but the sensor's unit {unit!r} is one of {kind}")
        if self.calibration is None:
            return
        channels = self.columns("")
        if wrong := [c for c in channels if c.unit and self.calibration.unit not in {None, c.unit}]:
            raise DataError(
                f"calibration.unit: {self.calibration.unit!r}, but unit is {wrong[0].unit!r}: state it once"
            )
        if self.calibration.matrix is not None and getattr(self, "crosstalk", None) is not None:
            raise DataError("crosstalk: the calibration has a matrix: expected one of the two")
        units = [c.unit or self.calibration.unit or "" for c in channels]
        try:
            check_law(self.calibration, channels)
            if all(units):
                bind_law(self.calibration, channels, units)
        except UnitError as error:
            raise DataError(f"calibration: {error}") from error


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
