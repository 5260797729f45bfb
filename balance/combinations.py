"""Linear combinations of inertial parameters: the space that rows span, its reduced row echelon form, as text."""

from collections.abc import Mapping, Sequence

import numpy as np

from .arrays import Floats
from .errors import ModelError

GAP = 1e6
"""Ratio between the smallest kept and the largest dropped singular value that decides a rank."""
_ZERO = 1e-9
"""Coefficients below this are rounding of the elimination [m, or none]."""


def row_space(matrix: Floats, name: str) -> tuple[Floats, tuple[float, float]]:
    """Orthonormal basis of the row space, and the singular values next to where it was cut.

    Raises ModelError if no gap of at least GAP tells the kept from the dropped.
    """
    _, values, rows = np.linalg.svd(matrix, full_matrices=False)
    values = values / np.sqrt(len(matrix))
    if not values[0] > 0.0:
        return rows[:0], (0.0, 0.0)
    floor = np.maximum(values, np.finfo(float).eps * values[0])
    ratios = floor[:-1] / floor[1:]
    rank = int(np.argmax(ratios)) + 1 if len(ratios) and ratios.max() >= GAP else len(values)
    if rank == len(values) and values[-1] < values[0] / GAP:
        raise ModelError(f"{name}: the rank of its momentum cannot be decided (singular values {values})")
    return rows[:rank], (float(values[rank - 1]), float(values[rank]) if rank < len(values) else 0.0)


def echelon(basis: Floats, order: Sequence[int]) -> Floats:
    """Reduced row echelon form of ``basis`` with pivots taken in the given order of columns."""
    matrix, row = basis.copy(), 0
    for column in order:
        if row == len(matrix):
            break
        best = row + int(np.argmax(np.abs(matrix[row:, column])))
        if abs(matrix[best, column]) < _ZERO:
            continue
        matrix[[row, best]] = matrix[[best, row]]
        matrix[row] /= matrix[row, column]
        others = np.arange(len(matrix)) != row
        matrix[others] -= np.outer(matrix[others, column], matrix[row])
        row += 1
    matrix[np.abs(matrix) < _ZERO] = 0.0
    return matrix


def text_of(coefficients: Mapping[str, float]) -> str:
    """A combination as a sum, such as ``mcx[A0A] + 0.15 m[AC]``."""
    terms: list[str] = []
    for name, value in coefficients.items():
        size = "" if abs(abs(value) - 1.0) < 1e-12 else f"{abs(value):.6g} "
        sign = ("- " if value < 0 else "+ ") if terms else ("-" if value < 0 else "")
        terms.append(f"{sign}{size}{name}")
    return " ".join(terms) or "0"
