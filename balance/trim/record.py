"""The equations of one record, and their sums by stretch, from which stretches can be left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Indices


@dataclass(frozen=True)
class Record:
    """The equations of one record: measured = columns @ (c, shared) + nuisance @ (something of this record alone)."""

    columns: Floats
    """Of the conditions' values, then of what else is unknown and the same in all records, (n, rows, rank + shared)."""
    force: Floats
    """What was measured, (n, rows) [N, N m, m/s2]; zero, as its columns, where it says nothing."""
    nuisance: Floats
    """(n, rows, k)"""
    blocks: Indices
    """Number of the stretch that each sample is in, from zero, (n,)."""
    motion: str = ""
    """Records of one motion repeat what is systematic: a stretch is left out of all of them. Empty: like no other."""


class Sums:
    """Normal equations of a record by stretch."""

    def __init__(self, record: Record, scale: Floats) -> None:
        self.size, self.motion = record.columns.shape[2], record.motion
        nuisance = record.nuisance / np.maximum(np.sqrt(np.mean(record.nuisance**2, axis=(0, 1))), 1e-300)
        self.design = design = np.concatenate([record.columns / scale, nuisance], axis=2)
        parts = [np.flatnonzero(record.blocks == k) for k in range(int(record.blocks.max()) + 1)]
        rows = range(record.force.shape[1])
        self.matrix = np.array([[design[p, j].T @ design[p, j] for j in rows] for p in parts])
        self.vector = np.array([[design[p, j].T @ record.force[p, j] for j in rows] for p in parts])
        self.square = np.sum(record.force**2, axis=0)
        self.samples = len(record.force)
        self.weights = np.full(
            len(self.square), self.samples * len(self.square) / max(float(self.square.sum()), 1e-300)
        )

    def reduced(self, skip: int | None = None) -> tuple[Floats, Floats]:
        """Equations of the conditions alone, the record's own nuisances solved for."""
        matrix, vector = self._weighted(skip)
        k = self.size
        gain = np.linalg.lstsq(matrix[k:, k:], np.column_stack([matrix[k:, :k], vector[k:]]), rcond=1e-12)[0]
        return matrix[:k, :k] - matrix[:k, k:] @ gain[:, :k], vector[:k] - matrix[:k, k:] @ gain[:, k]

    def explained(self, values: Floats) -> Floats:
        """What the values, and the nuisances with them, explain of the measured, (n, rows)."""
        return np.asarray(self.design @ self._with_nuisances(values))

    def gain(self, solution: Floats) -> Floats:
        """How (p, size) @ the reduced equations' vector rises by what each reading is more, (n, rows, p)."""
        matrix, _ = self._weighted(None)
        k = self.size
        share = np.linalg.lstsq(matrix[k:, k:], matrix[k:, :k], rcond=1e-12)[0]
        own = self.design[:, :, :k] - self.design[:, :, k:] @ share
        return np.asarray((own @ solution.T) * self.weights[None, :, None])

    def left(self, values: Floats) -> float:
        """Sum of squares of the force that the values leave."""
        return float(self.left_by_row(values).sum())

    @property
    def whole(self) -> float:
        """Sum of squares of the force, less what the nuisances explain."""
        return self.left(np.zeros(self.size))

    def _with_nuisances(self, values: Floats) -> Floats:
        matrix, vector = self._weighted(None)
        k = self.size
        own = np.linalg.lstsq(matrix[k:, k:], vector[k:] - matrix[k:, :k] @ values, rcond=1e-12)[0]
        return np.concatenate([values, own])

    def _weighted(self, skip: int | None) -> tuple[Floats, Floats]:
        used = np.ones(len(self.matrix))
        if skip is not None:
            used[skip] = 0.0
        return (
            np.einsum("b,j,bjik->ik", used, self.weights, self.matrix),
            np.einsum("b,j,bji->i", used, self.weights, self.vector),
        )

    def left_by_row(self, values: Floats) -> Floats:
        """The same of each row, (rows,)."""
        all_values = self._with_nuisances(values)
        by_row, right = self.matrix.sum(axis=0), self.vector.sum(axis=0)
        return np.maximum(
            self.square - 2.0 * right @ all_values + np.einsum("i,jik,k->j", all_values, by_row, all_values), 0.0
        )


def weigh(sums: Sequence[Sums], values: Floats) -> None:
    """Weights of the rows by what the values leave, 1 / mean square, over all records: a row's noise is its sensor's.

    Weighted by what each record leaves of it, a row that hardly moves in one would count most there, where its columns
    are the encoders' noise.
    """
    for alike in _alike(sums):
        left = np.sum([one.left_by_row(values) for one in alike], axis=0)
        whole = sum(float(one.square.sum()) for one in alike)
        for one in alike:
            one.weights = sum(other.samples for other in alike) / np.maximum(left, 1e-8 * whole)


def _alike(sums: Sequence[Sums]) -> list[list[Sums]]:
    """Those of as many rows."""
    counts = sorted({len(one.square) for one in sums})
    return [[one for one in sums if len(one.square) == count] for count in counts]
