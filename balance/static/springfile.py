"""Spring files (``datasets/springs``): places for springs of zero free length, stiffnesses given or to be found."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .. import datasets
from ..errors import CounterpoiseError, DataError
from ..mechanism import Mechanism
from ..quantities import parse
from .springs import End, Spring

_LIKE = "{ body = 'base', at = ['0 m', '0.1 m', '0 m'] }"


def load(name: str | Path, mechanism: Mechanism) -> tuple[list[Spring], bool]:
    """Springs of a file, and whether it gives their stiffnesses; otherwise they are 1 N/m, to be found.

    Raises DataError, naming the spring and key that is wrong.
    """
    path = datasets.find(name, "springs", ".toml")
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        entries = table.get("spring")
        if set(table) != {"spring"} or not isinstance(entries, list) or not entries:
            raise DataError("expected tables [[spring]] and nothing else")
        springs = [_spring(entry, mechanism, k) for k, entry in enumerate(entries, 1)]
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, CounterpoiseError) as error:
        raise DataError(f"{path.name}: {error}") from error
    given = ["stiffness" in entry for entry in entries]
    if any(given) and not all(given):
        raise DataError(f"{path.name}: spring {given.index(False) + 1} has no stiffness; give all or none")
    return springs, all(given)


def _spring(table: Any, mechanism: Mechanism, number: int) -> Spring:  # noqa: ANN401
    if not isinstance(table, dict):
        raise DataError(f"spring {number} is {table!r}: expected a table")
    name = str(table.get("name", f"spring {number}"))
    try:
        if unknown := set(table) - {"name", "first", "second", "stiffness"}:
            raise DataError(f"unknown key {min(unknown)!r}: expected name, first, second, stiffness")
        stiffness = parse(str(table["stiffness"]), "stiffness") if "stiffness" in table else 1.0
        if not stiffness > 0.0:
            raise DataError(f"stiffness is {table['stiffness']!r}: expected one above zero")
        return Spring(_end(table, "first", mechanism), _end(table, "second", mechanism), stiffness, name)
    except CounterpoiseError as error:
        raise DataError(f"{name}: {error}") from error


def _end(table: Mapping[str, Any], key: str, mechanism: Mechanism) -> End:
    if key not in table:
        raise DataError(f"{key} is missing: expected {key} = {_LIKE}")
    end = table[key]
    if not isinstance(end, dict) or not isinstance(end.get("body"), str) or set(end) - {"body", "at"}:
        raise DataError(f"{key} is {end!r}: expected {_LIKE}")
    at = end.get("at", ["0 m"] * 3)
    if not isinstance(at, list) or len(at) != 3 or not all(isinstance(x, str) for x in at):
        raise DataError(f"{key}.at is {at!r}: expected three lengths, such as ['0 m', '0.1 m', '0 m']")
    body = -1 if end["body"] == "base" else mechanism.body_index(end["body"])
    return End(body, np.array([parse(x, "length") for x in at]))
