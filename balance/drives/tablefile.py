"""Tables of a load over a turn of the crank, from a CSV file whose header names units: ``angle (deg),force (N)``."""

import math
import re
from pathlib import Path

from .. import csvtable
from ..errors import DataError, UnitError
from ..quantities import factor_to_si

_HEADER = re.compile(r"\s*(\w+)\s*\((.+)\)\s*")


def read(path: Path, key: str, dimension: str) -> tuple[list[float], list[float]]:
    """Angles [rad] and values of the column ``key`` [SI]. Raises DataError, naming line and column."""
    header, rows = csvtable.read(path, "file")
    factors = _factors(header, {"angle": "angle", key: dimension}, path.name)
    columns: dict[str, list[float]] = {name: [] for name in factors}
    for line, row in rows:
        if len(row) != len(factors):
            raise DataError(f"{path.name}, line {line}: {len(row)} cells, the header has {len(factors)}")
        for (name, factor), cell in zip(factors.items(), row, strict=True):
            columns[name].append(factor * _number(cell, f"{path.name}, line {line}: {name}"))
    return columns["angle"], columns[key]


def _factors(header: list[str], wanted: dict[str, str], where: str) -> dict[str, float]:
    """Factor to SI of each column, in the order of the header."""
    expected = f"expected two columns, 'angle (deg),{next(k for k in wanted if k != 'angle')} (unit)'"
    found: dict[str, float] = {}
    for cell in header:
        match = _HEADER.fullmatch(cell)
        if match is None or match[1] not in wanted or match[1] in found:
            raise DataError(f"{where}: column {cell!r}: {expected}")
        try:
            found[match[1]] = factor_to_si(match[2], wanted[match[1]])
        except UnitError as error:
            raise DataError(f"{where}: column {cell!r}: {error}") from error
    if len(found) != len(wanted):
        raise DataError(f"{where}: {len(found)} columns: {expected}")
    return found


def _number(cell: str, where: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DataError(f"{where} is {cell!r}: expected a number")
    return value
