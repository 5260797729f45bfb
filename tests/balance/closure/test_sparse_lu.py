"""Elimination of symbols against NumPy's dense solver, sample by sample."""

import numpy as np
import pytest

from balance.closure.newton import Order, SparseLU, pivot_order
from balance.mechanism.tape import Symbols, Tape, numbers

from .. import models

N = 40


def sparse(size: int, seed: int) -> np.ndarray:
    """Sparse matrices (N, size, size): zeros, constants and varying entries, their leading diagonal large enough."""
    rng = np.random.default_rng(seed)
    kind = rng.choice(3, (size, size), p=[0.6, 0.15, 0.25])
    varying, constant = rng.normal(size=(N, size, size)), rng.normal(size=(size, size))
    return np.choose(kind, [0.0, constant, varying]) + 3.0 * np.eye(size)


def solved(matrices: np.ndarray, right: np.ndarray, order: Order) -> np.ndarray:
    """Solutions (N, columns) for right-hand sides (N, rows); what is the same in all samples is a number."""
    constant = np.ptp(matrices, axis=0) == 0.0

    def write(entries: Symbols, right: Symbols) -> Symbols:
        symbols = np.where(constant, numbers(matrices[0]), entries.reshape(constant.shape))
        return SparseLU.factorise(symbols, order).solve(right)

    return models.evaluated(write, matrices.reshape(len(matrices), -1).T, right.T)


@pytest.mark.parametrize("seed", range(8))
def test_solutions_are_numpys(seed: int) -> None:
    """Square systems: the same solution as a dense solver at every sample."""
    matrices, right = sparse(7, seed), np.random.default_rng(seed).normal(size=(N, 7))
    expected = np.linalg.solve(matrices, right[:, :, None])[:, :, 0]
    found = solved(matrices, right, pivot_order(matrices))
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_dependent_rows_are_left_out() -> None:
    """Rows that repeat, and rows of zeros, are not pivots; the solution meets them all the same."""
    rows = sparse(5, 3)
    double = np.concatenate([np.zeros((N, 1, 5)), rows[:, :1], rows, 2.0 * rows[:, 2:3]], axis=1)
    order = pivot_order(double)
    assert len({row for row, _ in order}) == len({column for _, column in order}) == 5
    assert 0 not in {row for row, _ in order}
    x = np.random.default_rng(1).normal(size=(N, 5))
    np.testing.assert_allclose(solved(double, np.einsum("nij,nj->ni", double, x), order), x, atol=1e-10)


def test_zeros_stay_zeros() -> None:
    """What does not enter is not computed: a triangular system fills in nothing."""
    (x,) = Tape().rows(1)
    rows = np.array([[1.0, 0.0, 0.0], [x, 1.0, 0.0], [0.0, x, 1.0]], dtype=object)
    factors = SparseLU.factorise(rows, ((0, 0), (1, 1), (2, 2)))
    assert factors.solve([0.0, 0.0, 1.0]).tolist() == [0.0, 0.0, 1.0]
