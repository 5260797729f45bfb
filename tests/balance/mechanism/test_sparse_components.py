"""Vectors by component agree with plain array algebra, whether their components vary, are constant, zero or one."""

from itertools import product

import numpy as np
import pytest

from balance.mechanism import sparse_components as c

N = 5
RNG = np.random.default_rng(8)
VECTORS: list[c.Vector] = [
    tuple(RNG.normal(size=N) if letter == "v" else {"0": 0.0, "1": 1.0, "k": -1.7}[letter] for letter in kinds)
    for kinds in ("vvv", "000", "v0v", "01v", "k10", "100", "kvk")
]
MATRICES: list[c.Matrix] = [c.IDENTITY, (VECTORS[0], VECTORS[4], VECTORS[2]), (VECTORS[1], VECTORS[6], VECTORS[3])]
PAIRS = list(product(range(len(VECTORS)), repeat=2))


def full(a: c.Vector) -> np.ndarray:
    """(n, 3)."""
    return c.dense(a, N).T


@pytest.mark.parametrize(("i", "j"), PAIRS)
def test_vector_algebra(i: int, j: int) -> None:
    """Sum, difference, scalar and vector product of any two kinds of vectors."""
    a, b = VECTORS[i], VECTORS[j]
    np.testing.assert_array_equal(full(c.plus(a, b)), full(a) + full(b))
    np.testing.assert_array_equal(full(c.minus(a, b)), full(a) - full(b))
    np.testing.assert_allclose(np.broadcast_to(c.dot(a, b), N), (full(a) * full(b)).sum(axis=1), atol=1e-15)
    np.testing.assert_allclose(full(c.cross(a, b)), np.cross(full(a), full(b)), atol=1e-15)


@pytest.mark.parametrize("i", range(len(VECTORS)))
@pytest.mark.parametrize("m", range(len(MATRICES)))
def test_matrix_algebra(m: int, i: int) -> None:
    """Matrix and transposed matrix times vector, product of matrices: columns first."""
    columns = np.stack([full(column) for column in MATRICES[m]], axis=2)
    np.testing.assert_allclose(
        full(c.apply(MATRICES[m], VECTORS[i])), np.einsum("nij,nj->ni", columns, full(VECTORS[i])), atol=1e-15
    )
    np.testing.assert_allclose(
        full(c.apply_transposed(MATRICES[m], VECTORS[i])),
        np.einsum("nji,nj->ni", columns, full(VECTORS[i])),
        atol=1e-15,
    )
    both = np.stack([full(column) for column in c.product(MATRICES[m], MATRICES[1])], axis=2)
    other = np.stack([full(column) for column in MATRICES[1]], axis=2)
    np.testing.assert_allclose(both, columns @ other, atol=1e-14)


def test_zeros_cost_nothing() -> None:
    """What is zero for all samples stays a constant: the product of planar vectors has one varying component."""
    x, y = RNG.normal(size=(2, N))
    assert c.cross((x, y, 0.0), (y, x, 0.0))[:2] == (0.0, 0.0)
    assert c.scale(0.0, (x, y, 0.0)) == c.ZERO
    assert c.plus(c.ZERO, (x, y, 0.0))[0] is x
    assert c.apply(c.IDENTITY, (x, y, 0.0))[1] is y


def test_constants_by_component() -> None:
    """Arrays of constants become components and come back."""
    values = RNG.normal(size=(3, 3))
    np.testing.assert_array_equal(full(c.vector(values[0])), np.tile(values[0], (N, 1)))
    np.testing.assert_array_equal(np.array(c.matrix(values)).T, values)
