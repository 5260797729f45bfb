"""Texts with compound units, such as ``10.2 mV/g`` or ``3.9 pC/N``, in SI base units. In an acceleration g is g0."""

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import Any

from balance.errors import UnitError
from balance.quantities import SI_UNITS, parse_unit

_AMOUNT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")
_STANDARD_GRAVITY = re.compile(r"(?<![A-Za-z])[gG](?![A-Za-z0-9])")
_LSB = re.compile(r"(?<![A-Za-z])(?:LSB|digits?)(?![A-Za-z0-9])")
ELECTRICAL = ("V", "A", "C", "ohm", "V/V", "count")
"""Units of what a sensor gives uncalibrated: voltage, current, charge, resistance, a ratio, steps of a converter."""


@dataclass(frozen=True)
class Amount:
    """A value in SI base units, and these."""

    value: float
    units: Any

    def __mul__(self, other: "Amount") -> "Amount":
        return Amount(self.value * other.value, self.units * other.units)

    def __truediv__(self, other: "Amount") -> "Amount":
        return Amount(self.value / other.value, self.units / other.units)


@cache
def unit(text: str, dimensions: tuple[str, ...]) -> Amount:
    """One ``text`` in SI base units; ``dimensions`` are those of what is measured. Raises UnitError for no unit."""
    plain = _LSB.sub("count", text.strip())
    if "acceleration" in dimensions:
        plain = _STANDARD_GRAVITY.sub("g0", plain)
    parsed = parse_unit(plain)
    if parsed is None:
        raise UnitError(f"{text!r} is not a known unit")
    base = (1.0 * parsed).to_base_units()
    return Amount(float(base.magnitude), base.units)


def amount(text: str, dimensions: tuple[str, ...]) -> Amount:
    """A number with a unit in SI base units; finite."""
    match = _AMOUNT.fullmatch(text)
    if match is None or not match[2]:
        raise UnitError(f"{text!r}: expected a number and a unit, such as '10.2 mV/g'")
    one = unit(match[2], dimensions)
    value = float(match[1]) * one.value
    if not math.isfinite(value):
        raise UnitError(f"{text!r} is beyond all bounds")
    return Amount(value, one.units)


def measures(units: Any, dimensions: tuple[str, ...]) -> bool:  # noqa: ANN401
    """Whether SI base units are those of one of ``dimensions``."""
    return any(units == unit(SI_UNITS[d], ()).units for d in dimensions)


def electrical_name(units: Any) -> str | None:  # noqa: ANN401
    """``V``, ``C``, ...: what a sensor gives in these SI base units; None if it is nothing electrical."""
    return next((known for known in ELECTRICAL if units == unit(known, ()).units), None)


def is_electrical(text: str) -> bool:
    """Whether a unit is one that a sensor writes before it is calibrated, such as V, pC, mV/V or counts."""
    try:
        return electrical_name(unit(text, ()).units) is not None
    except UnitError:
        return False
