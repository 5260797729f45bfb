"""Keys of a drive file, each checked for kind and unit; what is wrong is named."""

import re
from collections.abc import Collection, Mapping
from typing import Any, TypeVar

from ..errors import DataError, UnitError
from ..quantities import parse

_T = TypeVar("_T")
_TURNING = re.compile(r"rad|deg|°|rev|rpm|turn", re.IGNORECASE)


def refuse_unknown(table: Mapping[str, Any], known: Collection[str]) -> None:
    """Raise DataError for a key that means nothing here."""
    if unknown := [key for key in table if key not in known]:
        raise DataError(f"unknown key {unknown[0]!r}: expected {', '.join(sorted(known))}")


def required(table: Mapping[str, Any], key: str) -> Any:  # noqa: ANN401
    """The value of a key that must be there."""
    if key not in table:
        raise DataError(f"{key} is missing")
    return table[key]


def text(table: Mapping[str, Any], key: str) -> str:
    """A text."""
    value = required(table, key)
    if not isinstance(value, str) or not value.strip():
        raise DataError(f"{key} is {value!r}: expected a text")
    return value


def texts(table: Mapping[str, Any], key: str) -> list[str]:
    """A list of texts, at least one."""
    values = required(table, key)
    if not isinstance(values, list) or not values or not all(isinstance(value, str) for value in values):
        raise DataError(f"{key} is {values!r}: expected a list of texts, each with its unit")
    return list(values)


def table(parent: Mapping[str, Any], key: str, known: Collection[str] | None) -> Mapping[str, Any]:
    """A table; its keys are checked where ``known`` is given."""
    value = required(parent, key)
    if not isinstance(value, dict):
        raise DataError(f"{key} is {value!r}: expected a table [{key}]")
    if known is not None:
        refuse_unknown(value, known)
    return value


def tables(parent: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    """A list of tables, no two of one name; empty where there is none."""
    values = parent.get(key, [])
    if not isinstance(values, list) or not all(isinstance(value, dict) for value in values):
        raise DataError(f"{key} is {values!r}: expected tables [[{key}]]")
    names = [value["name"] for value in values if "name" in value]
    if again := [name for name in names if names.count(name) > 1]:
        raise DataError(f"{key}: {again[0]!r} is there twice: give each a name of its own")
    return values


def quantity(table: Mapping[str, Any], key: str, dimension: str) -> float:
    """A quantity with its unit, in SI."""
    try:
        return parse(text(table, key), dimension)
    except UnitError as error:
        raise DataError(f"{key} = {table[key]!r}: {error}") from error


def quantities(table: Mapping[str, Any], key: str, dimension: str) -> list[float]:
    """Quantities with their units, in SI."""
    try:
        return [parse(value, dimension) for value in texts(table, key)]
    except UnitError as error:
        raise DataError(f"{key}: {error}") from error


def number(table: Mapping[str, Any], key: str) -> float:
    """A number without unit."""
    value = required(table, key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e300:
        raise DataError(f"{key} is {value!r}: expected a number")
    return float(value)


def positive(table: Mapping[str, Any], key: str) -> float:
    """A number above zero, without unit."""
    value = number(table, key)
    if not value > 0.0:
        raise DataError(f"{key} is {value!r}: expected a number above zero")
    return value


def one_of(value: Any, choices: tuple[_T, ...], key: str) -> _T:  # noqa: ANN401
    """One of some choices."""
    if isinstance(value, bool) or value not in choices:
        raise DataError(f"{key} is {value!r}: expected one of {', '.join(map(str, choices))}")
    return choices[choices.index(value)]


def speed(value: str, key: str) -> float:
    """Speed of turning [rad/s]. A unit such as Hz or 1/s does not say whether turns or radians are meant: refused."""
    if not _TURNING.search(value):
        raise DataError(f"{key} is {value!r}: expected a speed of turning, such as '828 rpm' or '8 rad/s'")
    try:
        return parse(value, "angular velocity")
    except UnitError as error:
        raise DataError(f"{key}: {error}") from error
