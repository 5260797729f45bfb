"""What all sensors have in common: their logger, their calibration, and how the log's units are told."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from typing import Self

from pydantic import PrivateAttr, model_validator

from balance.errors import UnitError
from balance.input_files import Table

from ..calibration import law
from ..calibration.document import Calibration
from ..calibration.teds import Teds
from .columns import Column, together


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
            law.check(self.calibration, channels)
            if all(given):
                law.bind(self.calibration, channels, [unit or "" for unit in given])
        except UnitError as error:
            raise ValueError(f"calibration: {error}") from error
        return self
