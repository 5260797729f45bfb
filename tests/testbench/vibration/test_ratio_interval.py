"""Ratios of amplitudes in noise: the truth without noise, coverage with, and what cannot be told."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm, ttest_ind

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


def amplitude(signal, sigma: float, rng, measure: Measure, step: float = 0.0) -> Amplitude:
    """A record of a signal in white noise."""
    values = signal + sigma * rng.normal(size=len(signal))
    if step:
        values = np.round(values / step) * step
    return Amplitude(values, RATE, measure, Noise.of(values[:280], RATE, step))


def ratio(with_size: float, without: float, sigma: float, rng, measure: Measure, repeats: int = 1) -> Ratio:
    """Of two sizes in noise."""
    return judged(
        *([amplitude(s, sigma, rng, measure) for _ in range(repeats)] for s in (with_size * ROCKED, without * MOVED))
    )


def judged(balanced: list[Amplitude], unbalanced: list[Amplitude]) -> Ratio:
    """Of the runs of a campaign of one condition."""
    groups = [Group(tuple(map(AmplitudeLikelihood.of, runs))) for runs in (balanced, unbalanced)]
    scatter = Repeatability.of(groups)
    return Ratio(*(ConditionAmplitude(group, scatter) for group in groups))


@pytest.mark.parametrize("repeats", [1, 2])
@pytest.mark.parametrize("metric", METRICS)
def test_without_noise(metric, repeats):
    """Without noise the ratio is that of the amplitudes, and its interval has hardly any width."""
    measure, rng = Measure(metric, BAND), np.random.default_rng(0)
    found = ratio(1.0, 4.0, 0.0, rng, measure, repeats)
    truth = measure.amplitude(ROCKED, RATE) / measure.amplitude(4.0 * MOVED, RATE)
    assert found.value == pytest.approx(truth, rel=1e-5)
    assert found.interval == pytest.approx((truth, truth), rel=2e-5)
    assert not found.below_noise


@pytest.mark.parametrize(
    ("metric", "size"), [(metric, size) for metric in METRICS for size in (0.0, 2.0, 40.0)]
)  # fmt: skip
def test_coverage(metric, size):
    """Of 10 intervals 95 % hold the truth: nothing left, something near the noise, and much."""
    measure, held = Measure(metric, BAND), 0
    truth = measure.amplitude(size * ROCKED, RATE) / measure.amplitude(60.0 * MOVED, RATE)
    for seed in range(10):
        found = ratio(size, 60.0, 1.0, np.random.default_rng(seed), measure)
        low, high = found.interval
        held += low <= truth <= high
        assert found.accepts(truth) == (low <= truth <= high)
    assert_holds(held, 10)


@pytest.mark.parametrize("repeats", [2, 3])
def test_coverage_of_repeats(repeats):
    """Repeats that differ by 5 % in truth: their scatter is in the interval, which one run's noise knows nothing of."""
    measure, held, alone = Measure("rms", BAND), 0, 0
    truth = measure.amplitude(ROCKED, RATE) / measure.amplitude(4.0 * MOVED, RATE)
    for seed in range(10):
        rng = np.random.default_rng([seed, repeats])
        runs = [
            [amplitude(s * (1.0 + 0.05 * rng.normal()), 0.003, rng, measure) for _ in range(repeats)]
            for s in (ROCKED, 4.0 * MOVED)
        ]
        low, high = judged(*runs).interval
        held += low <= truth <= high
        low, high = judged(runs[0][:1], runs[1][:1]).interval
        alone += low <= truth <= high
    assert_holds(held, 10)
    assert alone < 5


@pytest.mark.parametrize("known", [True, False])
def test_repeats_against_scipy(known):
    """Far above the noise the interval of the repeats of one condition is Welch's, of the logarithms.

    The scatter of each side is its own where nothing is known of the noise, or where it is what the two components
    allow: by its share no larger on the side that is further above the noise. The components' variances are larger by 1
    in so many degrees of freedom as there are, and what the rest of each run shows of the noise is not quite the same.
    """
    measure, rng = Measure("peak", BAND), np.random.default_rng(5)
    sizes = [0.99, 1.0, 1.012], [3.98, 4.0, 4.03, 4.01]
    runs = [[amplitude(s * MOVED, 1e-4, rng, measure) for s in some] for some in sizes]
    logs = [np.log([run.reading for run in some]) for some in runs]
    if known:
        found, larger, within = judged(*runs).interval, 1.0 + 1.0 / sum(len(some) - 1 for some in logs), 2e-3
    else:
        deaf = [Group(tuple(AmplitudeLikelihood.of(replace(run, noise=None)) for run in some)) for some in runs]
        found, larger, within = (
            Ratio(*(ConditionAmplitude(group, own_scatter=True) for group in deaf)).interval,
            1.0,
            1e-6,
        )
    between = ttest_ind(*logs, equal_var=False).confidence_interval(0.95)
    middle, half = (between.high + between.low) / 2.0, (between.high - between.low) / 2.0 * larger**0.5
    assert found == pytest.approx((np.exp(middle - half), np.exp(middle + half)), rel=within)


def test_noise_is_taken_off():
    """The RMS of 12 records near the noise is not inflated by it: on average it is the truth."""
    measure = Measure("rms", BAND)
    read = [amplitude(3.0 * ROCKED, 1.0, np.random.default_rng(s), measure) for s in range(12)]
    squares = [ConditionAmplitude(Group((AmplitudeLikelihood.of(r),))).amplitude ** 2 for r in read]
    assert np.mean(squares) == pytest.approx(measure.amplitude(3.0 * ROCKED, RATE) ** 2, rel=0.1)
    assert np.mean([r.reading for r in read]) > 1.3 * measure.amplitude(3.0 * ROCKED, RATE) ** 2
    assert np.mean([ConditionAmplitude(Group((AmplitudeLikelihood.of(r),))).floor for r in read]) == pytest.approx(
        SIGMA, rel=0.05
    )


def test_nothing_moves():
    """Where nothing vibrates above the noise without counter-masses, any ratio goes: none is given."""
    found = [ratio(0.0, 0.0, 1.0, np.random.default_rng(s), Measure("rms", BAND)) for s in range(10)]
    assert sum(f.interval is None for f in found) >= 8


def test_coarse_steps():
    """Steps far above the noise are in the interval: it is as wide as their noise asks, and holds the truth."""
    measure, rng = Measure("rms", BAND), np.random.default_rng(7)
    low, high = judged(*([amplitude(s, 1e-4, rng, measure, step=0.2)] for s in (ROCKED, 4.0 * MOVED))).interval
    truth = measure.amplitude(ROCKED, RATE) / measure.amplitude(4.0 * MOVED, RATE)
    assert low < truth < high
    assert 1e-3 < high - low < 0.05


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
