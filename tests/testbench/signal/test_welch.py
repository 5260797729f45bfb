"""Densities in blocks are those of scipy, and of the physics."""

import numpy as np
import pytest
from scipy import signal

from testbench.errors import AnalysisError
from testbench.signal.welch import welch

RATE = 2000.0


@pytest.fixture(scope="module")
def noise():
    """Two channels that share something, with large means."""
    common, own = np.random.default_rng(5).normal(size=(2, 100_001))
    return [common + 40.0, 0.5 * np.roll(common, 3) + own - 7.0]


@pytest.mark.parametrize("worth", [1, 1 << 40])
@pytest.mark.parametrize("segment", [64, 500, 4096])
def test_same_as_scipy(noise, segment, worth, monkeypatch):
    """Compiled or not, densities are scipy's to 1e-12 of the value or of the two powers, also where a tail is left."""
    monkeypatch.setattr("testbench.signal.welch.COMPILED_FROM_SAMPLES", worth)
    found = welch(noise, RATE, segment)
    for channel, values in enumerate(noise):
        frequency, power = signal.welch(values, RATE, nperseg=segment)
        assert found.frequency == pytest.approx(frequency, rel=1e-14)
        assert np.abs(found.power(channel) / power - 1.0).max() < 1e-12
    cross = signal.csd(*noise, RATE, nperseg=segment)[1]
    scale = np.sqrt(found.power(0) * found.power(1))
    assert np.abs((found.density[0, 1] - cross) / scale).max() < 1e-12
    assert np.array_equal(found.density[1, 0], found.density[0, 1].conj())


def test_two_threads_add_up_to_one(noise, monkeypatch):
    """Shared among threads, the sums are the same to rounding."""
    alone = welch(noise, RATE, 512)
    monkeypatch.setattr("testbench.signal.welch.THREADED_FROM_SAMPLES", 1)
    shared = welch(noise, RATE, 512)
    assert np.abs(shared.density / alone.density - 1.0).max() < 1e-12


def test_the_integral_is_the_variance(noise):
    """Parseval: the area under a density is the mean square."""
    found = welch([noise[0]], RATE, 1024)
    assert found.power().sum() * found.frequency[1] == pytest.approx(np.var(noise[0]), rel=0.01)


def test_a_sine_stands_at_its_frequency():
    """Amplitude 3 at 126 Hz: mean square 4.5 in the lines about it."""
    values = 3.0 * np.sin(2 * np.pi * 126.0 * np.arange(20_000) / RATE)
    found = welch([values], RATE, 1000)
    near = np.abs(found.frequency - 126.0) < 7.0
    assert found.frequency[found.power().argmax()] == 126.0
    assert found.power()[near].sum() * found.frequency[1] == pytest.approx(4.5, rel=1e-9)


def test_segments_that_overlap_tell_less_than_they_count():
    """The scatter of the density of white noise is that of the independent segments."""
    random = np.random.default_rng(1)
    powers = np.array([welch([random.normal(size=64 * 50)], RATE, 64).power()[5:-5] for _ in range(300)])
    relative = powers.std(axis=0) / powers.mean(axis=0)
    expected = 1.0 / np.sqrt(welch([np.zeros(64 * 50)], RATE, 64).independent)
    assert np.sqrt(np.mean(relative**2)) == pytest.approx(expected, rel=0.03)


def test_what_cannot_be_averaged_is_refused():
    """Channels of two lengths, and records shorter than a segment, are named."""
    with pytest.raises(AnalysisError, match=r"\[100, 200\]"):
        welch([np.zeros(100), np.zeros(200)], RATE, 64)
    with pytest.raises(AnalysisError, match="segments of 4096"):
        welch([np.zeros(100)], RATE)
