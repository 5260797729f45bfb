"""Two memories that say different things: what their mean is off by, from noise drawn and a truth at either."""

import numpy as np
import pytest

from balance.memories import mean_covariance


def test_noise_that_both_share_counts_once():
    """Two memories that say the same, moved alike by noise: the mean is no surer, nor less sure, than either."""
    by = np.random.default_rng(0).normal(size=(50, 2))
    same = np.array([0.3, -0.1])
    assert mean_covariance(same, same, by, by) == pytest.approx(by.T @ by)


@pytest.mark.parametrize("apart", [0.0, 20.0])
def test_the_variance_is_that_of_the_mean(apart):
    """Noise, and a truth at either end of what the memories differ by: the variance stated is that of the errors."""
    rng = np.random.default_rng(3)
    ends = apart * np.array([[0.6, 0.8], [-0.6, -0.8]])
    shorts, longs = rng.normal(size=(2, 400, 40, 2))
    longs = 0.6 * shorts + 0.8 * longs
    which = ends[rng.integers(0, 2, 400)]
    short, long = shorts.sum(axis=1) + which, longs.sum(axis=1) - which
    stated = [mean_covariance(*both) for both in zip(short, long, shorts, longs, strict=True)]
    error = 0.5 * (short + long) + ends[rng.integers(0, 2, 400)]
    assert np.trace(np.mean(stated, axis=0)) == pytest.approx(np.mean(np.sum(error**2, axis=1)), rel=0.2)


def test_what_noise_explains_is_no_bound():
    """A difference of the size that its own noise gives it widens nothing."""
    by_short, by_long = np.random.default_rng(1).normal(size=(2, 50, 2))
    half = np.linalg.cholesky(0.25 * (by_long - by_short).T @ (by_long - by_short)) @ np.array([1.0, 0.9])
    mean = 0.5 * (by_short + by_long)
    assert mean_covariance(-half, half, by_short, by_long) == pytest.approx(mean.T @ mean)
