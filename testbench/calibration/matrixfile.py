"""The matrix of a multi-axis sensor from a CSV: a row a component, a column a channel, numbers alone."""

import csv
from pathlib import Path

from ..errors import RigError


def read(path: Path) -> list[list[float]]:
    """The rows of a matrix. Separated by commas, tabs or, with decimal commas allowed, by semicolons; # is a comment.

    Raises RigError, with the line, for a cell that is no number.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except IsADirectoryError as error:
        raise RigError(f"{path}: is a folder; expected a CSV file of the matrix, a row a component") from error
    except (OSError, UnicodeDecodeError) as error:
        raise RigError(f"{path.name}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and line.lstrip()[0] != "#"]
    separator = ";" if ";" in text else "\t" if "\t" in text else ","
    rows = [
        [_number(path, number, cell, separator) for cell in next(csv.reader([line], delimiter=separator))]
        for number, line in lines
    ]
    if not rows:
        raise RigError(f"{path.name}: holds no row of numbers")
    return rows


def _number(path: Path, line: int, cell: str, separator: str) -> float:
    text = cell.strip()
    try:
        return float(text.replace(",", ".") if separator == ";" else text)
    except ValueError as error:
        raise RigError(
            f"{path.name}, line {line}: {cell!r} is no number: expected a matrix of numbers alone"
        ) from error
