"""Fields of rigs and plans: text with a unit, read into SI. In an acceleration, ``g`` means g0 and not gram."""

import re
from functools import lru_cache, partial
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict

from balance.errors import UnitError
from balance.quantities import SI_UNITS, factor_to_si, parse

from ..calibration.amounts import is_electrical

_IN_G = re.compile(r"(.*\d\.?)\s*[gG]")


class Table(BaseModel):
    """A table of the file: frozen, and no key in it that is not known."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def read(text: object, dimension: str, positive: bool = False) -> float:
    """A quantity such as ``50 g`` or ``0.2 m`` in SI. Raises ValueError, as pydantic wants it."""
    if isinstance(text, bool) or not isinstance(text, str | int | float):
        raise ValueError(f"{text!r}: expected a text with a unit, such as '1 {SI_UNITS[dimension]}'")
    if not isinstance(text, str):
        raise ValueError(f"{text} has no unit: write a text, such as '{text} {SI_UNITS[dimension]}'")
    try:
        value = parse(_g_as_g0(text) if dimension == "acceleration" else text, dimension)
    except UnitError as error:
        raise ValueError(str(error) if repr(text) in str(error) else f"{text!r}: {error}") from error
    if positive and not value > 0.0:
        raise ValueError(f"{text!r}: expected a positive {dimension}")
    return value


def _g_as_g0(text: str) -> str:
    match = _IN_G.fullmatch(text.strip())
    return f"{match[1]} g0" if match else text


@lru_cache(maxsize=1024)
def unit_factor(unit: str, *dimensions: str) -> float:
    """SI units in one ``unit`` of any of ``dimensions``. Raises UnitError if it is a unit of none."""
    if "acceleration" in dimensions and unit.strip() in {"g", "G"}:
        unit = "g0"
    for dimension in dimensions[:-1]:
        try:
            return factor_to_si(unit, dimension)
        except UnitError:
            continue
    return factor_to_si(unit, dimensions[-1])


def _si(dimension: str, positive: bool = False) -> BeforeValidator:
    return BeforeValidator(partial(read, dimension=dimension, positive=positive))


def _unit_of(*dimensions: str) -> AfterValidator:
    return AfterValidator(partial(_known_unit, dimensions=dimensions))


def _known_unit(unit: str, dimensions: tuple[str, ...]) -> str:
    """A unit of what is measured, or one that a sensor writes before it is calibrated, such as V."""
    try:
        unit_factor(unit, *dimensions)
    except UnitError as error:
        if not is_electrical(unit):
            raise ValueError(f"{error}, or an electrical one, such as 'V' or 'mV/V'") from error
    return unit


def _three(value: object) -> object:
    """One quantity for all three axes, or one for each."""
    return value if isinstance(value, list | tuple) else [value] * 3


EACH_AXIS = BeforeValidator(_three)
"""One quantity for all three axes, or a list of three."""

Time = Annotated[float, _si("time")]
Length = Annotated[float, _si("length")]
Point = tuple[Length, Length, Length]
Mass = Annotated[float, _si("mass", positive=True)]
Frequency = Annotated[float, _si("frequency", positive=True)]
Inertia = Annotated[float, _si("inertia", positive=True)]
Stiffness = Annotated[float, _si("stiffness", positive=True)]
TurningStiffness = Annotated[float, _si("moment", positive=True)]
Damping = Annotated[float, _si("damping", positive=True)]
Acceleration = Annotated[float, _si("acceleration", positive=True)]
Force = Annotated[float, _si("force", positive=True)]
Moment = Annotated[float, _si("moment", positive=True)]
Angle = Annotated[float, _si("angle", positive=True)]
Accelerations = Annotated[tuple[Acceleration, Acceleration, Acceleration], EACH_AXIS]
Forces = Annotated[tuple[Force, Force, Force], EACH_AXIS]
Moments = Annotated[tuple[Moment, Moment, Moment], EACH_AXIS]
Inertias = Annotated[tuple[Inertia, Inertia, Inertia], EACH_AXIS]
Stiffnesses = Annotated[tuple[Stiffness, Stiffness, Stiffness], EACH_AXIS]
Dampings = Annotated[tuple[Damping, Damping, Damping], EACH_AXIS]

AccelerationUnit = Annotated[str, _unit_of("acceleration")]
ForceUnit = Annotated[str, _unit_of("force")]
MomentUnit = Annotated[str, _unit_of("moment")]
JointUnit = Annotated[str, _unit_of("angle", "length")]
DriveUnit = Annotated[str, _unit_of("moment", "force")]
