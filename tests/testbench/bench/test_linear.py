"""A linear system from rest: the recursion step by step, and a closed form."""

import numpy as np
import pytest
from scipy.linalg import expm

from testbench.bench.linear import respond


def test_recursion():
    """All samples at once are what one step after the other gives, over several blocks."""
    rng = np.random.default_rng(1)
    a, b, w = rng.normal(size=(4, 4)) - 3.0 * np.eye(4), rng.normal(size=(4, 2)), rng.normal(size=(777, 2))
    held = np.repeat(w[:1], 777, axis=0)
    phi, rest, state = expm(0.01 * a), np.zeros(4), []
    for _ in range(777):
        state.append(rest)
        rest = phi @ rest + np.linalg.solve(a, (phi - np.eye(4)) @ b @ w[0])
    assert respond(a, b, held, 0.01) == pytest.approx(np.array(state), abs=1e-12)


def test_ramp():
    """Under a ramp, a lag of time constant T follows: y = t - T (1 - exp(-t / T)), at any step."""
    for step in (1e-3, 0.05):
        time = np.arange(200) * step
        found = respond(np.array([[-10.0]]), np.array([[10.0]]), time[:, None], step)[:, 0]
        assert found == pytest.approx(time - 0.1 * (1.0 - np.exp(-10.0 * time)), abs=1e-12)


@pytest.mark.parametrize("count", [1, 2, 127, 128, 129, 300])
def test_several_at_once(count):
    """Several signals through one system are as each for itself, whatever their length beside that of a block."""
    rng = np.random.default_rng(2)
    a, b, w = np.array([[0.0, 1.0], [-400.0, -4.0]]), np.array([[0.0], [1.0]]), rng.normal(size=(count, 3, 1))
    together = respond(a, b, w, 0.01)
    assert together.shape == (count, 3, 2)
    for k in range(3):
        assert together[:, k] == pytest.approx(respond(a, b, w[:, k], 0.01), abs=1e-15)
