"""A calibration as it is written in a rig or a record: texts with units, checked, not applied yet.

Compound units, such as ``10.2 mV/g`` or ``3.9 pC/N``, are read in SI base units; in an acceleration g is g0. The matrix
of a multi-axis sensor may come from a CSV of numbers: a row a component, a column a channel. Beside it a rig may state
the transducer electronic data sheet (IEEE 1451.4), as fields or as the 64 bits of the Basic TEDS.
"""

import csv
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date as Date
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from balance.errors import DataError, UnitError
from balance.input_files import Table, read_text
from balance.units import SI_UNITS, parse_unit

from ..errors import RigError
from ..units import is_unit

PerComponent = str | dict[str, str]
"""One text for all channels of a sensor, or one a component."""


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError(f"{value}: expected a finite number")
    return value


def _day(value: object) -> object:
    """A date of TOML, or text such as 2026-03-31."""
    try:
        return value.isoformat() if isinstance(value, Date) else Date.fromisoformat(str(value)).isoformat()
    except ValueError as error:
        raise ValueError(f"{value!r}: expected a date such as 2026-03-31") from error


Number = Annotated[float, AfterValidator(_finite)]
Day = Annotated[str, BeforeValidator(_day)]


class Polynomial(Table):
    """c0 + c1 x + c2 x^2 ...: x in ``raw``, the result in ``physical``."""

    coefficients: tuple[Number, ...] = Field(min_length=2)
    """c0, c1, c2 ..., in these units."""
    raw: str
    """Unit of what is written, such as ``V``."""
    physical: str
    """Unit of the result, such as ``N``."""


class Matrix(Table):
    """Loads = rows @ (raw - offset): a row a component, a column a channel, in the order of the sensor's channels."""

    rows: tuple[tuple[Number, ...], ...] = Field(min_length=1)
    """A row a component, a column a channel, in these units."""
    raw: str
    """Unit of what is written, such as ``mV/V``."""
    physical: PerComponent
    """Unit of the result, for all components or for each."""


class Uncertainty(Table):
    """Uncertainty of the sensitivity, polynomial or matrix: relative (``0.5 %``) or in its unit (``0.05 mV/g``).

    One error for all readings since the calibration: it does not average out, and cancels in ratios.
    """

    standard: PerComponent | None = None
    """Standard uncertainty, for all channels or for each."""
    expanded: PerComponent | None = None
    """Expanded uncertainty, as certificates state it; with its coverage factor."""
    coverage_factor: float | None = Field(default=None, gt=0.0, allow_inf_nan=False)
    """Coverage factor k: expanded = k x standard."""
    degrees_of_freedom: float | None = Field(default=None, ge=1.0)
    """Degrees of freedom of the standard uncertainty; left out: it is taken as known."""

    def _check(self) -> None:
        if (self.standard is None) == (self.expanded is None):
            raise DataError("expected one of standard, expanded")
        if (self.expanded is None) != (self.coverage_factor is None):
            raise DataError("expanded and coverage_factor go together, such as expanded = '1 %', coverage_factor = 2")

    def __str__(self) -> str:
        """On one line, as written."""
        factor = "" if self.coverage_factor is None else f" (k = {self.coverage_factor:g})"
        return f"{_each(self.standard, 'standard uncertainty {}')}{_each(self.expanded, 'uncertainty {}')}{factor}"


class Calibration(Table):
    """From a sensor's readings to what it measures.

    physical = (raw - offset) / (sensitivity x amplifier), or a polynomial, or a matrix of all channels; or an offset or
    an uncertainty alone, where the log is in physical units already.
    """

    sensitivity: PerComponent | None = None
    """Reading per unit, ``10.2 mV/g`` or ``3.9 pC/N``; negative where it is mounted or wired the other way round."""
    amplifier: PerComponent | None = None
    """Amplifier behind the sensor, as its maker prints it: ``10 mV/pC`` or ``100 pC/V``."""
    offset: PerComponent | None = None
    """Reading at zero, in the kind of unit of the log (``2.5 V``) or of the quantity (``-0.6 N``)."""
    polynomial: Polynomial | dict[str, Polynomial] | None = None
    """A polynomial in place of a sensitivity, for all channels or for each."""
    matrix: Matrix | None = None
    """A matrix in place of a sensitivity, for all channels together."""
    unit: str | None = None
    """Unit in which the logger writes, where neither the log nor the sensor's ``unit`` states it."""
    uncertainty: Uncertainty | None = None
    """Uncertainty of the sensitivity, amplifier included."""
    date: Day | None = None
    """When it was calibrated."""
    reference: str = ""
    """Certificate, laboratory."""

    def _check(self) -> None:
        given = [n for n in ("sensitivity", "polynomial", "matrix") if getattr(self, n) is not None]
        if len(given) > 1:
            raise DataError(f"{given[0]} and {given[1]}: expected one of sensitivity, polynomial, matrix")
        if not given and self.offset is None and self.uncertainty is None:
            raise DataError("expected one of sensitivity, polynomial, matrix, offset, uncertainty")
        if self.amplifier is not None and self.sensitivity is None:
            raise DataError("amplifier: goes with a sensitivity, such as '3.9 pC/N'")
        if self.offset is not None and self.polynomial is not None:
            raise DataError("offset: is the first coefficient of a polynomial; expected one of the two")

    @property
    def scales(self) -> bool:
        """Whether it turns readings into another unit; else they are in the unit of the kind of sensor already."""
        return (self.sensitivity, self.polynomial, self.matrix) != (None, None, None)

    def document(self) -> dict[str, Any]:
        """As it is stored; what is not given is left out."""
        return self.model_dump(exclude_none=True, exclude_defaults=True)

    def __str__(self) -> str:
        """On one line, as written."""
        parts = [_each(self.sensitivity, "{}"), _each(self.amplifier, "amplifier {}")]
        by_name = self.polynomial if isinstance(self.polynomial, dict) else {"": self.polynomial}
        for name, one in by_name.items():
            if one is not None:
                coefficients = " ".join(f"{c:g}" for c in one.coefficients)
                parts.append(f"{name} polynomial {coefficients} ({one.raw} to {one.physical})".strip())
        if self.matrix is not None:
            rows, out = self.matrix.rows, self.matrix.physical
            given = out if isinstance(out, str) else ", ".join(out.values())
            parts.append(f"matrix {len(rows)} x {len(rows[0])} ({self.matrix.raw} to {given})")
        day = f"calibrated {self.date}" if self.date else ""
        parts += [_each(self.offset, "offset {}"), str(self.uncertainty or ""), day, self.reference]
        return ", ".join(filter(None, parts))


def entry_of_component(each: "Mapping[str, Any] | Any", component: str) -> Any:  # noqa: ANN401
    """What is stated for a component: for all, or by its name, its letter (``F``) or, of a force, its axis."""
    if not isinstance(each, Mapping):
        return each
    for name in component_keys(component):
        if name in each:
            return each[name]
    return None


def component_keys(component: str) -> tuple[str, ...]:
    """The keys that mean a component: ``Fx`` is also meant by ``F`` and ``x``, ``Mz`` by ``M``."""
    if len(component) == 2 and component[0] in "FM" and component[1] in "xyz":
        return (component, component[0], component[1]) if component[0] == "F" else (component, component[0])
    return (component,)


def _each(each: PerComponent | None, form: str) -> str:
    if each is None:
        return ""
    return form.format(each if isinstance(each, str) else ", ".join(f"{name} {text}" for name, text in each.items()))


_AMOUNT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")
_STANDARD_GRAVITY = re.compile(r"(?<![A-Za-z])[gG](?![A-Za-z0-9])")
_LSB = re.compile(r"(?<![A-Za-z])(?:LSB|digits?)(?![A-Za-z0-9])")
ELECTRICAL = ("V", "A", "C", "ohm", "V/V", "count")
"""Units of uncalibrated readings: voltage, current, charge, resistance, a ratio, steps of a converter."""


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
def si_unit(text: str, dimensions: tuple[str, ...]) -> Amount:
    """One of the unit ``text`` in SI base units; ``dimensions`` are those of what is measured.

    Raises UnitError where the text is no known unit.
    """
    plain = _LSB.sub("count", text.strip())
    if "acceleration" in dimensions:
        plain = _STANDARD_GRAVITY.sub("g0", plain)
    parsed = parse_unit(plain)
    if parsed is None:
        raise UnitError(f"{text!r} is not a known unit")
    base = (1.0 * parsed).to_base_units()
    return Amount(float(base.magnitude), base.units)


def si_amount(text: str, dimensions: tuple[str, ...]) -> Amount:
    """A number with a unit in SI base units. Raises UnitError where it is not finite, or has no known unit."""
    match = _AMOUNT.fullmatch(text)
    if match is None or not match[2]:
        raise UnitError(f"{text!r}: expected a number and a unit, such as '10.2 mV/g'")
    one = si_unit(match[2], dimensions)
    value = float(match[1]) * one.value
    if not math.isfinite(value):
        raise UnitError(f"{text!r} is beyond all bounds")
    return Amount(value, one.units)


def measures_one_of(units: Any, dimensions: tuple[str, ...]) -> bool:  # noqa: ANN401
    """Whether SI base units are those of one of ``dimensions``."""
    return any(units == si_unit(SI_UNITS[d], ()).units for d in dimensions)


def electrical_name(units: Any) -> str | None:  # noqa: ANN401
    """``V``, ``C``, ...: the electrical unit with these SI base units; None where there is none."""
    return next((known for known in ELECTRICAL if units == si_unit(known, ()).units), None)


def unit_of_log(written: str | None, stated: str | None) -> str | None:
    """The unit that a log writes; None where nobody knows it and the rig has ``stated`` another: that one counts."""
    if not written or not stated or is_unit(written):
        return written
    try:
        si_unit(written, ())
    except UnitError:
        return None
    return written


def is_electrical(text: str) -> bool:
    """Whether a unit is one that a sensor writes before it is calibrated, such as V, pC, mV/V or counts."""
    try:
        return electrical_name(si_unit(text, ()).units) is not None
    except UnitError:
        return False


def read_matrix(path: Path) -> list[list[float]]:
    """The rows of a matrix. Cells are separated by commas, tabs, or semicolons (then with decimal commas); # comments.

    Raises RigError, with the line, for a cell that is no number.
    """
    text = read_text(path, RigError).removeprefix("\ufeff")
    lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and line.lstrip()[0] != "#"]
    separator = ";" if ";" in text else "\t" if "\t" in text else ","
    rows = list[list[float]]()
    for number, line in lines:
        rows.append([])
        for cell in next(csv.reader([line], delimiter=separator)):
            try:
                rows[-1].append(float(cell.replace(",", ".") if separator == ";" else cell))
            except ValueError as error:
                raise RigError(
                    f"{path.name}, line {number}: {cell!r} is no number: expected a matrix of numbers alone"
                ) from error
    if not rows:
        raise RigError(f"{path.name}: holds no row of numbers")
    return rows


BASIC_BYTES = 8
_BASIC_FIELDS = (("manufacturer_id", 14), ("model_number", 15), ("version_letter", 5), ("version", 6), ("serial", 24))
"""Of the Basic TEDS of IEEE 1451.4, in bits, least significant first."""
_FIRST_MANUFACTURER = 17


class Teds(Table):
    """Transducer electronic data sheet. It is stored and shown; applied is the sensor's ``calibration`` alone."""

    manufacturer: str | None = None
    """Maker."""
    manufacturer_id: int | None = Field(default=None, ge=_FIRST_MANUFACTURER, lt=1 << 14)
    """Number of the maker."""
    model: str | None = None
    """Model."""
    model_number: int | None = Field(default=None, ge=0, lt=1 << 15)
    """Number of the model."""
    version_letter: str | None = Field(default=None, pattern="^[A-Z]$")
    """Letter of the version."""
    version: int | None = Field(default=None, ge=0, lt=1 << 6)
    """Number of the version."""
    serial: str | None = None
    """Serial number."""
    sensitivity: PerComponent | None = None
    """Sensitivity on the data sheet, such as ``10.2 mV/g``."""
    calibration_date: Day | None = None
    """Day of the calibration."""
    calibration_initials: str | None = Field(default=None, max_length=3)
    """Initials of who calibrated."""
    calibration_period_days: int | None = Field(default=None, ge=0, le=4095)
    """Days until the next calibration."""

    @model_validator(mode="before")
    @classmethod
    def _with_basic(cls, given: Any) -> Any:  # noqa: ANN401
        """``basic``, the 64 bits as a reader prints them in hexadecimal, in place of the fields that they hold."""
        if not isinstance(given, dict) or "basic" not in given:
            return given
        try:
            read = basic_teds(bytes.fromhex(str(given["basic"])))
        except (ValueError, RigError) as error:
            raise ValueError(f"basic = {given['basic']!r}: expected 16 hexadecimal digits: {error}") from error
        rest = {key: value for key, value in given.items() if key != "basic"}
        if twice := sorted(rest.keys() & read.document().keys()):
            raise ValueError(f"{twice[0]} is in basic already: remove one of them")
        return {**read.document(), **rest}

    def document(self) -> dict[str, Any]:
        """The fields that are stated."""
        return self.model_dump(exclude_none=True)


def basic_teds(content: bytes) -> Teds:
    """Read the Basic TEDS: manufacturer, model, version letter (A is 1), version, serial number; least bit first.

    Raises RigError if there are not 64 bits, or all are equal, as of an absent memory.
    """
    if len(content) != BASIC_BYTES:
        raise RigError(f"Basic TEDS: {len(content)} bytes: expected {BASIC_BYTES}")
    if content in {bytes(BASIC_BYTES), b"\xff" * BASIC_BYTES}:
        raise RigError("Basic TEDS: all bits are equal: an empty or absent memory")
    bits, values = int.from_bytes(content, "little"), {}
    for name, width in _BASIC_FIELDS:
        values[name] = bits & ((1 << width) - 1)
        bits >>= width
    letter, maker = values["version_letter"], values["manufacturer_id"]
    if maker < _FIRST_MANUFACTURER or letter > 26:
        raise RigError(f"Basic TEDS: manufacturer {maker}, version letter {letter}: there are no such ones")
    return Teds(
        manufacturer_id=maker,
        model_number=values["model_number"],
        version_letter=chr(ord("A") + letter - 1) if letter else None,
        version=values["version"],
        serial=str(values["serial"]),
    )
