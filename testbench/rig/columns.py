"""One channel of a log as the rig describes it."""

from dataclasses import dataclass

from .fields import unit_factor


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
    """As the logger writes it."""
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

    @property
    def factor(self) -> float:
        """SI units in one unit of the log."""
        return unit_factor(self.unit, *self.dimensions)
