"""Checked access to the tables of a TOML file."""

from collections.abc import Iterable, Mapping
from typing import Any

from ..errors import CounterpoiseError, DataError
from . import expressions
from .expressions import Symbol


def table(value: object, where: str) -> Mapping[str, Any]:
    """A table. Raises DataError for anything else."""
    if not isinstance(value, dict):
        raise DataError(f"{where} is {value!r}: expected a table")
    return value


def entries(content: Mapping[str, Any], key: str, required: bool = True) -> Iterable[tuple[str, Any]]:
    """Names and values of a table. Raises DataError where a required one is missing."""
    if key not in content and required:
        raise DataError(f"{key}: expected at least one table [{key}.NAME]")
    return table(content.get(key, {}), key).items()


def known_keys(content: Mapping[str, Any], known: set[str], where: str) -> None:
    """Raise DataError for a key that is not known."""
    if unknown := [key for key in content if key not in known]:
        raise DataError(f"{where}: unknown key {unknown[0]!r}: expected {', '.join(sorted(known))}")


def needed(content: Mapping[str, Any], key: str, where: str) -> Any:  # noqa: ANN401
    """The value of a key. Raises DataError where it is missing."""
    if key not in content:
        raise DataError(f"{where}: {key} is missing")
    return content[key]


def pair(value: object, where: str) -> tuple[str, str]:
    """Two texts. Raises DataError for anything else."""
    if not (isinstance(value, list) and len(value) == 2 and all(isinstance(text, str) for text in value)):
        raise DataError(f"{where} is {value!r}: expected two texts such as ['L2', '0 m']")
    return value[0], value[1]


def stated(value: object, dimension: str, where: str) -> Symbol:
    """A quantity as written. Raises DataError, naming where, for anything else."""
    if not isinstance(value, str):
        raise DataError(f"{where} is {value!r}: expected a text with a unit")
    try:
        return expressions.symbol(value, dimension)
    except CounterpoiseError as error:
        raise DataError(f"{where}: {error}") from error
