"""Least squares and marginalisation, on numbers with known truth and on the printed ones."""

from dataclasses import replace

import numpy as np
import pytest

from studies.kiper2019 import calibration
from studies.kiper2019.calibration import fit, marginalise
from studies.kiper2019.model import DISCREPANCY, PARAMETERS, SCATTER, reductions

TRUTH = {"residual_mass": 1.2, "flexing": 0.012, "moment_weight": 1.1, "couple_share_x": 0.2, "couple_share_y": 0.3,
         "couple_share_z": 0.45}  # fmt: skip


def made(cases, scatter, seed=1, discrepancy=0.0):
    """The same conditions with numbers that the model makes itself, scattered, groups of them off in common."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(0.0, scatter, len(cases.printed))
    offsets = cases.groups @ rng.normal(0.0, discrepancy, cases.groups.shape[1])
    return replace(cases, printed=reductions(TRUTH, cases) + noise + offsets)


@pytest.fixture(scope="module")
def known(training):
    """The posterior by the lightest payload."""
    return marginalise(training)


def test_known_parameters_are_found(printed):
    """All payloads together, without scatter, determine every parameter."""
    found = fit(made(printed, 0.0))
    assert dict(zip(found.names, found.values, strict=True)) == pytest.approx(TRUTH, rel=1e-3)


def test_the_posterior_holds_the_truth(printed):
    """With scatter the intervals hold the known parameters and the known scatter."""
    drawn = marginalise(made(printed, 4.0))
    for name, value in {**TRUTH, SCATTER.name: 4.0}.items():
        _, low, high = drawn.interval(name)
        assert low < value < high


def test_an_error_of_the_law_is_found(printed):
    """Eighteen groups show that they share an error, and how large it is; without one it is small."""
    _, low, high = marginalise(made(printed, 3.0, discrepancy=8.0)).interval(DISCREPANCY.name)
    assert 4.0 < low < 8.0 < high < 16.0
    assert marginalise(made(printed, 3.0)).interval(DISCREPANCY.name)[2] < 4.0


def test_likelihood_is_the_normal_density(training):
    """One cell has the density of the normal distribution with the covariance of scatter and common offsets."""
    from scipy.stats import multivariate_normal

    alone = training.where(training.axis == "x")
    errors = calibration._errors(np.array([[1.2, 0.012, 1.1]]), np.array([0.2]), alone)
    covariance = 9.0 * np.eye(8) + 25.0 * alone.groups @ alone.groups.T
    expected = multivariate_normal.logpdf(reductions(TRUTH, alone) - alone.printed, None, covariance)
    found = errors.log_likelihood(np.array(3.0), np.array(5.0)).item() - 4.0 * np.log(2.0 * np.pi)
    assert found == pytest.approx(expected, rel=1e-12)


def test_one_payload_leaves_the_split_open(training, printed):
    """One table tells how much remains, not of what: with all three the interval of a couple shrinks by half."""
    one, all_three = (marginalise(made(cases, 4.0)).interval("couple_share_x") for cases in (training, printed))
    assert one[2] - one[1] > 2.0 * (all_three[2] - all_three[1])


def test_intervals_of_predictions_cover(training, printed):
    """95 % intervals for numbers of other payloads hold about that share of numbers with known truth and law's error.

    Eighteen groups a seed share an offset: the share of four seeds scatters by 0.03 (binomial, 72 groups).
    """
    held = []
    for seed in range(4):
        low, high = marginalise(made(training, 4.0, seed, 6.0)).predict(printed)[1].T
        numbers = made(printed, 4.0, seed + 100, 6.0).printed
        held += [(low <= numbers) & (numbers <= high)]
    assert 0.86 < np.mean(held) <= 1.0


def test_bounds_do_not_decide(known, training, printed, monkeypatch):
    """Doubling every bound moves no prediction by more than 3 points, and their mean by less than 1."""
    found = known.predict(printed)[0]
    doubled = tuple(replace(p, high=2.0 * p.high) for p in PARAMETERS)
    monkeypatch.setattr(calibration, "PARAMETERS", doubled)
    wide = marginalise(training).predict(printed)[0]
    assert np.abs(wide - found).max() < 3.0
    assert abs(np.mean(wide - found)) < 1.0


def test_drawn_within_bounds(known, training):
    """No parameter leaves its bounds, and a second drawing gives the same."""
    for p in PARAMETERS:
        assert p.low <= known.samples[p.name].min() <= known.samples[p.name].max() <= p.high
    assert marginalise(training).interval("flexing") == known.interval("flexing")


def test_least_squares_is_no_worse_than_the_posterior(known, training):
    """No value of the posterior fits better than the best fit."""
    found = fit(training)
    assert found.alike > found.starts / 2
    best = (found.errors**2).sum()
    parameters = {p.name: known.samples[p.name] for p in PARAMETERS}
    assert ((reductions(parameters, training) - training.printed) ** 2).sum(axis=1).min() >= best - 1e-9
