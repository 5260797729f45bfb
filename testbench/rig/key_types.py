"""Types of the keys of rigs and plans: quantities in SI, one for each axis, and units in which a log is written."""

from typing import Annotated

from pydantic import AfterValidator

from balance.errors import UnitError
from balance.input_files import Measured, OneForAll, Quantity
from balance.units import factor_to_si

from ..calibration.definition import is_electrical


def _unit_of(*dimensions: str) -> AfterValidator:
    """A unit of what is measured, or one that a sensor writes before it is calibrated, such as V."""

    def known(unit: str) -> str:
        try:
            factor_to_si(unit, *dimensions)
        except UnitError as error:
            if not is_electrical(unit):
                raise ValueError(f"{error}, or an electrical one, such as 'V' or 'mV/V'") from error
        return unit

    return AfterValidator(known)


EACH_AXIS = OneForAll(3)
"""One quantity for all three axes, or a list of three."""

Time = Annotated[float, Quantity("time")]
Duration = Annotated[float, Quantity("time", above=0.0)]
Deviation = Annotated[float, Quantity("time", at_least=0.0)]
"""Standard deviation of a time."""
Length = Annotated[float, Quantity("length")]
Point = tuple[Length, Length, Length]
Turn = Annotated[float, Quantity("angle")]
Mass = Annotated[float, Quantity("mass", above=0.0)]
MassOfEitherSign = Annotated[float, Quantity("mass")]
MassPerLength = Annotated[float, Quantity("mass per length", above=0.0)]
Frequency = Annotated[float, Quantity("frequency", above=0.0)]
Inertia = Annotated[float, Quantity("inertia", above=0.0)]
Stiffness = Annotated[float, Quantity("stiffness", above=0.0)]
TurningStiffness = Annotated[float, Quantity("moment", above=0.0)]
Acceleration = Annotated[float, Quantity("acceleration", above=0.0)]
PEAK_ACCELERATION = Quantity("acceleration", "angular acceleration", above=0.0)
PeakAcceleration = Annotated[Measured[float], PEAK_ACCELERATION]
"""Of a point, or of joints that turn."""
Force = Annotated[float, Quantity("force", above=0.0)]
Moment = Annotated[float, Quantity("moment", above=0.0)]
Angle = Annotated[float, Quantity("angle", above=0.0)]
Accelerations = Annotated[tuple[Acceleration, Acceleration, Acceleration], EACH_AXIS]
Forces = Annotated[tuple[Force, Force, Force], EACH_AXIS]
Moments = Annotated[tuple[Moment, Moment, Moment], EACH_AXIS]

AccelerationUnit = Annotated[str, _unit_of("acceleration")]
ForceUnit = Annotated[str, _unit_of("force")]
MomentUnit = Annotated[str, _unit_of("moment")]
JointStep = Annotated[Measured[float], Quantity("angle", "length", above=0.0)]
DriveLoad = Annotated[Measured[float], Quantity("moment", "force", above=0.0)]
JointUnit = Annotated[str, _unit_of("angle", "length")]
DriveUnit = Annotated[str, _unit_of("moment", "force")]
