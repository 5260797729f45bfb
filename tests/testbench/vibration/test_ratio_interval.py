"""Ratios of amplitudes in noise: the truth without noise, coverage with, and what cannot be told."""

import numpy as np
import pytest
from scipy.stats import norm

from testbench.signal.filters import Band
from testbench.vibration import Amplitude, AmplitudeLikelihood, ConditionAmplitude, Group, Noise, Ratio, Repeatability
from testbench.vibration.metrics import METRICS, Measure
from testbench.vibration.ratio_interval import feldman_cousins_acceptance

from ..coverage import assert_holds

RATE, BAND = 1000.0, Band(0.0, 100.0)
TIME = np.arange(900) / RATE
MOVED = (TIME > 0.3) * np.sin(2 * np.pi * 9.0 * TIME) * np.exp(-3.0 * (TIME - 0.3))
"""A rest of 0.3 s, then a decaying swing."""
ROCKED = (TIME > 0.35) * np.sin(2 * np.pi * 23.0 * TIME) * np.exp(-5.0 * (TIME - 0.35))
"""Of another course."""
SIGMA = np.sqrt(0.2 * 0.875 * (np.pi / 8) / np.sin(np.pi / 8))
"""Of noise of standard deviation 1 in the band: the integral of (1 + x^8)^-2, 100 Hz of 500."""


def judged(balanced: list[np.ndarray], unbalanced: list[np.ndarray], measure: Measure) -> Ratio:
    """Of records of one condition, in the noise of all their rests."""
    sides = [Amplitude.of(np.array(side), RATE, measure, (0.0, 0.28)) for side in (balanced, unbalanced)]
    noise = Noise.of([run.resting for side in sides for run in side], 1e-18)
    groups = [Group(tuple(AmplitudeLikelihood.of(run, noise) for run in side)) for side in sides]
    scatter = Repeatability.of(groups)
    return Ratio(*(ConditionAmplitude(group, scatter) for group in groups))


def ratio(with_size: float, without: float, sigma: float, rng, measure: Measure, repeats: int = 1) -> Ratio:
    """Of two sizes in white noise."""
    sides = (
        [s + sigma * rng.normal(size=len(s)) for _ in range(repeats)] for s in (with_size * ROCKED, without * MOVED)
    )
    return judged(*sides, measure)


@pytest.mark.parametrize("repeats", [1, 2])
@pytest.mark.parametrize("metric", METRICS)
def test_without_noise(metric, repeats):
    """Without noise the ratio is that of the amplitudes, and its interval has hardly any width."""
    measure, rng = Measure(metric, BAND), np.random.default_rng(0)
    found = ratio(1.0, 4.0, 0.0, rng, measure, repeats)
    truth = measure.amplitude(ROCKED, RATE) / measure.amplitude(4.0 * MOVED, RATE)
    assert found.value == pytest.approx(truth, rel=1e-3)
    assert found.interval == pytest.approx((truth, truth), rel=1e-2)
    assert not found.below_noise


@pytest.mark.parametrize(("metric", "size"), [(metric, size) for metric in METRICS for size in (0.0, 2.0, 40.0)])
def test_coverage(metric, size):
    """Of 8 intervals 95 % hold the truth: nothing left, something near the noise, and much."""
    measure, held = Measure(metric, BAND), 0
    truth = measure.amplitude(size * ROCKED, RATE) / measure.amplitude(60.0 * MOVED, RATE)
    for seed in range(8):
        found = ratio(size, 60.0, 1.0, np.random.default_rng(seed), measure)
        low, high = found.interval
        held += low <= truth <= high
        assert found.accepts(truth) == (low <= truth <= high)
    assert_holds(held, 8)


@pytest.mark.parametrize("repeats", [2, 3])
def test_coverage_of_repeats(repeats):
    """Repeats that differ by 5 % in truth: their scatter is in the interval, which one run's noise knows nothing of."""
    measure, held, alone = Measure("peak", BAND), 0, 0
    truth = measure.amplitude(ROCKED, RATE) / measure.amplitude(4.0 * MOVED, RATE)
    for seed in range(10):
        rng = np.random.default_rng([seed, repeats])
        runs = [
            [s * (1.0 + 0.05 * rng.normal()) + 0.003 * rng.normal(size=len(s)) for _ in range(repeats)]
            for s in (ROCKED, 4.0 * MOVED)
        ]
        low, high = judged(*runs, measure).interval
        held += low <= truth <= high
        low, high = judged(runs[0][:1], runs[1][:1], measure).interval
        alone += low <= truth <= high
    assert_holds(held, 10)
    assert alone < 5


def test_noise_is_taken_off():
    """The RMS of 12 records near the noise is not inflated by it: on average it is the truth."""
    measure = Measure("rms", BAND)
    size = measure.amplitude(3.0 * ROCKED, RATE)
    found = [ratio(3.0, 60.0, 1.0, np.random.default_rng(seed), measure).balanced for seed in range(12)]
    assert np.mean([side.amplitude**2 for side in found]) == pytest.approx(size**2, rel=0.15)
    assert np.mean([side.runs[0].reading for side in found]) > 1.3 * size**2
    assert np.mean([side.floor for side in found]) == pytest.approx(SIGMA, rel=0.05)


def test_nothing_moves():
    """Where nothing vibrates above the noise without counter-masses, any ratio goes: none is given."""
    found = [ratio(0.0, 0.0, 1.0, np.random.default_rng(s), Measure("rms", BAND)) for s in range(10)]
    assert sum(f.interval is None for f in found) >= 8


@pytest.mark.parametrize("mean", [0.5, 1.0, 3.0])
def test_acceptance_by_likelihood_ratio(mean):
    """Ends are of equal likelihood ratio, against the likeliest mean that is not negative, and hold 95 %."""
    low, high = (float(end[0]) + mean for end in feldman_cousins_acceptance(np.array([mean])))
    assert norm.cdf(high - mean) - norm.cdf(low - mean) == pytest.approx(0.95, abs=2e-4)
    ratios = [norm.pdf(x - mean) / norm.pdf(x - max(x, 0.0)) for x in (low, high)]
    assert ratios[0] == pytest.approx(ratios[1], rel=2e-3)


@pytest.mark.parametrize("mean", [0.0, 0.3, 1.0, 2.5])
def test_acceptance_covers(mean):
    """Every mean is held 95 times in 100, also near zero; cut off at zero and never empty, none would be."""
    low, high = feldman_cousins_acceptance(np.array([mean]))
    off = np.random.default_rng(3).normal(size=200_000)
    held = np.mean((off >= low[0]) & (off <= high[0]))
    assert held == pytest.approx(0.95, abs=0.002)


def test_acceptance_of_zero():
    """Of a mean of zero every low reading speaks, and 5 % of the high ones do not."""
    low, high = feldman_cousins_acceptance(np.zeros(1))
    assert low[0] < -1000.0
    assert high[0] == pytest.approx(1.645, abs=1e-3)


def test_far_from_the_bound():
    """Where zero is far the interval is the usual one."""
    low, high = feldman_cousins_acceptance(np.array([2.0, 5.0]))
    assert low == pytest.approx([-1.96, -1.96], abs=1e-3)
    assert high == pytest.approx([1.96, 1.96], abs=1e-3)
