"""Bands and lags against closed forms; the compiled filter against scipy's, forwards and backwards."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from testbench.errors import AnalysisError
from testbench.signal import filters
from testbench.signal.filters import Band, correlation_lag, without_mean

RATE = 2000.0
FAST_RATE = 10_000.0
TIME = np.arange(8000) / RATE


def test_band_keeps_and_cuts():
    """What lies inside the band passes unchanged and in phase, what lies outside is gone."""
    inside, outside = np.sin(2 * np.pi * 20 * TIME), np.sin(2 * np.pi * 600 * TIME)
    middle = slice(2000, 6000)
    assert Band(0.0, 100.0).filtered(inside + outside, RATE)[middle] == pytest.approx(inside[middle], abs=1e-4)
    assert Band(2.0, 100.0).filtered(inside + outside + 3.0, RATE)[middle] == pytest.approx(inside[middle], abs=1e-2)


def test_band_halves_its_edge():
    """At its edge a zero-phase band of the stated order passes half of the amplitude."""
    found = Band(0.0, 100.0).filtered(np.cos(2 * np.pi * 100 * TIME), RATE)[2000:6000]
    assert np.ptp(found) / 2 == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize(("low", "high"), [(-1.0, 5.0), (5.0, 5.0), (0.0, np.inf), (0.0, np.nan)])
def test_no_band(low, high):
    """Ends that make no band are refused."""
    with pytest.raises(AnalysisError, match="band"):
        Band(low, high)


def test_band_above_the_rate():
    """A band that the rate cannot show is refused with both numbers."""
    with pytest.raises(AnalysisError, match="400 samples a second, the record has 100"):
        Band(0.0, 200.0).filtered(TIME, 100.0)


def test_record_too_short():
    """A record that is too short for the filter is refused."""
    with pytest.raises(AnalysisError, match="too few"):
        Band(0.0, 200.0).filtered(TIME[:9], RATE)


@pytest.mark.parametrize("shift", [0.0, 0.1, -0.0371])
def test_lag(shift):
    """A pulse that comes later is found later, to a tenth of a sample, also between samples."""
    early = np.exp(-(((TIME - 2.0) / 0.05) ** 2))
    late = np.exp(-(((TIME - 2.0 - shift) / 0.05) ** 2))
    assert correlation_lag(late, early, RATE) == pytest.approx(shift, abs=0.1 / RATE)


def test_offset():
    """The mean is gone and nothing else."""
    values = np.array([1.0, 2.0, 6.0])
    assert without_mean(values) == pytest.approx(values - 3.0)


@pytest.mark.parametrize("count", [1, 4, 6])
@pytest.mark.parametrize("band", [Band(0.0, 200.0), Band(30.0, 400.0)])
def test_same_as_scipy(count, band, monkeypatch):
    """A low-pass and a band-pass of one, four and six channels agree to 1e-11 of the largest value."""
    monkeypatch.setattr(filters, "COMPILED_FROM_SAMPLES", 1)
    channels = np.random.default_rng(count).normal(size=(count, 9001)).cumsum(axis=1) + 50.0
    edges, kind = ((30.0, 400.0), "bandpass") if band.low_hz else (200.0, "lowpass")
    sections = butter(4, edges, kind, fs=FAST_RATE, output="sos")
    padding = round(4.0 * FAST_RATE / (band.low_hz or band.high_hz))
    expected = sosfiltfilt(sections, channels, padtype="even", padlen=padding)
    found = band.filtered(channels, FAST_RATE)
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
    assert np.array_equal(found[0], band.filtered(channels[0], FAST_RATE))
    assert np.array_equal(band.filtered(channels, FAST_RATE, in_place=True), found)
    assert np.array_equal(channels, found)


def test_two_threads_give_the_same_bits(monkeypatch):
    """Channels do not depend on who filters them."""
    monkeypatch.setattr(filters, "COMPILED_FROM_SAMPLES", 1)
    channels = np.random.default_rng(0).normal(size=(7, 5000))
    alone = Band(0.0, 100.0).filtered(channels, FAST_RATE)
    monkeypatch.setattr(filters, "THREADED_FROM_SAMPLES", 1)
    assert np.array_equal(alone, Band(0.0, 100.0).filtered(channels, FAST_RATE))


def test_an_odd_number_of_sections(monkeypatch):
    """Of order 2 there is one section alone."""
    monkeypatch.setattr(filters, "COMPILED_FROM_SAMPLES", 1)
    channels = np.random.default_rng(1).normal(size=(3, 4000))
    sections = butter(2, 80.0, fs=FAST_RATE, output="sos")
    expected = sosfiltfilt(sections, channels, padtype="even", padlen=500)
    assert np.abs(filters.zero_phase(sections, channels, 500) - expected).max() < 1e-12
