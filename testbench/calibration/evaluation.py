"""From readings to SI by a calibration: a polynomial for each channel, then a matrix for all channels of the sensor.

Units are never guessed: those of the reading, the sensitivity and the amplifier must give the unit of what the sensor
measures exactly.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from balance.arrays import Floats
from balance.errors import UnitError
from balance.results import Key
from balance.units import SI_UNITS, factor_to_si

from .. import units as unit_names
from .definition import (
    Amount,
    Calibration,
    component_keys,
    electrical_name,
    entry_of_component,
    measures_one_of,
    si_amount,
    si_unit,
    unit_of_log,
)

WORST_CONDITION = 1e8
"""Largest condition number of a matrix whose rows still distinguish the loads."""


@dataclass(frozen=True)
class Column:
    """A channel: which component of which sensor, in which unit the logger writes it. Everything else in SI."""

    channel: Annotated[str, Key()]
    """Its name as in the log, with the unit in brackets or without."""
    sensor: Annotated[str, Key()]
    component: Annotated[str, Key()]
    """``x``, ``Fz``, ``Mx``, or the joint."""
    logger: str
    unit: str
    """Of the log; empty where the rig states none."""
    dimensions: tuple[str, ...]
    """Quantities that it may measure, such as ("angle", "length")."""
    range: float | None = None
    """Largest absolute value that the sensor gives [SI]."""
    noise: float = 0.0
    """Standard deviation of one sample [SI]."""
    resolution: float = 0.0
    """Step between two values [SI]."""
    commanded: bool = False
    """Computed by the controller and not measured: flat tops and constant values are no fault of it."""
    level: bool = True
    """Whether its values count; of a trigger the instants of its edges alone do."""
    stated: bool = True
    """Whether the rig states the unit, rather than the usual one of the kind being taken."""
    calibration: Calibration | None = None
    """Of the sensor by the rig; a later record of the campaign takes precedence."""
    crosstalk: tuple[tuple[float, ...], ...] | None = None
    """Of the sensor: readings = crosstalk @ loads, in SI."""
    delay: float = 0.0
    """Delay of its logger's filter at low frequencies [s]; zero where the rig states no filter."""
    siblings: "tuple[Column, ...]" = ()
    """All channels of the sensor in the order of the rig, this one among them."""

    @property
    def total_noise(self) -> float:
        """Standard deviation of one sample [SI], a resolution of q counted as noise of q^2 / 12."""
        return float(np.hypot(self.noise, self.resolution / np.sqrt(12.0)))

    @property
    def index(self) -> int:
        """Which of the sensor's channels it is."""
        return [s.channel for s in self.siblings].index(self.channel)

    @property
    def assumed_unit(self) -> str:
        """Unit in which its logger is taken to write: that of the rig, else that of SI, as the log would state it."""
        return self.unit if self.unit or self.calibration is not None else SI_UNITS[self.dimensions[0]]

    def written(self, values: Floats) -> Floats:
        """Values (n,) [SI] in the unit of the log, (n,). Raises UnitError where the calibration cannot be inverted."""
        if self.calibration is None:
            return values / factor_to_si(self.assumed_unit, *self.dimensions)
        units = [s.unit or self.calibration.unit or "" for s in self.siblings]
        if not all(units):
            raise UnitError(
                f"sensors.{self.sensor}: no unit in which its logger writes: state sensors.{self.sensor}.unit"
            )
        return bind_law(self.calibration, self.siblings, units).written(self.index, values)

    def written_range(self, unit: str) -> float | None:
        """Range in ``unit``, that of the log; None where it is not known, or not symmetric."""
        if self.range is None or not unit:
            return None
        try:
            column = self if self.calibration is not None else replace(self, unit=unit)
            ends = column.written(np.array([-self.range, self.range]))
        except UnitError:
            return None
        return abs(float(ends[1])) if float(ends[0]) == -float(ends[1]) else None


@dataclass(frozen=True)
class CalibrationLaw:
    """From the readings of one sensor's channels, in the unit of the log, to its components in SI."""

    polynomials: tuple[tuple[float, ...], ...]
    """Coefficients of each channel, the constant first."""
    matrix: Floats | None = None
    """Components from the polynomials' values, (k, k); None: each channel is one component."""

    def component(self, index: int, written: Callable[[int], Floats]) -> Floats:
        """One component, (n,) [SI]; ``written`` gives channel i as the logger wrote it, (n,) [its unit]."""
        if self.matrix is None:
            return _value(self.polynomials[index], written(index))
        readings = [_value(c, written(i)) for i, c in enumerate(self.polynomials)]
        return np.asarray(np.einsum("j,jn->n", self.matrix[index], np.stack(readings)))

    def written(self, index: int, values: Floats) -> Floats:
        """Readings (n,) [unit of the log] of a component (n,) [SI]. Raises UnitError but for a straight line."""
        line = self.polynomials[index]
        if self.matrix is not None or len(line) != 2:
            raise UnitError("only a calibration by sensitivity and offset can be inverted")
        return (values - line[0]) / line[1]


def _value(coefficients: tuple[float, ...], x: Floats) -> Floats:
    if len(coefficients) == 2 and coefficients[0] == 0.0:
        return x * coefficients[1]
    return np.asarray(np.polynomial.polynomial.polyval(x, coefficients))


def check_law(calibration: Calibration, channels: Sequence[Column]) -> None:
    """Raise UnitError for keys that name no component, or a matrix of another size."""
    components = [channel.component for channel in channels]
    known = {name for component in components for name in component_keys(component)}
    stated = calibration.uncertainty
    texts = {name: getattr(calibration, name) for name in ("sensitivity", "amplifier", "offset", "polynomial")}
    texts["uncertainty"] = None if stated is None else stated.standard or stated.expanded
    for field, given in texts.items():
        if not isinstance(given, dict):
            continue
        if wrong := [name for name in given if name not in known]:
            raise UnitError(f"{field}: the sensor has no component {wrong[0]!r}: expected {', '.join(components)}")
        missing = [c for c in components if entry_of_component(given, c) is None]
        if field not in ("offset", "uncertainty") and missing:
            raise UnitError(f"{field}: is missing for {missing[0]}")
    if calibration.matrix is not None:
        rows, size = calibration.matrix.rows, len(components)
        if len(rows) != size or any(len(row) != size for row in rows):
            shape = f"{len(rows)} rows of {sorted({len(row) for row in rows})} numbers"
            raise UnitError(f"matrix: {shape}: expected {size} rows of {size}, for {', '.join(components)}")
        scaled = np.array(rows) / np.maximum(np.abs(rows).max(axis=1, keepdims=True), 1e-300)
        if not np.linalg.cond(scaled) < WORST_CONDITION:
            raise UnitError(
                "matrix: its rows depend on each other, so that loads cannot be distinguished: check its rows"
            )
    if calibration.uncertainty is not None:
        for channel in channels:
            relative_uncertainty(calibration, channel)


def relative_uncertainty(calibration: Calibration, channel: Column) -> float | None:
    """Standard uncertainty of a channel's sensitivity, as a share of it; None where none is stated for it.

    Raises UnitError for one that is neither a share nor in the unit of the sensitivity.
    """
    stated = calibration.uncertainty
    if stated is None:
        return None
    text = entry_of_component(stated.standard or stated.expanded, channel.component)
    if text is None:
        return None
    size = si_amount(text, channel.dimensions)
    sensitivity = entry_of_component(calibration.sensitivity, channel.component)
    whole = si_unit("V/V", ()) if sensitivity is None else si_amount(sensitivity, channel.dimensions)
    share = size if size.units == si_unit("V/V", ()).units else size / whole
    if share.units != si_unit("V/V", ()).units:
        raise UnitError(
            f"uncertainty {text!r} of {channel.component}: expected a share such as '0.5 %'"
            + ("" if sensitivity is None else f", or the unit of the sensitivity {sensitivity!r}")
        )
    relative = abs(share.value) / (stated.coverage_factor or 1.0)
    if not relative < 1.0:
        raise UnitError(f"uncertainty {text!r} of {channel.component}: expected less than the sensitivity itself")
    return relative


def bind_law(calibration: Calibration, channels: Sequence[Column], units: Sequence[str]) -> CalibrationLaw:
    """The law for channels written in ``units``. Raises UnitError if it does not give the unit of what is measured."""
    check_law(calibration, channels)
    written, matrix = list(zip(channels, units, strict=True)), calibration.matrix
    if matrix is None:
        return CalibrationLaw(tuple(_channel_polynomial(calibration, channel, unit) for channel, unit in written))
    lines, out = [], []
    for channel, unit in written:
        step = _step(channel, unit, matrix.raw, "matrix")
        text = entry_of_component(matrix.physical, channel.component)
        if text is None:
            raise UnitError(f"matrix: physical: no unit for {channel.component}")
        given = si_unit(text, channel.dimensions)
        if not measures_one_of(given.units, channel.dimensions):
            raise UnitError(f"matrix: {text!r} for {channel.component} is no {_quantity_text(channel.dimensions)}")
        raw_offset, physical_offset = _offset(calibration, channel, si_unit(unit, channel.dimensions))
        if physical_offset:
            raise UnitError(f"{channel.component}: an offset before a matrix is in the unit of the log")
        lines.append((-raw_offset / si_unit(matrix.raw, channel.dimensions).value, step))
        out.append(given.value)
    return CalibrationLaw(tuple(lines), np.array(matrix.rows) * np.array(out)[:, None])


def _step(channel: Column, written: str, taken: str, what: str) -> float:
    """One of the unit of the log in the unit that is ``taken`` by a polynomial or matrix."""
    raw, into = si_unit(written, channel.dimensions), si_unit(taken, channel.dimensions)
    if raw.units != into.units:
        raise UnitError(
            f"{channel.component}: the {what} takes {taken!r}, the channel is in {written!r}"
            f"{_already_physical(channel, written)}"
        )
    return raw.value / into.value


def bind_sensor(calibration: Calibration, channels: Sequence[Column], written: Sequence[str | None]) -> CalibrationLaw:
    """The law of a sensor whose log states these units, None where it states none.

    Raises UnitError where a unit is missing, contradicts the rig or does not lead to what the sensor measures.
    """
    return bind_law(
        calibration, channels, [_unit_of_log(c, calibration, w) for c, w in zip(channels, written, strict=True)]
    )


def _unit_of_log(channel: Column, calibration: Calibration, written: str | None) -> str:
    """The unit of a channel: of the log, the calibration or the rig, which must not contradict each other."""
    rig = channel.unit if channel.stated else None
    written = unit_of_log(written, rig or calibration.unit)
    stated = {"its log": written, "the calibration": calibration.unit, "the rig": rig}
    given = [(who, name) for who, name in stated.items() if name]
    for who, name in given[1:]:
        if not unit_names.same_unit(given[0][1], name):
            found = f"{given[0][1]!r} by {given[0][0]} and in {name!r} by {who}"
            raise UnitError(f"channel {channel.channel!r} is in {found}: correct one")
    if given:
        return given[0][1]
    if channel.unit and not calibration.scales:
        return channel.unit  # an offset alone leaves the usual unit of the kind
    raise UnitError(
        f"channel {channel.channel!r} has no unit, neither in its log nor in the rig: state "
        f"sensors.{channel.sensor}.unit, or the unit of the calibration"
    )


def _channel_polynomial(calibration: Calibration, channel: Column, written: str) -> tuple[float, ...]:
    """Coefficients from the unit of the log to SI: of its polynomial, else of sensitivity and offset."""
    dimensions, component = channel.dimensions, channel.component
    raw, wanted = si_unit(written, dimensions), _quantity_text(dimensions)
    polynomial = entry_of_component(calibration.polynomial, component)
    if polynomial is not None:
        out, step = si_unit(polynomial.physical, dimensions), _step(channel, written, polynomial.raw, "polynomial")
        if not measures_one_of(out.units, dimensions):
            raise UnitError(f"{component}: the polynomial gives {polynomial.physical!r}, no {wanted}")
        return tuple(c * step**i * out.value for i, c in enumerate(polynomial.coefficients))
    sensitivity, text = _sensitivity(calibration, channel, raw)
    found = raw / sensitivity
    if not measures_one_of(found.units, dimensions):
        takes = electrical_name(sensitivity.units * si_unit(SI_UNITS[dimensions[0]], ()).units)
        if text and takes and takes != written:
            mismatch = f"a sensitivity of {text}takes a log in {takes}, this one is in {written!r}"
            mismatch += _already_physical(channel, written)
        else:
            mismatch = (
                f"{written!r} {f'by {text}' if text else 'without a sensitivity '}is no {wanted}: a unit is wrong"
            )
        raise UnitError(f"{component}: {mismatch}")
    raw_offset, physical_offset = _offset(calibration, channel, raw)
    return (-raw_offset / sensitivity.value - physical_offset, found.value)


def _sensitivity(calibration: Calibration, channel: Column, raw: Amount) -> tuple[Amount, str]:
    """Reading for one SI unit of the quantity, and its text as stated."""
    text = entry_of_component(calibration.sensitivity, channel.component)
    if text is None:
        return si_unit("V/V", ()), ""
    sensitivity = si_amount(text, channel.dimensions)
    if sensitivity.value == 0.0:
        raise UnitError(f"sensitivity {text!r}: expected one that is not zero")
    behind = entry_of_component(calibration.amplifier, channel.component)
    if behind is None:
        return sensitivity, f"{text!r} "
    gain = si_amount(behind, channel.dimensions)
    if not gain.value > 0.0:
        raise UnitError(f"amplifier {behind!r}: expected one that is positive")
    both = (
        sensitivity * gain
        if measures_one_of((raw / (sensitivity * gain)).units, channel.dimensions)
        else sensitivity / gain
    )
    return both, f"{text!r} and {behind!r} "


def _offset(calibration: Calibration, channel: Column, raw: Amount) -> tuple[float, float]:
    """What to subtract before and after the sensitivity [SI], by the unit in which the offset is stated."""
    text = entry_of_component(calibration.offset, channel.component)
    if text is None:
        return 0.0, 0.0
    offset = si_amount(text, channel.dimensions)
    if measures_one_of(offset.units, channel.dimensions) and offset.units != raw.units:
        return 0.0, offset.value
    if offset.units == raw.units:
        return offset.value, 0.0
    wanted = _quantity_text(channel.dimensions)
    raise UnitError(f"{channel.component}: offset {text!r} is neither in the log's unit nor a {wanted}")


def _already_physical(channel: Column, written: str) -> str:
    """What to do where a log is in physical units already."""
    if not measures_one_of(si_unit(written, channel.dimensions).units, channel.dimensions):
        return ""
    per = written if written.isalpha() else f"({written})"
    return (
        f", which is {_quantity_text(channel.dimensions)} already: leave this out, or rescale by a sensitivity such "
        f"as '1.02 {written}/{per}' where it shows 2 % too much, or by an offset alone such as '0.01 {written}'"
    )


def _quantity_text(dimensions: tuple[str, ...]) -> str:
    return " or ".join(f"{d} ({SI_UNITS[d]})" for d in dimensions)
