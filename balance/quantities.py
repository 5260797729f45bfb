"""Text with unit <-> SI. Everything inside the packages is SI; this is the edge.

``g0`` is 9.81 m/s2, the value of the source (see CONVENTIONS.md), not the standard 9.80665 m/s2.
"""

import math
import re
from functools import cache
from tokenize import TokenError
from typing import TYPE_CHECKING

from .errors import UnitError

if TYPE_CHECKING:
    import pint

G0 = 9.81
"""Acceleration of gravity of the source [m/s2]."""

SI_UNITS = {
    "mass": "kg",
    "length": "m",
    "time": "s",
    "acceleration": "m/s^2",
    "velocity": "m/s",
    "angle": "rad",
    "angular velocity": "rad/s",
    "angular acceleration": "rad/s^2",
    "frequency": "Hz",
    "force": "N",
    "moment": "N m",
    "first moment": "kg m",
    "inertia": "kg m^2",
    "voltage": "V",
    "stiffness": "N/m",
    "damping": "N s/m",
}
"""Dimensions that a quantity may be asked to have, and the unit in which it is returned."""

_WRITTEN = {"angle": "deg", "angular velocity": "rpm"}
"""Units that people write, where they are not those of SI: for examples."""
_TURNING_OR_NOT = {"angular velocity", "angular acceleration", "frequency"}
"""Dimensions whose units must count radians or must not: 50 Hz is not 50 rad/s, though both are 1/s."""
_QUANTITY = re.compile(r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)\s*(.*?)\s*")
_POWER = r"(?:\^|\*\*)(?:[+-]?[0-9](?:\.[0-9])?|\([+-]?[0-9](?:\.[0-9])?\))(?! *(?:[0-9.^]|\*\*))"
_UNIT_TEXT = re.compile(rf"(?:[A-Za-zµμ°Ω%][A-Za-zµμ°Ω%_0-9]*+|1(?= */)|[²³⁴⁻¹]++|{_POWER}|[*·⋅/.() -])++")
"""Names, powers of one digit, and what joins them: pint computes powers of powers, however long that takes."""
_LONGEST_UNIT = 40
_SPELLINGS = {
    "Nm": "N*m", "Nmm": "N*mm", "kNm": "kN*m", "mNm": "mN*m", "Ncm": "N*cm", "kgm": "kg*m", "kgm2": "kg*m^2",
    "kgm^2": "kg*m^2", "Newtons": "N", "Newton": "N", "volts": "V", "Volts": "V", "sec": "s", "°C": "degC",
}  # fmt: skip


def parse(text: str, dimension: str) -> float:
    """Read ``text`` such as ``37.55mm`` or ``3 g0`` as a quantity of ``dimension``, in SI.

    Raises UnitError if the text is no number with a unit, or the unit is of another dimension.
    """
    expected = SI_UNITS[dimension]
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise UnitError(f"{text!r} is no {dimension}: expected a number and a unit, such as '1 {expected}'")
    if match[2].startswith(","):
        raise UnitError(_with_comma(text))
    if not match[2]:
        raise UnitError(f"{text!r} has no unit: write for example '{match[1]} {_WRITTEN.get(dimension, expected)}'")
    value = float(match[1]) * factor_to_si(match[2], dimension)
    if not math.isfinite(value):
        raise UnitError(f"{text!r} is beyond all bounds: expected a finite number")
    return value


def _with_comma(text: str) -> str:
    """What to write instead of a number with a comma, which may be of decimals or of thousands."""
    plain = text.strip()
    if match := re.fullmatch(r"([+-]?[0-9]+),([0-9]+)(\D.*)?", plain):
        decimal = f"{match[1]}.{match[2]}{match[3] or ''}"
        of_thousands = f", or '{match[1]}{match[2]}{match[3] or ''}'" if len(match[2]) == 3 else ""
        return f"{plain!r} has a comma: write '{decimal}'{of_thousands}"
    return f"{plain!r} has a comma: write numbers with a decimal point and without marks of thousands"


def factor_to_si(unit: str, dimension: str) -> float:
    """Factor that turns a value in ``unit`` into the SI unit of ``dimension``."""
    parsed = parse_unit(unit)
    if parsed is None:
        raise UnitError(f"{unit!r} is not a known unit: expected {dimension}, such as '{SI_UNITS[dimension]}'")
    registry = _registry()
    expected = registry.parse_units(_spelled(SI_UNITS[dimension]))
    same = parsed.dimensionality == expected.dimensionality
    if same and dimension in _TURNING_OR_NOT:
        same = registry.get_base_units(parsed)[1] == registry.get_base_units(expected)[1]
    if not same:
        raise UnitError(f"{unit!r} is not a unit of {dimension}: expected one such as '{SI_UNITS[dimension]}'")
    return float(registry.Quantity(1.0, parsed).to(expected).magnitude)


def parse_unit(text: str) -> "pint.Unit | None":
    """The unit that ``text`` names, as pint understands it, or None if it names none."""
    import pint

    if not text.strip() or len(text) > _LONGEST_UNIT or _UNIT_TEXT.fullmatch(text) is None:
        return None
    try:
        return _registry().parse_units(_spelled(text.strip()))
    except (pint.errors.PintError, ValueError, TypeError, AttributeError, AssertionError, ArithmeticError, TokenError):
        return None  # pint raises any of these on text that is no unit


def _spelled(unit: str) -> str:
    """Loggers' spellings in the form that pint reads: ``m/s2`` -> ``m/s^2``, ``N·m`` -> ``N*m``."""
    unit = _SPELLINGS.get(unit, unit).replace("·", "*").replace("⋅", "*")
    return re.sub(r"(?<=[A-Za-z])([23])(?![0-9])", r"^\1", unit)


@cache
def _registry() -> "pint.UnitRegistry[float]":
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry()
    registry.define("rev = turn")
    registry.define(f"g0 = {G0} * meter / second ** 2")
    return registry
