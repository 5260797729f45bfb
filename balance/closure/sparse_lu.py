"""Small systems of linear equations, thousands at once, by component: what is zero for all samples costs nothing.

Gauss's elimination in one order of pivots for all samples, chosen on a few of them: among entries that are not small,
the one that fills in least (H. M. Markowitz, 1957). Loop equations are sparse, so this is some twenty times faster than
a dense solver sample by sample. Rows beyond the number of columns depend on the others: they are not used.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..mechanism.sparse_components import Entry, Rows, mul, sub

Order = tuple[tuple[int, int], ...]
"""Pivots in turn: row and column."""
_THRESHOLD = 0.1
"""A pivot is at least this share of the largest remaining entry of its column, at every sample that it is chosen on."""


def is_zero(entry: Entry) -> bool:
    """Whether an entry is zero for all samples."""
    return isinstance(entry, float) and entry == 0.0


def dense_at_samples(rows: Rows, samples: Floats) -> Floats:
    """The matrices (k, rows, columns), in SI, at the samples of indices ``samples`` (k,)."""
    matrix = np.zeros((len(samples), len(rows), len(rows[0])))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            matrix[:, i, j] = entry if isinstance(entry, float) else entry[samples]
    return matrix


def pivot_order(matrices: Floats) -> Order:
    """Pivots for ``matrices`` (k, rows, columns), in SI: as many as columns, each in a row of its own."""
    reduced, order = matrices.copy(), []
    rows, columns = list(range(reduced.shape[1])), list(range(reduced.shape[2]))
    while columns:
        part = reduced[:, rows][:, :, columns]
        share = np.abs(part) / np.maximum(np.abs(part).max(axis=1, keepdims=True), 1e-300)
        least, filled = share.min(axis=0), (part != 0.0).any(axis=0)
        cost = np.outer(filled.sum(axis=1) - 1, filled.sum(axis=0) - 1).astype(float)
        cost[least < _THRESHOLD] = np.inf
        best = np.argmin(cost - 1e-3 * least) if np.isfinite(cost).any() else np.argmax(least)
        i, j = (int(x) for x in np.unravel_index(best, least.shape))
        row, column = rows.pop(i), columns.pop(j)
        order.append((row, column))
        pivot = reduced[:, row, column]
        factor = reduced[:, :, column] / np.where(pivot == 0.0, np.inf, pivot)[:, None]
        factor[:, [r for r in range(reduced.shape[1]) if r not in rows]] = 0.0
        reduced = reduced - factor[:, :, None] * reduced[:, row, None, :]
        reduced[:, rows, column] = 0.0
    return tuple(order)


@dataclass(frozen=True)
class SparseLU:
    """The triangular factors of a matrix a sample."""

    order: Order
    upper: Rows
    lower: list[list[tuple[int, Entry]]]
    """For each pivot, the rows from which its row was subtracted, and how many times."""
    inverse_pivots: list[Entry]

    @classmethod
    def factorise(cls, rows: Rows, order: Order) -> "SparseLU":
        """Eliminate in the given order."""
        upper, waiting = {row: list(rows[row]) for row, _ in order}, [row for row, _ in order]
        lower: list[list[tuple[int, Entry]]] = []
        pivots: list[Entry] = []
        for row, column in order:
            waiting.remove(row)
            source, pivot = upper[row], upper[row][column]
            inverse = 1.0 / pivot
            taken = [
                (other, mul(upper[other][column], inverse)) for other in waiting if not is_zero(upper[other][column])
            ]
            ahead = [k for k, entry in enumerate(source) if k != column and not is_zero(entry)]
            for other, times in taken:
                target = upper[other]
                for k in ahead:
                    target[k] = sub(target[k], mul(times, source[k]))
                target[column] = 0.0
            lower.append(taken)
            pivots.append(inverse)
        return cls(order, [upper[row] for row, _ in order], lower, pivots)

    def solve(self, right: Sequence[Entry]) -> list[Entry]:
        """Solution for right-hand sides by row of the matrix; rows without a pivot do not count."""
        value = {row: right[row] for row, _ in self.order}
        for (row, _), taken in zip(self.order, self.lower, strict=True):
            if not is_zero(value[row]):
                for other, times in taken:
                    value[other] = sub(value[other], mul(times, value[row]))
        solution: list[Entry] = [0.0] * len(self.order)
        for (row, column), entries, inverse in zip(
            reversed(self.order), reversed(self.upper), reversed(self.inverse_pivots), strict=True
        ):
            rest = value[row]
            for k, entry in enumerate(entries):
                if k != column and not is_zero(entry) and not is_zero(solution[k]):
                    rest = sub(rest, mul(entry, solution[k]))
            solution[column] = mul(rest, inverse)
        return solution

    def growth(self, count: int) -> Floats:
        """Largest entry of the upper factor times the largest inverse pivot, (n,) [-]: large near a singularity."""
        inverse = np.max([np.broadcast_to(np.abs(x), count) for x in self.inverse_pivots], axis=0)
        largest = max(float(np.abs(x).max()) for row in self.upper for x in row if not is_zero(x))
        return inverse * largest


def dense_columns(values: Sequence[Entry], count: int) -> Floats:
    """A vector of any length at ``count`` samples as an array (rows, n), in SI."""
    out = np.empty((len(values), count))
    for row, value in zip(out, values, strict=True):
        row[...] = value
    return out
