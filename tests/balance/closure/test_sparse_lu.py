"""Elimination by component against NumPy's dense solver, sample by sample."""

import numpy as np
import pytest

from balance.closure.newton import SparseLU, pivot_order
from balance.mechanism.sparse_components import Entry, Rows, dense_columns, dense_rows

N = 40


def sparse(rows: int, columns: int, seed: int) -> Rows:
    """A sparse matrix a sample: zeros, constants and varying entries, its leading diagonal large enough."""
    rng = np.random.default_rng(seed)
    matrix: Rows = []
    for i in range(rows):
        row: list[Entry] = []
        for j in range(columns):
            kind = rng.choice(["zero", "constant", "varying"], p=[0.6, 0.15, 0.25])
            own = 3.0 if i == j else 0.0
            value: Entry = (
                own + rng.normal(size=N) if kind == "varying" else own + float(rng.normal()) * (kind != "zero")
            )
            row.append(value)
        matrix.append(row)
    return matrix


def dense(rows: Rows) -> np.ndarray:
    """The same matrix sample by sample, (N, rows, columns)."""
    return dense_rows(rows, len(rows[0]), N).transpose(2, 0, 1)


@pytest.mark.parametrize("seed", range(8))
def test_solutions_are_numpys(seed: int) -> None:
    """Square systems: the same solution as a dense solver at every sample, constants in the right-hand side too."""
    rows = sparse(7, 7, seed)
    matrices = dense(rows)
    factors = SparseLU.factorise(rows, pivot_order(matrices))
    right: list[Entry] = [0.0, 1.0, *np.random.default_rng(seed).normal(size=(5, N))]
    expected = np.linalg.solve(matrices, dense_columns(right, N).T[:, :, None])[:, :, 0]
    np.testing.assert_allclose(dense_columns(factors.solve(right), N).T, expected, atol=1e-9 * np.abs(expected).max())


def test_dependent_rows_are_left_out() -> None:
    """Rows that repeat, and rows of zeros, are not pivots; the solution meets them all the same."""
    rows = sparse(5, 5, 3)
    double = [[0.0] * 5, rows[0], *rows, [entry * 2.0 for entry in rows[2]]]
    order = pivot_order(dense(double))
    assert len({row for row, _ in order}) == len({column for _, column in order}) == 5
    assert 0 not in {row for row, _ in order}
    x = np.random.default_rng(1).normal(size=(5, N))
    right = list(np.einsum("nij,jn->in", dense(double), x))
    np.testing.assert_allclose(dense_columns(SparseLU.factorise(double, order).solve(right), N), x, atol=1e-10)


def test_zeros_stay_zeros() -> None:
    """What does not enter is not computed: a triangular system fills in nothing."""
    varying = np.arange(1.0, N + 1)
    rows: Rows = [[1.0, 0.0, 0.0], [varying, 1.0, 0.0], [0.0, varying, 1.0]]
    factors = SparseLU.factorise(rows, pivot_order(dense(rows)))
    assert factors.solve([0.0, 0.0, 1.0]) == [0.0, 0.0, 1.0]
