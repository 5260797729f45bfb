"""Influence coefficients: published cases, known truth, and optima against independent ones."""

import numpy as np
import pytest
from scipy.optimize import minimize

from balance.errors import SizingError
from balance.rotors import influence_coefficients


def _random(rng, *shape):
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def _machine(seed, rows=5, planes=2):
    rng = np.random.default_rng(seed)
    return influence_coefficients.Coefficients(_random(rng, rows), _random(rng, rows, planes), 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_runs_give_the_true_coefficients(seed):
    """Runs of a known machine, trial weights left on or taken off, give its coefficients and its first readings."""
    rng = np.random.default_rng(seed)
    truth = _machine(seed, rows=6, planes=3)
    trial = np.diag(_random(rng, 3))
    on = np.vstack([np.zeros(3), trial if seed % 2 else np.cumsum(trial, axis=0)])
    found = influence_coefficients.influence_coefficients(on, truth.initial + on @ truth.matrix.T)
    np.testing.assert_allclose(found.matrix, truth.matrix, rtol=1e-11)
    np.testing.assert_allclose(found.initial, truth.initial, rtol=1e-11)


def test_left_on_or_taken_off_predicts_the_same_residual():
    """The same readings read both ways: other weights, one residual (the plane space is the same)."""
    rng = np.random.default_rng(8)
    readings, trial = _random(rng, 3, 4), np.diag(_random(rng, 2))
    off = influence_coefficients.solve_weights(
        influence_coefficients.influence_coefficients(np.vstack([np.zeros(2), trial]), readings)
    )
    on = influence_coefficients.solve_weights(
        influence_coefficients.influence_coefficients(np.vstack([np.zeros(2), np.cumsum(trial, axis=0)]), readings)
    )
    np.testing.assert_allclose(on.residual, off.residual, atol=1e-12)
    assert not np.allclose(on.weights, off.weights)


def test_more_runs_than_needed_are_fitted():
    """Redundant runs with errors: least squares, and the misfit is as large as the errors."""
    rng = np.random.default_rng(1)
    truth = _machine(1, rows=4, planes=2)
    on = np.vstack([np.zeros(2), _random(rng, 200, 2)])
    readings = truth.initial + on @ truth.matrix.T + 0.01 * _random(rng, 201, 4)
    found = influence_coefficients.influence_coefficients(on, readings)
    assert found.misfit == pytest.approx(0.01 * np.sqrt(2), rel=0.1)
    np.testing.assert_allclose(found.matrix, truth.matrix, atol=0.01)


def test_runs_that_do_not_separate_planes_are_refused():
    """Two planes with one trial, or trials always in the same ratio, are not determined."""
    on = np.array([[0, 0], [1, 1], [2, 2]], dtype=complex)
    with pytest.raises(SizingError, match="effect of 1 of 2 planes"):
        influence_coefficients.influence_coefficients(on, np.ones((3, 2), dtype=complex))


@pytest.mark.parametrize("method", influence_coefficients.METHODS)
@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_optima_are_not_beaten(method, limited, seed):
    """No nearby weights, and no general minimiser, does better; weights keep their limits."""
    machine = _machine(seed)
    factors = np.random.default_rng(seed).uniform(0.5, 2.0, 5)
    free = influence_coefficients.solve_weights(machine, method, factors)
    limits = 0.6 * np.abs(free.weights) if limited else np.full(2, np.inf)
    found = influence_coefficients.solve_weights(machine, method, factors, limits)
    assert found.is_optimal(1e-6)
    assert (np.abs(found.weights) <= limits * (1 + 1e-9)).all()
    order = {"least-squares": 2, "robust": 1, "min-max": np.inf}[method]

    def cost(x):
        w = x[:2] + 1j * x[2:]
        w = w * np.minimum(1.0, limits / np.maximum(np.abs(w), 1e-300))
        return np.linalg.norm(np.abs(machine.initial + machine.matrix @ w) * factors, order)

    start = np.r_[found.weights.real, found.weights.imag]
    assert cost(start) == pytest.approx(found.cost, rel=1e-9)
    other = minimize(cost, 0.9 * start, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-12, "maxiter": 8000})
    assert found.cost <= other.fun * (1 + 1e-7)


def test_one_wrong_reading_moves_the_robust_weights_little():
    """Readings that two planes explain but for one: the robust weights are the true ones, those of squares are not."""
    rng = np.random.default_rng(5)
    matrix, truth = _random(rng, 8, 2), _random(rng, 2)
    initial = -matrix @ truth
    initial[3] += 2.0
    machine = influence_coefficients.Coefficients(initial, matrix, 0.0)
    assert np.abs(influence_coefficients.solve_weights(machine, "robust").weights - truth).max() < 1e-6
    assert np.abs(influence_coefficients.solve_weights(machine).weights - truth).max() > 0.05


def test_a_heavy_row_is_made_small():
    """A row with a large factor ends smaller than with equal factors."""
    machine = _machine(2)
    heavy = influence_coefficients.solve_weights(machine, factors=np.array([100.0, 1, 1, 1, 1]))
    assert abs(heavy.residual[0]) < 0.01 * abs(influence_coefficients.solve_weights(machine).residual[0])


def test_too_few_readings_are_refused():
    """One sensor at one speed does not determine two planes; a plane without effect is named."""
    with pytest.raises(SizingError, match="do not determine the weights of 2 planes"):
        influence_coefficients.solve_weights(_machine(0, rows=1))
    machine = _machine(0)
    with pytest.raises(SizingError, match="plane number 2 changes no reading"):
        influence_coefficients.solve_weights(
            influence_coefficients.Coefficients(machine.initial, machine.matrix * [1.0, 0.0], 0.0)
        )


def test_effect_is_the_largest_relative_change():
    """|after - before| / |before| over rows; a very small reading is compared with a tenth of the largest."""
    assert influence_coefficients.weight_effect(np.array([1.0, 2j]), np.array([1.1, 3j])) == pytest.approx(0.5)
    assert influence_coefficients.weight_effect(np.array([100.0, 0.1]), np.array([101.0, 0.2])) == pytest.approx(0.01)
    assert influence_coefficients.weight_effect(np.zeros(2), np.array([1.0, 0.0])) == np.inf
