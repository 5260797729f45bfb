"""Frequency response and coherence against a system whose response is known."""

import numpy as np
import pytest
from scipy.signal import butter, freqz, lfilter

from testbench.errors import AnalysisError
from testbench.signal.frequency_response import frequency_response

RATE = 1000.0


def test_response_of_a_filter():
    """Gain of a low-pass within three stated deviations at 98 of 100 frequencies, though noise is in; phase, too."""
    random = np.random.default_rng(3)
    given = random.normal(size=200_000)
    taps = butter(2, 100.0, fs=RATE)
    answer = lfilter(*taps, given) + 0.5 * random.normal(size=len(given))
    found = frequency_response(given, answer, RATE, 512)
    low = (found.frequency > 5.0) & (found.frequency < 150.0)
    true = freqz(*taps, found.frequency, fs=RATE)[1]
    off = np.abs(found.response) / np.abs(true) - 1.0
    assert np.mean(np.abs(off[low]) < 3.0 * found.relative_deviation[low]) > 0.98
    assert np.sqrt(np.mean((off[low] / found.relative_deviation[low]) ** 2)) == pytest.approx(1.0, abs=0.3)
    assert np.abs(np.angle(found.response[low] / true[low])).max() < 0.2
    assert found.significant[low].all()


def test_unrelated_noise_is_rarely_significant():
    """Five of 100 frequencies at most, about."""
    random = np.random.default_rng(4)
    found = frequency_response(*random.normal(size=(2, 100_000)), RATE, 256)
    assert 0.01 < np.mean(found.significant) < 0.1


def test_too_few_segments_are_refused():
    """Of one segment the coherence is one, whatever was recorded."""
    with pytest.raises(AnalysisError, match="independent segments"):
        frequency_response(np.arange(600.0), np.arange(600.0), RATE, 512)
