"""Alignment by what both saw: precise, with intervals that hold, and refused where the data do not determine it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from testbench.errors import AnalysisError
from testbench.synchronization import coarse_lag
from testbench.synchronization.offset_and_drift import by_correlation

from ..coverage import assert_holds
from .loggers import DRIFT, OFFSET, pair, plain, wave


def error(clock, own):
    """Of an own instant's time on the reference's clock [s]."""
    return float(clock.to_reference(np.array([own]))[0]) - (OFFSET + (1.0 + DRIFT) * own)


@pytest.mark.parametrize("seed", range(3))
def test_offset_drift_and_jitter(seed):
    """0.6 s offset, 30 ppm drift and 1 ms jitter: aligned to 0.1 ms over the whole record."""
    clock = by_correlation(pair(seed)).clock
    assert max(abs(error(clock, own)) for own in clock.span) < 1e-4


def test_intervals_hold():
    """Intervals of offset and drift hold the truth as often as 95 % promises, over seeds."""
    clocks = [by_correlation(pair(seed, seconds=10.0, noise=0.1)).clock for seed in range(10)]
    assert_holds(sum(c.offset_interval[0] <= OFFSET <= c.offset_interval[1] for c in clocks), len(clocks))
    assert_holds(sum(c.drift_interval[0] <= DRIFT <= c.drift_interval[1] for c in clocks), len(clocks))
    assert_holds(sum(abs(error(c, 5.0)) <= c.half_width(5.0) for c in clocks), len(clocks))


def test_noise_on_both_sides_does_not_bias():
    """Half as much noise as signal, on both: the mean error over seeds is within its own standard error."""
    errors = [error(by_correlation(pair(seed, 10.0, 0.0, 0.5)).clock, 5.0) for seed in range(6)]
    assert abs(np.mean(errors)) < 3.0 * np.std(errors) / np.sqrt(len(errors))


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.5])
def test_a_pure_sine_is_ambiguous(noise):
    """A sine through the whole record fits at every period: refused by name, with noise or without."""
    rng, t = np.random.default_rng(0), np.arange(20_000) / 1000.0
    one, other = (np.sin(2 * np.pi * 7.3 * (t + s)) + noise * rng.normal(size=len(t)) for s in (0.0, 0.6))
    with pytest.raises(
        AnalysisError, match=r"ambiguous: .*(explains about|a --cutoff below 200 Hz leaves out .*; else)"
    ):
        by_correlation(plain(one, other))


def test_a_lower_cutoff_leaves_out_what_one_side_holds():
    """A sine from rest to rest on a frame that rings: refused with what helps, and that helps."""
    rng, t = np.random.default_rng(0), np.arange(8000) / 1000.0
    move = lambda s: np.where((s > 1.5) & (s < 6.5), np.sin(6.0 * np.pi * (s - 1.5)), 0.0)  # noqa: E731
    ring = lfilter(*butter(2, [0.076, 0.084], "band"), rng.normal(size=len(t) + 200))[200:]
    shared = plain(move(t + 0.6), move(t) + 0.3 * ring / ring.std())
    with pytest.raises(AnalysisError, match="a --cutoff below 200 Hz leaves out vibration and noise that one side"):
        by_correlation(shared, drift=False)
    clock = by_correlation(replace(shared, cutoff=15.0), drift=False).clock
    assert float(clock.to_reference(np.array([3.0]))[0]) == pytest.approx(2.4, abs=1e-3)


def test_a_sine_with_its_beginning_is_not():
    """A few periods of the same sine, from rest to rest within both records, are determined."""
    t = np.arange(20_000) / 1000.0
    signal = lambda s: np.sin(2 * np.pi * 7.3 * s) * np.exp(-(((s - 8.0) / 0.2) ** 2))  # noqa: E731
    rng = np.random.default_rng(0)
    one, other = (signal(t + s) + 0.01 * rng.normal(size=len(t)) for s in (0.0, 0.6))
    clock = by_correlation(plain(one, other), drift=False).clock
    assert float(clock.to_reference(np.array([7.4]))[0]) == pytest.approx(8.0, abs=3e-4)


@pytest.mark.parametrize("seed", range(4))
def test_nothing_in_common_is_refused(seed):
    """Two independent noises have no lag."""
    one, other = np.random.default_rng(seed).normal(size=(2, 20_000))
    with pytest.raises(AnalysisError, match="no common content"):
        by_correlation(plain(one, other))


def test_too_short_for_a_drift():
    """A third of a second tells an offset and no drift: refused, the offset alone is given with a drift assumed."""
    short = pair(1, seconds=0.95)
    with pytest.raises(AnalysisError, match="too short for a drift"):
        by_correlation(short)
    clock = by_correlation(short, drift=False).clock
    assert abs(error(clock, clock.at_own)) <= clock.half_width(clock.at_own) < 1e-3
    assert clock.drift_interval[0] < DRIFT < clock.drift_interval[1]


def test_a_channel_that_rests_is_refused():
    """Zeros on one side: nothing that both saw."""
    with pytest.raises(AnalysisError, match="never changes"):
        by_correlation(plain(np.zeros(1000), np.random.default_rng(0).normal(size=1000)))


def test_long_records_with_drift():
    """80 ppm over five minutes smear any single lag by 24 ms: growing stretches follow it all the same."""
    rng, signal = np.random.default_rng(3), wave(3, 20.0)
    t, rate = np.arange(0.0, 300.0, 0.005), 200.0
    own = signal(20.0 + (1 + 80e-6) * t[: -int(20 * rate) - 20]) + 0.02 * rng.normal(size=len(t) - int(20 * rate) - 20)
    clock = by_correlation(plain(signal(t) + 0.02 * rng.normal(size=len(t)), own, rate)).clock
    assert clock.offset == pytest.approx(20.0, abs=1e-4)
    assert clock.drift == pytest.approx(80e-6, abs=1e-6)


def test_a_white_residual_has_half_its_samples_independent():
    """The logarithm of its mean square scatters by sqrt(4 / n): by the power of each frequency, not its amplitude."""
    rng, whole = np.random.default_rng(1), (np.ones(4000), np.ones(4000))
    scatter = coarse_lag._scatter([rng.normal(size=(4000, 1))], rng.normal(size=(4000, 1)), 0, whole)
    assert scatter == pytest.approx((4.0 / 4000.0) ** 0.5, rel=0.05)  # by amplitudes: 20 % less
