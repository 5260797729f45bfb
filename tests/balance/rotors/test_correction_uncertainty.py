"""Intervals of correction weights: compared with machines of known truth and with solutions drawn anew."""

from functools import partial

import numpy as np
import pytest
from scipy.stats import binomtest

from balance.rotors import correction_uncertainty, influence_coefficients

PLANES, ROWS = 2, 5


def _random(rng, *shape):
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


class Trial:
    """One balancing of a machine that is known, whose readings scatter along and across."""

    def __init__(
        self, seed, noise=(0.02, 0.02), *, stated=1.0, repeats=0, rows=ROWS, limits=None, method="least-squares",
        common=0.0, is_stated=True,
    ):  # fmt: skip
        """``stated``: share of the scatter that is stated, or None; ``common`` turns all phases of a run."""
        rng = np.random.default_rng(seed)
        self.initial, self.matrix = 2.0 * _random(rng, rows), _random(rng, rows, PLANES) + 2.0 * np.eye(rows, PLANES)
        on = np.repeat(np.vstack([np.zeros(PLANES), np.eye(PLANES)]), 1 + repeats, axis=0)
        true = self.initial + on @ self.matrix.T
        off = noise[0] * rng.normal(size=true.shape) + 1j * noise[1] * rng.normal(size=true.shape)
        readings = true + off * true / np.abs(true)
        readings = readings * np.exp(1j * common * rng.normal(size=(len(on), 1)))
        modes = common * np.eye(len(on))[:, :, None] * np.ones(rows) if common and is_stated else None
        half = 1.959964 * np.array(noise) * (stated or 1.0)
        errors = (
            np.array([[correction_uncertainty.reading_covariance(v, *half) for v in run] for run in readings])
            if stated
            else None
        )
        self.solve = partial(influence_coefficients.solve_weights, method=method, limits=limits)
        self.best = self.solve(influence_coefficients.Coefficients(self.initial, self.matrix, 0.0))
        self.found = self.solve(influence_coefficients.influence_coefficients(on, readings))
        self.covariance = correction_uncertainty.covariance_of_runs(on, readings, errors, modes)
        self.uncertainty = self.covariance and correction_uncertainty.propagate(self.found, self.covariance, self.solve)

    def hits(self):
        """Whether magnitude and angle of each weight, and each reading with the weights on, lie in their intervals."""
        weights, true = self.found.weights, self.best.weights
        magnitude = np.abs(np.abs(weights) - np.abs(true)) < [i.magnitude for i in self.uncertainty.weights]
        angle = np.abs(np.angle(weights / true)) < [i.angle for i in self.uncertainty.weights]
        after = np.abs(self.initial + self.matrix @ weights - self.found.residual) < self.uncertainty.after
        return magnitude, angle, after


def coverage(trials):
    """Hits and tries for magnitudes, angles and residual readings."""
    hits = [trial.hits() for trial in trials]
    return [(int(np.sum(kind)), int(np.size(kind))) for kind in zip(*hits, strict=True)]


def honest(hits, tries, together=PLANES):
    """Whether hits are 95 % of tries by a binomial test at 0.1 %; ``together`` tries of one machine count as one."""
    return binomtest(round(hits / together), round(tries / together), 0.95).pvalue > 1e-3


@pytest.mark.parametrize("rows", [2, 5])
def test_stated_errors_give_honest_intervals(rows):
    """60 machines, the readings' scatter stated: 95 % of magnitudes, angles and residual readings hold the truth."""
    magnitude, angle, after = coverage([Trial(seed, rows=rows) for seed in range(60)])
    assert honest(*magnitude)
    assert honest(*angle)
    assert honest(*after, rows)


def test_a_phase_that_scatters_more_than_the_amplitude():
    """Four times more: weights in 95 %; residual readings in no fewer, their distance being that of a circle."""
    magnitude, angle, after = coverage([Trial(seed, (0.01, 0.04)) for seed in range(60)])
    assert honest(*magnitude)
    assert honest(*angle)
    assert after[0] / after[1] > 0.94


@pytest.mark.parametrize("repeats", [1, 3])
def test_repeated_runs_give_honest_intervals(repeats):
    """Scatter unknown, each run made twice or four times: 95 % by Student's distribution."""
    trials = [Trial(seed, stated=None, repeats=repeats) for seed in range(60)]
    assert trials[0].covariance.degrees_of_freedom == 2 * 3 * repeats
    magnitude, angle, after = coverage(trials)
    assert honest(*magnitude)
    assert honest(*angle)
    assert honest(*after, ROWS)


def test_no_degree_of_freedom_and_nothing_stated_gives_no_interval():
    """As many runs as are needed say nothing of their scatter."""
    assert Trial(0, stated=None).covariance is None


@pytest.mark.parametrize("rows", [2, 5])
def test_differentiated_weights_are_those_of_a_monte_carlo(rows):
    """Covariance of the weights by differentiation and of 4000 solutions for coefficients drawn: within 10 %."""
    trial = Trial(3, (0.01, 0.02), rows=rows)
    rng, about = np.random.default_rng(1), trial.found.coefficients
    roots = np.linalg.cholesky(trial.covariance.covariance + 1e-15 * np.eye(2 * PLANES + 2))
    weights = []
    for _ in range(4000):
        off = (roots @ rng.normal(size=(rows, 2 * PLANES + 2, 1)))[..., 0]
        drawn = about.initial + off[:, 0] + 1j * off[:, 3], about.matrix + off[:, 1:3] + 1j * off[:, 4:]
        weights.append(trial.solve(influence_coefficients.Coefficients(*drawn, 0.0)).weights)
    for plane, expected in enumerate(np.array(weights).T):
        covariance = np.cov(expected.real, expected.imag)
        np.testing.assert_allclose(trial.uncertainty.covariance[plane], covariance, atol=0.1 * np.trace(covariance))


@pytest.mark.parametrize("method", ["least-squares", "robust", "min-max"])
def test_limits_and_other_methods_are_drawn(method, monkeypatch):
    """Where the weights cannot be differentiated: a plane at its limit keeps its magnitude, intervals hold the best."""
    monkeypatch.setattr(correction_uncertainty, "DRAWS", 30)
    limits = [0.5 * abs(Trial(5).best.weights[0]), np.inf]
    trial = Trial(5, method=method, limits=limits)
    assert trial.uncertainty.draws == 30
    first, second = trial.uncertainty.weights
    assert first.magnitude < 0.01 * limits[0]
    assert first.angle > 1e-4
    assert second.magnitude < 0.2 * abs(trial.found.weights[1])
    assert all(np.all(kind) for kind in trial.hits()[:2])


def test_runs_that_scatter_more_than_stated_widen_the_intervals():
    """A fifth of the true scatter stated: widened fivefold by the residual of repeated runs; all of it: not at all."""
    few = [Trial(seed, stated=0.2, repeats=3).covariance.widened for seed in range(20)]
    assert np.mean(few) == pytest.approx(5.0, rel=0.05)
    assert np.mean([Trial(seed, repeats=3).covariance.widened > 1.0 for seed in range(60)]) < 0.1


def test_given_coefficients_and_a_vector_of_no_length():
    """Coefficients taken as exact: only the readings scatter; a weight of none has no angle."""
    truth = Trial(0)
    errors = np.zeros((PLANES + 1, ROWS, 2, 2))
    errors[0] = 1e-4 * np.eye(2)
    uncertainty = correction_uncertainty.propagate(
        truth.best, correction_uncertainty.covariance_of_stated(errors), truth.solve
    )
    normal = np.linalg.inv(truth.matrix.conj().T @ truth.matrix)
    np.testing.assert_allclose(
        np.trace(uncertainty.covariance, axis1=1, axis2=2), 2e-4 * np.diag(normal).real, rtol=1e-9
    )
    assert correction_uncertainty.polar_interval(0j, np.eye(2)).angle == np.pi


@pytest.mark.parametrize("rows", [2, 5])
def test_common_mode_errors_of_a_run_give_honest_intervals(rows):
    """All phases of a run off by 2 degrees: honest where that is stated, with repeated runs too; else far from it."""
    given = {"noise": (0.005, 0.005), "rows": rows, "common": 0.035}
    for repeats in (0, 1):
        *weights, after = coverage(Trial(seed, repeats=repeats, **given) for seed in range(50))
        assert all(honest(hits, tries) for hits, tries in weights)
        assert after[0] > 0.94 * after[1]  # a disc about errors that lie along a line is wider than they need
    (_, (angles, tries), _) = coverage(Trial(seed, is_stated=False, **given) for seed in range(50))
    assert angles < 0.6 * tries


def test_common_mode_errors_where_weights_are_drawn():
    """As where they are differentiated, to what 100 draws allow (four times 7 %), errors being small."""
    for seed in range(3):
        one = Trial(seed, noise=(5e-4, 5e-4), common=0.002)
        drawn = correction_uncertainty._drawn(one.found, one.covariance, one.solve)
        np.testing.assert_allclose(
            np.sqrt(np.trace(drawn, axis1=1, axis2=2)),
            np.sqrt(np.trace(one.uncertainty.covariance, axis1=1, axis2=2)),
            rtol=0.28,
        )
