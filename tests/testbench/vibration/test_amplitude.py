"""Swings of a course: their heights if the largest is another, and how often intervals by that rule hold."""

from itertools import product

import numpy as np
import pytest
from scipy.signal import detrend
from scipy.special import ndtr

from testbench.vibration.amplitude import Amplitude, ConstrainedPeaks
from testbench.vibration.amplitude_likelihood import AmplitudeLikelihood
from testbench.vibration.condition import noise_behind_steps
from testbench.vibration.metrics import Measure
from testbench.vibration.noise_floor import Noise

SWINGS = np.array([0.0, 1.0, 0.0, -3.0, -1.0, -2.0, 0.0, 2.5, 0.5])
"""Heights 1, 3, 2 (behind a saddle at 1) and 2.5."""


def test_as_estimated():
    """With the largest as estimated, the course is as estimated."""
    assert ConstrainedPeaks(SWINGS).with_peaks(np.array([3.0]))[1][0] == pytest.approx(SWINGS)
    assert ConstrainedPeaks(SWINGS).with_peak_to_peaks(np.array([5.5]))[1][0] == pytest.approx(SWINGS)


def test_lower():
    """If the largest is less, all that are higher are just as high as it, and the others stay."""
    found = np.abs(ConstrainedPeaks(SWINGS).with_peaks(np.array([2.2]))[1][0])
    assert [found[i] for i in (1, 3, 5, 7)] == pytest.approx([1.0, 2.2, 2.0, 2.2])


def test_higher():
    """If the largest is more, that one alone is higher."""
    found = ConstrainedPeaks(SWINGS).with_peaks(np.array([4.0]))[1][0]
    assert [found[i] for i in (1, 3, 5, 7)] == pytest.approx([1.0, -4.0, -2.0, 2.5])


@pytest.mark.parametrize("span", [0.0, 0.4, 3.0, 5.5, 9.0])
def test_span(span):
    """Both ends share what the span is more or less; neither passes zero."""
    found = ConstrainedPeaks(SWINGS).with_peak_to_peaks(np.array([span]))[1][0]
    assert np.ptp(found) == pytest.approx(span)
    assert found.max() >= 0.0 >= found.min()
    if span > 1.0:
        assert found.max() == pytest.approx(2.5 + (span - 5.5) / 2.0)


def test_highest_alone():
    """One swing alone takes the whole span; of nothing there is no swing."""
    alone = ConstrainedPeaks(SWINGS).above(np.inf, both=False)
    assert np.flatnonzero(alone.with_peaks(np.array([1.0]))[1][0]).tolist() == [3]
    assert np.ptp(alone.with_peak_to_peaks(np.array([2.0]))[1][0]) == pytest.approx(2.0)
    assert not ConstrainedPeaks(np.zeros(9)).with_peaks(np.array([1.0]))[1][0].any()


@pytest.mark.parametrize("known", [0.3, 0.6])
@pytest.mark.parametrize(("count", "gap"), [(1, 0.0), *product((2, 3, 10), (0.0, 1.0, 2.0, 4.0))])
def test_rule(known, count, gap):
    """The rule on swings apart from each other, in Gaussian noise: it holds a largest value 93 to 98 times in 100.

    The others are by ``gap`` lower, and all heights known to ``known``, both in standard deviations of the noise.
    """
    rng = np.random.default_rng([count, int(10 * gap)])
    heights = 20.0 - np.r_[0.0, np.full(count - 1, gap)]
    estimated = heights + known * rng.normal(size=(1000, count))
    read = (estimated + np.sqrt(1.0 - known**2) * rng.normal(size=estimated.shape)).max(axis=1)
    course = np.zeros(2 * count + 1)
    scores = np.empty(len(read))
    for i, (some, reading) in enumerate(zip(estimated, read, strict=True)):
        course[1::2] = some
        likeliest = ConstrainedPeaks(course).with_peaks(np.array([20.0]))[1][0][1::2]
        scores[i] = ndtr(reading - likeliest).prod()
    assert 0.93 <= np.mean(np.abs(scores - 0.5) <= 0.475) <= 0.985


@pytest.mark.parametrize("metric", ["peak", "peak_to_peak"])
def test_all_swings_tell_that_it_is_no_smaller(metric):
    """Noise that is loud at times may have made one swing so high, but not twenty where it is calm."""
    time, noise, found = np.arange(2000) / 1000.0, Noise.stated(1.5, 1000.0), []
    loud = np.where(time < 0.3, 1.0, 0.1)
    for cycles in (1, 20):
        course = 3.0 * np.sin(2 * np.pi * 20.0 * time) * ((time >= 0.5) & (time < 0.5 + cycles / 20.0))
        read = Measure(metric).amplitude(course, 1000.0)
        one = Amplitude(Measure(metric), 2.0, read, course, course, envelope=loud)
        found.append(float(AmplitudeLikelihood.of(one, noise).deviation(np.array([0.6 * read]))[0]))
    assert abs(found[0]) < 3.0 < found[1]


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("reach", [0.0, 0.6, 10.0])
@pytest.mark.parametrize("metric", ["with_peaks", "with_peak_to_peaks"])
def test_swings_within_reach(metric, reach, sign):
    """What is left out lies lower than the largest value by more than the reach; the rest is as it is of all."""
    course = np.random.default_rng(1).normal(size=400) * np.hanning(400)
    signals = getattr(ConstrainedPeaks(course), metric)
    _, whole = signals(sizes := np.array([1.5, 2.0, 4.0]), sign)
    samples, near = signals(sizes, sign, reach)
    np.testing.assert_array_equal(near, whole[:, samples])
    left_out = np.setdiff1d(np.arange(400), samples)
    assert (whole[:, left_out] <= whole.max(axis=1, keepdims=True) - reach).all()
    assert len(left_out) > 200 or reach == 10.0


@pytest.mark.parametrize("metric", ["peak", "peak_to_peak", "rms"])
@pytest.mark.parametrize("steps", [3.0, 10.0, 40.0])
def test_rounding_without_dither(metric, steps):
    """What steps do to a reading is told by the record that they made, whose plateaus are not those of the signal."""
    measure, rng, time = Measure(metric), np.random.default_rng(2), np.arange(0.0, 1.5, 1e-3)
    moving = time > 0.3
    signal = steps * moving * sum(np.sin(2 * np.pi * f * time + f) * np.exp(-4.0 * (time - 0.3)) for f in (7.3, 31.0))
    records = np.array([np.round(signal + rng.uniform(-0.5, 0.5)) for _ in range(30)])
    runs = Amplitude.of(records, 1000.0, measure, (0.0, 0.25), (0.3, 1.5), [1.0] * len(records))
    done = np.std([one.reading for one in runs])
    told = np.sqrt(np.mean([np.var(one.rounding) for one in runs]))
    assert 0.6 < told / done < 1.7
    assert all(one.hidden_density == one.step_density / 9.0 for one in runs)


@pytest.mark.parametrize("noise", [0.03, 0.1, 0.2])
def test_noise_that_does_not_dither(noise):
    """Rests toggle where the zero lies near a threshold, with a power that tells little of how large the noise is."""
    rng, told, toggled, rate = np.random.default_rng(9), [], [], 1000.0
    for _ in range(40):
        rests = [np.round(noise * rng.standard_normal(600) + rng.uniform(-0.5, 0.5)) for _ in range(6)]
        motion = 20.0 * np.sin(2 * np.pi * 9.0 * np.arange(600) / rate)
        records = np.array([np.concatenate([rest, np.round(motion)]) for rest in rests])
        runs = Amplitude.of(records, rate, Measure("peak"), (0.0, 0.6), (0.6, 1.2), [1.0] * 6)
        if all(one.toggles is not None for one in runs):
            density, segments = noise_behind_steps(runs)
            told.append(density * rate / 2.0)
            toggled.append(max(float(rest.var()) for rest in rests))
            assert max(float(detrend(one.values).var()) for one in segments) < 1.6 * told[-1]
    assert 0.3 < np.median(told) ** 0.5 / noise < 2.5
    assert np.median(toggled) > 5.0 * np.median(told)
