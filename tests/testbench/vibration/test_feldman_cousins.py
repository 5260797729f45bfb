"""Intervals at a bound: printed values, and coverage where an interval cut off at zero fails."""

import numpy as np
import pytest
from scipy.stats import norm

from testbench.vibration.feldman_cousins import feldman_cousins_acceptance


@pytest.mark.parametrize("mean", [0.5, 1.0, 3.0])
def test_accepted(mean):
    """Ends are of equal likelihood ratio, against the likeliest mean that is not negative, and hold 95 %."""
    low, high = (float(end[0]) + mean for end in feldman_cousins_acceptance(np.array([mean])))
    assert norm.cdf(high - mean) - norm.cdf(low - mean) == pytest.approx(0.95, abs=2e-4)
    ratios = [norm.pdf(x - mean) / norm.pdf(x - max(x, 0.0)) for x in (low, high)]
    assert ratios[0] == pytest.approx(ratios[1], rel=2e-3)


@pytest.mark.parametrize("mean", [0.0, 0.3, 1.0, 2.5])
def test_coverage(mean):
    """Every mean is held 95 times in 100, also near zero; cut off at zero and never empty, none would be."""
    low, high = feldman_cousins_acceptance(np.array([mean]))
    off = np.random.default_rng(3).normal(size=200_000)
    held = np.mean((off >= low[0]) & (off <= high[0]))
    assert held == pytest.approx(0.95, abs=0.002)


def test_nothing():
    """Of a mean of zero every low reading speaks, and 5 % of the high ones do not."""
    low, high = feldman_cousins_acceptance(np.zeros(1))
    assert low[0] < -1000.0
    assert high[0] == pytest.approx(1.645, abs=1e-3)


def test_far_from_the_bound():
    """Where zero is far the interval is the usual one."""
    low, high = feldman_cousins_acceptance(np.array([2.0, 5.0]))
    assert low == pytest.approx([-1.96, -1.96], abs=1e-3)
    assert high == pytest.approx([1.96, 1.96], abs=1e-3)
