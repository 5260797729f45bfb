"""Frequency responses and coherences, to one input and to several, against systems whose responses are known."""

import numpy as np
import pytest
from scipy.signal import butter, coherence, csd, freqz, lfilter, welch

from testbench.errors import AnalysisError
from testbench.signal import welch as spectra
from testbench.signal.frequency_response import response_of

RATE = 1000.0


def frequency_response(inputs, answer, rate, segment):
    """From channels to another, from their samples."""
    return response_of(spectra.welch([*inputs, answer], rate, segment), range(len(inputs)), len(inputs))


def test_response_of_a_filter():
    """Gain of a low-pass within three stated deviations at 98 of 100 frequencies, though noise is in; phase, too."""
    random = np.random.default_rng(3)
    given = random.normal(size=200_000)
    taps = butter(2, 100.0, fs=RATE)
    answer = lfilter(*taps, given) + 0.5 * random.normal(size=len(given))
    found = frequency_response([given], answer, RATE, 512)
    low = (found.frequency > 5.0) & (found.frequency < 150.0)
    true = freqz(*taps, found.frequency, fs=RATE)[1]
    off = np.abs(found.response[0, low]) / np.abs(true[low]) - 1.0  # above, the filter's gain may be zero
    assert np.mean(np.abs(off) < 3.0 * found.relative_deviation[0, low]) > 0.98
    assert np.sqrt(np.mean((off / found.relative_deviation[0, low]) ** 2)) == pytest.approx(1.0, abs=0.3)
    assert np.abs(np.angle(found.response[0, low] / true[low])).max() < 0.2
    assert found.significant[0, low].all()


def test_unrelated_noise_is_rarely_significant():
    """Five of 100 frequencies at most, about."""
    random = np.random.default_rng(4)
    found = frequency_response(random.normal(size=(1, 100_000)), random.normal(size=100_000), RATE, 256)
    assert 0.01 < np.mean(found.significant) < 0.1


def test_too_few_segments_are_refused():
    """Of one segment the coherence is one, whatever was recorded."""
    with pytest.raises(AnalysisError, match="independent segments"):
        frequency_response([np.arange(600.0)], np.arange(600.0), RATE, 512)


@pytest.fixture(scope="module")
def noise():
    """Two records of noise that share half of their power, and one of its own."""
    first, other, own = np.random.default_rng(5).normal(size=(3, 100_000))
    return first, (first + other) / np.sqrt(2.0), own


def test_each_response_is_its_own(noise):
    """Two inputs that go together in part: each gain is that of its filter, where one input alone errs."""
    first, second, own = noise
    low, high = butter(2, 100.0, fs=RATE), butter(2, 60.0, "high", fs=RATE)
    answer = lfilter(*low, first) + 2.0 * lfilter(*high, second) + 0.3 * own
    found = frequency_response([first, second], answer, RATE, 512)
    band = (found.frequency > 80.0) & (found.frequency < 200.0)
    for row, (taps, size) in enumerate(((low, 1.0), (high, 2.0))):
        true = size * freqz(*taps, found.frequency, fs=RATE)[1]
        off = np.abs(found.response[row] - true)[band] / np.abs(true[band])
        assert np.mean(off < 4.0 * found.relative_deviation[row][band]) > 0.97
    alone = frequency_response([first], answer, RATE, 512).response[0, band]
    true = freqz(*low, found.frequency, fs=RATE)[1][band]
    assert np.median(np.abs(alone - true) / np.abs(true)) > 0.5
    assert (found.multiple[band] > 0.8).all()


def test_one_input_is_the_plain_transfer(noise):
    """With one input the response and the coherence are those of scipy's spectra: H1, to rounding."""
    first, _, own = noise
    answer = lfilter(*butter(2, 100.0, fs=RATE), first) + own
    found = frequency_response([first], answer, RATE, 512)
    cross, power = csd(first, answer, RATE, nperseg=512)[1], welch(first, RATE, nperseg=512)[1]
    assert found.response[0] == pytest.approx(cross / power)
    assert found.coherence[0] == pytest.approx(coherence(first, answer, RATE, nperseg=512)[1], abs=1e-9)
    assert found.multiple == pytest.approx(found.coherence[0], abs=1e-12)


def test_an_input_that_explains_nothing_more_is_rarely_significant(noise):
    """Five of 100 frequencies at most, about, though it goes with the one that explains the answer."""
    first, second, own = noise
    found = frequency_response([first, second], first + own, RATE, 256)
    assert np.mean(found.significant[1]) < 0.1
    assert found.significant[0].all()


def test_inputs_that_are_one_are_not_told_apart(noise):
    """The same input twice: neither has anything of its own, and no response is made up."""
    first, _, own = noise
    found = frequency_response([first, 3.0 * first], first + own, RATE, 256)
    assert not found.response.any()
    assert not found.significant.any()


def test_too_few_segments_for_so_many_inputs():
    """Each input takes a segment: refused, with how many are needed."""
    with pytest.raises(AnalysisError, match="for 3 inputs"):
        frequency_response(list(np.random.default_rng(0).normal(size=(3, 1500))), np.ones(1500), RATE, 512)
