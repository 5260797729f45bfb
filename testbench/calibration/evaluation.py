"""The arithmetic of a calibration, once the unit of each channel is known: a polynomial a channel, then a matrix."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from balance.arrays import Floats
from balance.errors import UnitError
from balance.units import SI_UNITS

from .. import units as unit_names
from .definition import Amount, Calibration, Polynomial, amount, electrical_name, measures, names_of, of_component, unit

WORST_CONDITION = 1e8
"""Of a matrix: beyond, its rows tell one load from another no more."""


class Channel(Protocol):
    """What must be known of a channel of a sensor."""

    @property
    def component(self) -> str:
        """``x``, ``Fz``, or the joint."""
        ...

    @property
    def dimensions(self) -> tuple[str, ...]:
        """What it may measure, such as ("angle", "length")."""
        ...


class LoggedChannel(Channel, Protocol):
    """What must be known of a channel besides, to tell the unit in which its logger writes."""

    @property
    def channel(self) -> str:
        """Its name in the log."""
        ...

    @property
    def sensor(self) -> str:
        """Its sensor's name in the rig."""
        ...

    @property
    def unit(self) -> str:
        """By the rig; empty where it does not say."""
        ...

    @property
    def stated(self) -> bool:
        """Whether the rig states the unit, and it is not the usual one of the kind."""
        ...


@dataclass(frozen=True)
class Law:
    """From the channels of one sensor as written to its components in SI.

    ``polynomials`` hold the coefficients, in the unit as written, of each channel; ``matrix`` (k, k) comes after.
    """

    polynomials: tuple[tuple[float, ...], ...]
    matrix: Floats | None = None

    def component(self, index: int, written: Callable[[int], Floats]) -> Floats:
        """One component (n,) [SI]; ``written`` gives channel i as the logger wrote it, (n,)."""
        if self.matrix is None:
            return _value(self.polynomials[index], written(index))
        readings = [_value(c, written(i)) for i, c in enumerate(self.polynomials)]
        return np.asarray(np.einsum("j,jn->n", self.matrix[index], np.stack(readings)))

    def written(self, index: int, values: Floats) -> Floats:
        """What a logger writes of a component (n,) [SI]; of a straight line only. Raises UnitError otherwise."""
        line = self.polynomials[index]
        if self.matrix is not None or len(line) != 2:
            raise UnitError("only a calibration by sensitivity and offset can be turned round")
        return (values - line[0]) / line[1]


def _value(coefficients: tuple[float, ...], x: Floats) -> Floats:
    if len(coefficients) == 2 and coefficients[0] == 0.0:
        return x * coefficients[1]
    return np.asarray(np.polynomial.polynomial.polyval(x, coefficients))


def check_law(calibration: Calibration, channels: Sequence[Channel]) -> None:
    """What is wrong whatever the unit of the log: keys that name no component, a matrix of another size."""
    components = [channel.component for channel in channels]
    known = {name for component in components for name in names_of(component)}
    for field in ("sensitivity", "amplifier", "offset", "polynomial"):
        given = getattr(calibration, field)
        if not isinstance(given, dict):
            continue
        if wrong := [name for name in given if name not in known]:
            raise UnitError(f"{field}: the sensor has no component {wrong[0]!r}: expected {', '.join(components)}")
        if field != "offset" and (left := [c for c in components if of_component(given, c) is None]):
            raise UnitError(f"{field}: is missing for {left[0]}")
    if calibration.matrix is not None:
        _check_matrix(calibration.matrix.rows, components)


def _check_matrix(rows: Sequence[Sequence[float]], components: Sequence[str]) -> None:
    size = len(components)
    if len(rows) != size or any(len(row) != size for row in rows):
        shape = f"{len(rows)} rows of {sorted({len(row) for row in rows})} numbers"
        raise UnitError(f"matrix: {shape}: expected {size} rows of {size}, for {', '.join(components)}")
    scaled = np.array(rows) / np.maximum(np.abs(rows).max(axis=1, keepdims=True), 1e-300)
    if not np.linalg.cond(scaled) < WORST_CONDITION:
        raise UnitError("matrix: its rows depend on each other, so that loads cannot be told apart")


def bind_law(calibration: Calibration, channels: Sequence[Channel], units: Sequence[str]) -> Law:
    """The law for channels written in ``units``. Raises UnitError if the calibration does not lead to what is measured.

    No guess: the units of raw value, sensitivity and amplifier must give those of the quantity exactly.
    """
    check_law(calibration, channels)
    if calibration.matrix is not None:
        return _matrix(calibration, channels, units)
    return Law(tuple(_channel(calibration, c, u) for c, u in zip(channels, units, strict=True)))


def bind_sensor(calibration: Calibration, channels: Sequence[LoggedChannel], written: Sequence[str | None]) -> Law:
    """The law of a sensor whose log writes these units, None where it writes none.

    Raises UnitError where a unit is missing, contradicts the rig or does not lead to what the sensor measures.
    """
    return bind_law(
        calibration, channels, [_raw_unit(c, calibration, w) for c, w in zip(channels, written, strict=True)]
    )


def _raw_unit(channel: LoggedChannel, calibration: Calibration, written: str | None) -> str:
    """The unit of a channel: of the log, the calibration or the rig, which must not contradict each other."""
    rig = channel.unit if channel.stated else None
    stated = {"its log": written, "the calibration": calibration.unit, "the rig": rig}
    given = [(who, name) for who, name in stated.items() if name]
    for who, name in given[1:]:
        if not unit_names.same_unit(given[0][1], name):
            found = f"{given[0][1]!r} by {given[0][0]} and in {name!r} by {who}"
            raise UnitError(f"channel {channel.channel!r} is in {found}: correct one")
    if given:
        return given[0][1]
    scaled = (calibration.sensitivity, calibration.polynomial, calibration.matrix) != (None, None, None)
    if channel.unit and not scaled:
        return channel.unit  # an offset alone leaves the usual unit of the kind
    raise UnitError(
        f"channel {channel.channel!r} has no unit, neither in its log nor in the rig: say "
        f"sensors.{channel.sensor}.unit, or the unit of the calibration"
    )


def _channel(calibration: Calibration, channel: Channel, written: str) -> tuple[float, ...]:
    dimensions, component = channel.dimensions, channel.component
    raw = unit(written, dimensions)
    polynomial = of_component(calibration.polynomial, component)
    if polynomial is not None:
        return _polynomial(polynomial, channel, written)
    per, text = _sensitivity(calibration, channel, raw)
    found = raw / per
    if not measures(found.units, dimensions):
        raise UnitError(f"{component}: {_mismatch(channel, written, per, text)}")
    before, after = _offset(calibration, channel, raw)
    return (-before / per.value - after, found.value)


def _sensitivity(calibration: Calibration, channel: Channel, raw: Amount) -> tuple[Amount, str]:
    """Raw value of one SI unit of the quantity, and how it was given."""
    text = of_component(calibration.sensitivity, channel.component)
    if text is None:
        return unit("V/V", ()), ""
    per = amount(text, channel.dimensions)
    if per.value == 0.0:
        raise UnitError(f"sensitivity {text!r}: expected one that is not zero")
    behind = of_component(calibration.amplifier, channel.component)
    if behind is None:
        return per, f"{text!r} "
    gain = amount(behind, channel.dimensions)
    if not gain.value > 0.0:
        raise UnitError(f"amplifier {behind!r}: expected one that is positive")
    both = per * gain if measures((raw / (per * gain)).units, channel.dimensions) else per / gain
    return both, f"{text!r} and {behind!r} "


def _offset(calibration: Calibration, channel: Channel, raw: Amount) -> tuple[float, float]:
    """What to subtract before and after the sensitivity [SI]: by the unit that it is given in."""
    text = of_component(calibration.offset, channel.component)
    if text is None:
        return 0.0, 0.0
    offset = amount(text, channel.dimensions)
    if measures(offset.units, channel.dimensions) and offset.units != raw.units:
        return 0.0, offset.value
    if offset.units == raw.units:
        return offset.value, 0.0
    wanted = _wanted(channel.dimensions)
    raise UnitError(f"{channel.component}: offset {text!r} is neither in the log's unit nor a {wanted}")


def _polynomial(found: Polynomial, channel: Channel, written: str) -> tuple[float, ...]:
    raw, into = unit(written, channel.dimensions), unit(found.raw, channel.dimensions)
    out, wanted = unit(found.physical, channel.dimensions), _wanted(channel.dimensions)
    if raw.units != into.units:
        taken = f"the polynomial takes {found.raw!r}, the channel is in {written!r}"
        raise UnitError(f"{channel.component}: {taken}{_already(channel, written)}")
    if not measures(out.units, channel.dimensions):
        raise UnitError(f"{channel.component}: the polynomial gives {found.physical!r}, no {wanted}")
    step = raw.value / into.value
    return tuple(c * step**i * out.value for i, c in enumerate(found.coefficients))


def _matrix(calibration: Calibration, channels: Sequence[Channel], units: Sequence[str]) -> Law:
    assert calibration.matrix is not None
    matrix, lines, out = calibration.matrix, [], []
    for channel, written in zip(channels, units, strict=True):
        raw, into = unit(written, channel.dimensions), unit(matrix.raw, channel.dimensions)
        if raw.units != into.units:
            taken = f"the matrix takes {matrix.raw!r}, the channel is in {written!r}"
            raise UnitError(f"{channel.component}: {taken}{_already(channel, written)}")
        text = of_component(matrix.physical, channel.component)
        if text is None:
            raise UnitError(f"matrix: physical: no unit for {channel.component}")
        given = unit(text, channel.dimensions)
        if not measures(given.units, channel.dimensions):
            raise UnitError(f"matrix: {text!r} for {channel.component} is no {_wanted(channel.dimensions)}")
        before, after = _offset(calibration, channel, raw)
        if after:
            raise UnitError(f"{channel.component}: an offset before a matrix is in the unit of the log")
        lines.append((-before / into.value, raw.value / into.value))
        out.append(given.value)
    return Law(tuple(lines), np.array(matrix.rows) * np.array(out)[:, None])


def _mismatch(channel: Channel, written: str, per: Amount, text: str) -> str:
    """Why a channel in the unit ``written`` and a sensitivity do not give what is measured, and what would."""
    takes = electrical_name(per.units * unit(SI_UNITS[channel.dimensions[0]], ()).units)
    if text and takes and takes != written:
        return f"a sensitivity of {text}takes a log in {takes}, this one is in {written!r}{_already(channel, written)}"
    by = f"by {text}" if text else "without a sensitivity "
    return f"{written!r} {by}is no {_wanted(channel.dimensions)}: a unit is wrong"


def _already(channel: Channel, written: str) -> str:
    """What to do where a log is in physical units already."""
    if not measures(unit(written, channel.dimensions).units, channel.dimensions):
        return ""
    per = written if written.isalpha() else f"({written})"
    return (
        f", which is {_wanted(channel.dimensions)} already: leave this out, or rescale by a sensitivity such "
        f"as '1.02 {written}/{per}' where it shows 2 % too much, or by an offset alone such as '0.01 {written}'"
    )


def _wanted(dimensions: tuple[str, ...]) -> str:
    return " or ".join(f"{d} ({SI_UNITS[d]})" for d in dimensions)
