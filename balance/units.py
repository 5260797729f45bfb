"""Text with unit <-> SI. Everything inside the packages is SI; this is the edge.

``g0`` is 9.81 m/s2, the value of the source (see CONVENTIONS.md), not the standard 9.80665 m/s2.
"""

import cmath
import math
import re
from contextlib import suppress
from functools import cache, lru_cache
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
    "turning damping": "N m s",
    "mass per length": "kg/m",
    "density": "kg/m^3",
}
"""Dimensions that a quantity may be asked to have, and the unit in which it is returned."""

_WRITTEN = {"angle": "deg", "angular velocity": "rpm"}
"""Units that people write, where they are not those of SI: for examples."""
_TURNING_OR_NOT = {"angular velocity", "angular acceleration", "frequency"}
"""Dimensions whose units count radians, or do not: 50 Hz is not 50 rad/s, though both are 1/s."""
_QUANTITY = re.compile(r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)\s*(.*?)\s*")
_POWER = r"(?:\^|\*\*)(?:[+-]?[0-9](?:\.[0-9])?|\([+-]?[0-9](?:\.[0-9])?\))(?! *(?:[0-9.^]|\*\*))"
_UNIT_TEXT = re.compile(rf"(?:[A-Za-zµμ°Ω%][A-Za-zµμ°Ω%_0-9]*+|1(?= */)|[²³⁴⁻¹]++|{_POWER}|[*·⋅/.() -])++")
"""Names, powers of one digit, and their operators: pint would compute powers of powers, however long that takes."""
_LONGEST_UNIT = 40
_SPELLINGS = {
    "Nm": "N*m", "Nmm": "N*mm", "kNm": "kN*m", "mNm": "mN*m", "Ncm": "N*cm", "kgm": "kg*m", "kgm2": "kg*m^2",
    "kgm^2": "kg*m^2", "Newtons": "N", "Newton": "N", "volts": "V", "Volts": "V", "sec": "s", "°C": "degC",
}  # fmt: skip
_SPELLINGS_OF = {
    "length": {"mil": "thou", "mils": "thou"},
    "first moment": {"gmm": "g mm", "kgmm": "kg mm", "gcm": "g cm", "ozin": "oz in"},
    "acceleration": {"g": "g0", "G": "g0", "mg": "mg0", "µg": "ug0", "μg": "ug0", "ug": "ug0"},
}
"""A mil of a vibration instrument is a thousandth of an inch, elsewhere an angle; of an acceleration g is g0
and no gram, mg no milligram."""
_HALF_WIDTH = re.compile(r"\s*(?:±|\+/?-)\s*")
"""Between a value and the half width of its interval."""


def parse(text: str, dimension: str) -> float:
    """Read ``text`` such as ``37.55mm`` or ``3 g0`` as a quantity of ``dimension``, in SI.

    Raises UnitError if the text is no number with a unit, or the unit is of another dimension.
    """
    expected = SI_UNITS[dimension]
    match = _QUANTITY.fullmatch(text)
    if match is None:
        if re.match(r"\s*[+-]?(nan|inf)", text, re.IGNORECASE):
            raise UnitError(f"{text!r} is no finite number: expected one with a unit, such as '1 {expected}'")
        raise UnitError(f"{text!r} is no {dimension}: expected a number and a unit, such as '1 {expected}'")
    if match[2].startswith(","):
        raise UnitError(_comma_message(text))
    if not match[2]:
        raise UnitError(f"{text!r} has no unit: write for example '{match[1]} {_WRITTEN.get(dimension, expected)}'")
    value = float(match[1]) * factor_to_si(match[2], dimension)
    if not math.isfinite(value):
        raise UnitError(f"{text!r} is too large: expected a finite number")
    return value


def si(value: float | str, dimension: str) -> float:
    """A quantity in SI: a number is in SI already, a text has its unit; ``dimension`` is one of ``SI_UNITS``.

    >>> import balance
    >>> balance.si("37.55 mm", "length"), balance.si(5.0, "mass")
    (0.03755, 5.0)
    """
    return parse(value, dimension) if isinstance(value, str) else float(value)


def _comma_message(text: str) -> str:
    """What to write instead of a number with a comma, which may separate decimals or thousands."""
    plain = text.strip()
    if match := re.fullmatch(r"([+-]?[0-9]+),([0-9]+)(\D.*)?", plain):
        decimal = f"{match[1]}.{match[2]}{match[3] or ''}"
        of_thousands = f", or '{match[1]}{match[2]}{match[3] or ''}'" if len(match[2]) == 3 else ""
        return f"{plain!r} has a comma: write '{decimal}'{of_thousands}"
    return f"{plain!r} has a comma: write numbers with a decimal point and without marks of thousands"


def example(dimension: str) -> str:
    """A quantity of a dimension as people write it, for messages: ``1 kg``, ``1 deg``."""
    return f"1 {_WRITTEN.get(dimension, SI_UNITS[dimension])}"


@lru_cache(maxsize=1024)
def factor_to_si(unit: str, *dimensions: str) -> float:
    """Factor that turns a value in ``unit`` into the SI unit of the first of ``dimensions`` that it is a unit of."""
    for dimension in dimensions if len(dimensions) > 1 else ():
        with suppress(UnitError):
            return factor_to_si(unit, dimension)
    dimension, kinds = dimensions[-1], " or ".join(dimensions)
    such = " or ".join(f"'{SI_UNITS[one]}'" for one in dimensions)
    parsed = parse_unit(_SPELLINGS_OF.get(dimension, {}).get(unit.strip(), unit))
    if parsed is None:
        raise UnitError(f"{unit!r} is not a known unit: expected {kinds}, such as {such}")
    registry = _registry()
    expected = registry.parse_units(_spelled(SI_UNITS[dimension]))
    same = parsed.dimensionality == expected.dimensionality
    if same and dimension in _TURNING_OR_NOT:
        same = registry.get_base_units(parsed)[1] == registry.get_base_units(expected)[1]
        if not same and dimension == "angular velocity":
            raise UnitError(f"{unit!r} may count turns or radians: write rpm, turn/s or rad/s")
    if not same:
        raise UnitError(f"{unit!r} is not a unit of {kinds}: expected one such as {such}")
    return float(registry.Quantity(1.0, parsed).to(expected).magnitude)


def dimension_of(text: str, *dimensions: str) -> str:
    """Which of ``dimensions`` a quantity or vector has; the first where it has none: parsing it then names that one."""
    match = _QUANTITY.fullmatch(_HALF_WIDTH.split(text.partition("@")[0])[0])
    for dimension in dimensions:
        try:
            factor_to_si(match[2] if match else "", dimension)
        except UnitError:
            continue
        return dimension
    return dimensions[0]


def parse_vector(text: str, *dimensions: str) -> complex:
    """Read ``magnitude @ angle``, such as ``133.75 kg mm @ 348 deg``, of any of ``dimensions``, in SI.

    The angle is required: a magnitude alone is no vector.
    """
    size, separator, angle = (part.strip() for part in text.partition("@"))
    if not separator or not angle:
        raise UnitError(f"{text!r} has no angle: write 'magnitude unit @ angle unit', such as '1 g @ 30 deg'")
    magnitude = parse(size, dimension_of(size, *dimensions))
    if magnitude < 0.0:
        raise UnitError(f"{text!r} has a negative magnitude: turn the angle by 180 degrees instead")
    return cmath.rect(magnitude, parse(angle, "angle"))


def parse_uncertain(text: str, *dimensions: str) -> tuple[complex, tuple[float, float] | None]:
    """Read ``170 um ± 2 um @ 112 deg ± 1 deg``: a vector in SI, and half its interval along and across, in SI.

    ``± 2 %`` is of the magnitude. Without an interval of the angle that of the magnitude holds in every direction;
    without any there is None.
    """
    size, separator, angle = text.partition("@")
    magnitude, *within = _HALF_WIDTH.split(size)
    turned, *about = _HALF_WIDTH.split(angle)
    found = parse_vector(f"{magnitude.strip()} {separator} {turned.strip()}", *dimensions)
    if len(within) > 1 or len(about) > 1 or (about and not within):
        raise UnitError(f"{text!r}: expected ± once after the magnitude, and once after the angle if at all")
    if not within:
        return found, None
    along = _half_width(within[0].strip(), dimension_of(magnitude, *dimensions), abs(found))
    return found, (along, abs(found) * _half_width(about[0].strip(), "angle", 0.0) if about else along)


def _half_width(text: str, dimension: str, whole: float) -> float:
    """Half an interval, in SI; per cent refer to ``whole``, where that is not zero."""
    match = _QUANTITY.fullmatch(text)
    of_whole = match is not None and match[2] == "%" and whole > 0.0
    half = float(match[1]) / 100.0 * whole if match is not None and of_whole else parse(text, dimension)
    if not 0.0 < half < math.inf:
        raise UnitError(f"± {text}: expected more than zero")
    return half


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
