"""The table [motor] of a drive file."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import DataError
from . import fields
from .motors import Constant, DirectCurrent, Induction, Motor, Table

_KEYS = {
    "induction": {"peak_torque", "peak_slip", "a", "b", "synchronous_speed", "slip_base", "braking"},
    "dc": {"stall_torque", "no_load_speed"},
    "constant": {"torque"},
    "table": {"speed", "torque"},
}


def read(table: Mapping[str, Any]) -> Motor:
    """The motor that a table describes. Raises DataError, naming the key that is wrong."""
    kind = fields.one_of(fields.required(table, "kind"), tuple(_KEYS), "motor.kind")
    try:
        fields.refuse_unknown(table, {"kind", *_KEYS[kind]})
        return {"induction": _induction, "dc": _direct_current, "constant": _constant, "table": _table}[kind](table)
    except DataError as error:
        raise DataError(f"motor.{error}") from error


def _induction(table: Mapping[str, Any]) -> Motor:
    zero = fields.text(table, "synchronous_speed")
    braking = fields.one_of(table.get("braking", "as printed"), ("as printed", "mirrored"), "braking")
    return Induction(
        _above_zero(table, "peak_torque"),
        fields.positive(table, "peak_slip"),
        fields.number(table, "a"),
        fields.number(table, "b"),
        None if zero == "nominal" else fields.speed(zero, "synchronous_speed"),
        fields.speed(fields.text(table, "slip_base"), "slip_base") if "slip_base" in table else None,
        braking == "mirrored",
    )


def _direct_current(table: Mapping[str, Any]) -> Motor:
    speed = fields.speed(fields.text(table, "no_load_speed"), "no_load_speed")
    if not speed > 0.0:
        raise DataError(f"no_load_speed is {table['no_load_speed']!r}: expected one above zero")
    return DirectCurrent(_above_zero(table, "stall_torque"), speed)


def _constant(table: Mapping[str, Any]) -> Motor:
    return Constant(fields.quantity(table, "torque", "moment"))


def _table(table: Mapping[str, Any]) -> Motor:
    speeds = [fields.speed(value, "speed") for value in fields.texts(table, "speed")]
    torques = fields.quantities(table, "torque", "moment")
    if len(speeds) != len(torques) or len(speeds) < 2 or not (np.diff(speeds) > 0.0).all():
        raise DataError(f"speed has {len(speeds)}, torque {len(torques)} values: expected as many, speeds increasing")
    return Table.of(np.array(speeds), np.array(torques))


def _above_zero(table: Mapping[str, Any], key: str) -> float:
    value = fields.quantity(table, key, "moment")
    if not value > 0.0:
        raise DataError(f"{key} is {table[key]!r}: expected one above zero")
    return value
