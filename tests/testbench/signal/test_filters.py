"""Bands and lags against closed forms."""

import numpy as np
import pytest

from testbench.errors import AnalysisError
from testbench.signal.filters import Band, lag, without_offset

RATE = 2000.0
TIME = np.arange(8000) / RATE


def test_band_keeps_and_cuts():
    """What lies inside the band passes unchanged and in phase, what lies outside is gone."""
    inside, outside = np.sin(2 * np.pi * 20 * TIME), np.sin(2 * np.pi * 600 * TIME)
    middle = slice(2000, 6000)
    assert Band(0.0, 100.0).of(inside + outside, RATE)[middle] == pytest.approx(inside[middle], abs=1e-4)
    assert Band(2.0, 100.0).of(inside + outside + 3.0, RATE)[middle] == pytest.approx(inside[middle], abs=1e-2)


def test_band_halves_its_edge():
    """At its edge a zero-phase band of the stated order passes half of the amplitude."""
    found = Band(0.0, 100.0).of(np.cos(2 * np.pi * 100 * TIME), RATE)[2000:6000]
    assert np.ptp(found) / 2 == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize(("low", "high"), [(-1.0, 5.0), (5.0, 5.0), (0.0, np.inf), (0.0, np.nan)])
def test_no_band(low, high):
    """Ends that make no band are refused."""
    with pytest.raises(AnalysisError, match="band"):
        Band(low, high)


def test_band_above_the_rate():
    """A band that the rate cannot show is refused with both numbers."""
    with pytest.raises(AnalysisError, match="400 samples a second, the record has 100"):
        Band(0.0, 200.0).of(TIME, 100.0)


def test_record_too_short():
    """A record that is too short for the filter is refused."""
    with pytest.raises(AnalysisError, match="too few"):
        Band(0.0, 200.0).of(TIME[:9], RATE)


@pytest.mark.parametrize("shift", [0.0, 0.1, -0.0371])
def test_lag(shift):
    """A pulse that comes later is found later, to a tenth of a sample, also between samples."""
    early = np.exp(-(((TIME - 2.0) / 0.05) ** 2))
    late = np.exp(-(((TIME - 2.0 - shift) / 0.05) ** 2))
    assert lag(late, early, RATE) == pytest.approx(shift, abs=0.1 / RATE)


def test_offset():
    """The mean is gone and nothing else."""
    values = np.array([1.0, 2.0, 6.0])
    assert without_offset(values) == pytest.approx(values - 3.0)
