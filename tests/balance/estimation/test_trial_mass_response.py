"""Trial masses on a base of one's own making: its intervals hold, and are no wider than need be."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import t as student

from balance.balancing import conditions
from balance.errors import DataError
from balance.estimation import trial_mass_response as trials
from balance.estimation.first_moment_imbalance import Subspace
from balance.mechanism.mjcf_parser import load_mechanism

from ...testbench.coverage import assert_holds

RATE = 250.0
TIME = np.arange(0.0, 1.4, 1.0 / RATE)
AT = trials.transform_frequencies(float(TIME[-1]), 20.0)
TRUTH = np.array([0.03, -0.02])
"""Of two conditions [kg m]."""
NOISE = 3e-3
"""Of a reading [m/s2]."""
MASS = 150.0
"""Of the base [kg]."""


def rung(pushes, hertz, damping):
    """Acceleration of a base on its mounts, exactly at the samples for pushes that are constant between them."""
    w = 2.0 * np.pi * hertz
    decay, turn = np.exp(-damping * w / RATE), w * np.sqrt(1.0 - damping**2) / RATE
    poles = np.array([1.0, -2.0 * decay * np.cos(turn), decay**2])
    return lfilter([1.0, -2.0, 1.0], poles, pushes, axis=0) / MASS


def bumps(seed):
    """Pushes per unit of each condition, between 0.1 s and 0.9 s, smooth, (n, 2) [N per kg m]."""
    rng = np.random.default_rng(seed)
    at, width = rng.uniform(0.2, 0.8, (12, 1)), rng.uniform(0.015, 0.05, (12, 1))
    waves = np.exp(-0.5 * ((TIME - at) / width) ** 2).T
    return waves @ rng.normal(0.0, 100.0, (12, 2))


def campaign(seed, noise=NOISE):
    """Three motions, each without and with trial masses on either condition; two channels."""
    rng, found = np.random.default_rng([seed, 5]), []
    for motion in range(3):
        per_unit = bumps(motion)
        for more in ((0.0, 0.0), (0.03, 0.0), (0.0, 0.03)):
            wrench = per_unit[:, :, None] * np.eye(2)
            known = wrench @ np.array(more)
            pushes = wrench @ TRUTH + known
            seen = np.column_stack([rung(pushes @ [1.0, 0.3], 8.0, 0.06), rung(pushes @ [-0.2, 1.0], 11.0, 0.05)])
            seen += noise * rng.normal(size=seen.shape)
            slow = np.stack([np.ones_like(TIME), TIME - TIME.mean()], axis=1)
            found.append(trials.Trial(*(trials.transform(v, TIME, AT) for v in (wrench, known, seen, slow))))
    return found


def measured(seed, noise=NOISE):
    """What one campaign says."""
    free = Subspace(np.eye(2), np.zeros(2))
    return trials.trial_mass_imbalance(
        campaign(seed, noise), AT, conditions.balance_conditions(load_mechanism("four-bar")), np.zeros(2), free
    )


@pytest.fixture(scope="module")
def found():
    """What six campaigns say, differing in noise alone."""
    return [measured(seed) for seed in range(6)]


def test_without_noise():
    """Nothing but the memory's end is left open: the truth to a hundredth, and no wider."""
    one = measured(0, noise=0.0)
    assert one.values == pytest.approx(TRUTH, abs=2e-4)
    assert np.sqrt(np.diag(one.covariance)).max() < 2e-4


def test_intervals_hold(found):
    """Noise on a base that rings on: intervals hold the truth as 95 % promises, and tell it to a third."""
    for i, truth in enumerate(TRUTH):
        half = [student.ppf(0.975, one.degrees_of_freedom) * np.sqrt(one.covariance[i, i]) for one in found]
        assert_holds(sum(abs(one.values[i] - truth) < h for one, h in zip(found, half, strict=True)), len(found))
        assert max(half) < abs(truth) / 3.0


def test_widths_are_those_of_the_errors(found):
    """Stated deviations and errors, rms over campaigns, agree within what six of them show."""
    errors = np.sqrt(np.mean([np.mean((one.values - TRUTH) ** 2) for one in found]))
    stated = np.sqrt(np.mean([np.mean(np.diag(one.covariance)) for one in found]))
    assert 0.6 * errors < stated < 2.0 * errors


def test_noise_that_both_share_counts_once():
    """Two memories of one answer, moved in the same way by noise: the mean is no surer, nor less sure, than either."""
    by = np.random.default_rng(0).normal(size=(50, 2))
    same = np.array([0.3, -0.1])
    assert trials.mean_covariance(same, same, by, by) == pytest.approx(by.T @ by)


@pytest.mark.parametrize("apart", [0.0, 20.0])
def test_the_variance_is_that_of_the_mean(apart):
    """Noise, and a truth at either end of what the memories differ by: the variance stated is that of the errors."""
    rng = np.random.default_rng(3)
    ends = apart * np.array([[0.6, 0.8], [-0.6, -0.8]])
    shorts, longs = rng.normal(size=(2, 400, 40, 2))
    longs = 0.6 * shorts + 0.8 * longs
    which = ends[rng.integers(0, 2, 400)]
    short, long = shorts.sum(axis=1) + which, longs.sum(axis=1) - which
    stated = [trials.mean_covariance(*both) for both in zip(short, long, shorts, longs, strict=True)]
    error = 0.5 * (short + long) + ends[rng.integers(0, 2, 400)]
    assert np.trace(np.mean(stated, axis=0)) == pytest.approx(np.mean(np.sum(error**2, axis=1)), rel=0.2)


def test_what_noise_explains_is_no_bound():
    """A difference of the size that its own noise gives it widens nothing."""
    by_short, by_long = np.random.default_rng(1).normal(size=(2, 50, 2))
    half = np.linalg.cholesky(0.25 * (by_long - by_short).T @ (by_long - by_short)) @ np.array([1.0, 0.9])
    mean = 0.5 * (by_short + by_long)
    assert trials.mean_covariance(-half, half, by_short, by_long) == pytest.approx(mean.T @ mean)


def test_what_noise_hides_is_refused():
    """It is said why, and what helps on any machine."""
    with pytest.raises(
        DataError, match=r"8\d\..* of the vibration stays unexplained, .* heavier trial masses, or add runs of a m"
    ):
        measured(0, noise=100.0 * NOISE)
