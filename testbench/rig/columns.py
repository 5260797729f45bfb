"""One channel of a log as the rig describes it."""

from dataclasses import dataclass, replace

import numpy as np

from balance.arrays import Floats
from balance.errors import UnitError
from balance.quantities import factor_to_si

from ..calibration.document import Calibration


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
        from ..calibration.law import bind

        units = [s.unit or self.calibration.unit or "" for s in self.siblings]
        if not all(units):
            raise UnitError(
                f"sensors.{self.sensor}: no unit in which its logger writes: say sensors.{self.sensor}.unit"
            )
        return bind(self.calibration, self.siblings, units).written(self.index, values)

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
