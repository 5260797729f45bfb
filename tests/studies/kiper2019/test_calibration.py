"""Least squares and marginalisation, on numbers with known truth and on the printed ones."""

from dataclasses import replace

import numpy as np
import pytest

from studies.kiper2019 import calibration
from studies.kiper2019.calibration import fit, marginalise
from studies.kiper2019.model import PARAMETERS, SCATTER, reductions

TRUTH = {"residual_mass": 1.2, "flexing": 0.012, "moment_weight": 1.1, "couple_share_x": 0.2, "couple_share_y": 0.3,
         "couple_share_z": 0.45}  # fmt: skip


def made(cases, scatter, seed=1):
    """The same conditions with numbers that the model makes itself, scattered."""
    noise = np.random.default_rng(seed).normal(0.0, scatter, len(cases.printed))
    return replace(cases, printed=reductions(TRUTH, cases) + noise)


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


def test_one_payload_leaves_the_split_open(training, printed):
    """One table tells how much remains, not of what: with all three the interval of a couple shrinks by half."""
    one, all_three = (marginalise(made(cases, 4.0)).interval("couple_share_x") for cases in (training, printed))
    assert one[2] - one[1] > 2.0 * (all_three[2] - all_three[1])


def test_intervals_of_predictions_cover(training, printed):
    """95 % intervals for numbers of other payloads hold about that share of numbers with known truth."""
    held = []
    for seed in range(3):
        low, high = marginalise(made(training, 4.0, seed)).predict(printed)[1].T
        numbers = made(printed, 4.0, seed + 100).printed
        held += [(low <= numbers) & (numbers <= high)]
    assert 0.85 < np.mean(held) < 0.99


def test_bounds_do_not_decide(training, printed, monkeypatch):
    """Doubling every bound moves no prediction by more than 3 points, and their mean by less than 1."""
    found = marginalise(training).predict(printed)[0]
    doubled = tuple(replace(p, high=2.0 * p.high) for p in PARAMETERS)
    monkeypatch.setattr(calibration, "PARAMETERS", doubled)
    wide = marginalise(training).predict(printed)[0]
    assert np.abs(wide - found).max() < 3.0
    assert abs(np.mean(wide - found)) < 1.0


def test_drawn_within_bounds(training):
    """No parameter leaves its bounds, and a second drawing gives the same."""
    drawn = marginalise(training)
    for p in PARAMETERS:
        assert p.low <= drawn.samples[p.name].min() <= drawn.samples[p.name].max() <= p.high
    assert marginalise(training).interval("flexing") == drawn.interval("flexing")


def test_least_squares_is_no_worse_than_the_posterior(training):
    """No value of the posterior fits better than the best fit."""
    found = fit(training)
    assert found.alike > found.starts / 2
    best = (found.errors**2).sum()
    samples = marginalise(training).samples
    parameters = {p.name: samples[p.name] for p in PARAMETERS}
    assert ((reductions(parameters, training) - training.printed) ** 2).sum(axis=1).min() >= best - 1e-9
