"""The compiled filter is scipy's, forwards and backwards."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from testbench.signal import filters
from testbench.signal.filters import Band

RATE = 10_000.0


@pytest.mark.parametrize("count", [1, 4, 6])
@pytest.mark.parametrize("band", [Band(0.0, 200.0), Band(30.0, 400.0)])
def test_same_as_scipy(count, band, monkeypatch):
    """A low-pass and a band-pass of one, four and six channels agree to 1e-11 of the largest value."""
    monkeypatch.setattr(filters, "WORTH", 1)
    channels = np.random.default_rng(count).normal(size=(count, 9001)).cumsum(axis=1) + 50.0
    edges, kind = ((30.0, 400.0), "bandpass") if band.low_hz else (200.0, "lowpass")
    sections = butter(4, edges, kind, fs=RATE, output="sos")
    padding = round(4.0 * RATE / (band.low_hz or band.high_hz))
    expected = sosfiltfilt(sections, channels, padtype="even", padlen=padding)
    found = band.of(channels, RATE)
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
    assert np.array_equal(found[0], band.of(channels[0], RATE))
    assert np.array_equal(band.of(channels, RATE, in_place=True), found)
    assert np.array_equal(channels, found)


def test_two_threads_give_the_same_bits(monkeypatch):
    """Channels do not depend on who filters them."""
    monkeypatch.setattr(filters, "WORTH", 1)
    channels = np.random.default_rng(0).normal(size=(7, 5000))
    alone = Band(0.0, 100.0).of(channels, RATE)
    monkeypatch.setattr(filters, "WORTH_A_THREAD", 1)
    assert np.array_equal(alone, Band(0.0, 100.0).of(channels, RATE))


def test_an_odd_number_of_sections(monkeypatch):
    """Of order 2 there is one section alone."""
    monkeypatch.setattr(filters, "WORTH", 1)
    channels = np.random.default_rng(1).normal(size=(3, 4000))
    sections = butter(2, 80.0, fs=RATE, output="sos")
    expected = sosfiltfilt(sections, channels, padtype="even", padlen=500)
    assert np.abs(filters.zero_phase(sections, channels, 500) - expected).max() < 1e-12
