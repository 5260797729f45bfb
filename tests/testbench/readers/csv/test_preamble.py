"""What stands above the data: rates, steps and counts, taken where they are beyond doubt and held against the data."""

import numpy as np
import pytest

from testbench.readers import ReadOptions
from testbench.readers.header_claims import stated_sampling
from testbench.recording import Refusal

ROWS = "".join(f"{i}.5,{i}.25\n" for i in range(300))


@pytest.mark.parametrize(
    ("text", "decimal", "rate_hz"),
    [
        ("rate: 2000 Hz", ".", 2000.0), ("Sample rate [Hz],5120", ".", 5120.0),
        ("Sampling frequency (kHz);10,24", ",", 10240.0),
        ("rate: 1,000 Hz", ".", 1000.0), ("Abtastrate: 10.240 Hz", ",", 10240.0), ("rate: 1.000 kHz", ".", 1000.0),
        ("sampling interval: 0.1953125 ms", ".", 5120.0), ("Sampling interval;0,5;ms", ",", 2000.0),
        ("dt = 5E-4 s", ".", 2000.0),
        ("Delta_T [us]: 250", ".", 4000.0), ("range +-16 g, 16 bit, 3135 Hz", ".", None), ("rate: 0 Hz", ".", None),
        ("Sample rate: 1000", ".", None), ("dt = 0.5", ".", None), ("low pass at 100 Hz", ".", None),
    ],
)  # fmt: skip
def test_rates_and_steps(text, decimal, rate_hz):
    """A rate or step with its unit is taken to the last digit, marks of thousands are none of decimals."""
    assert stated_sampling([text], decimal).rate_hz == rate_hz


@pytest.mark.parametrize(
    ("text", "rate_hz"),
    [
        ("Sample rate,1000,Hz", 1000.0), ('"Sample Rate","1000 Hz"', 1000.0), ("Sampling rate\t2\tkHz", 2000.0),
        ("sampled at 2 kHz, anti-alias 500 Hz", 2000.0), ("fs = 500 Hz", 500.0), ("frame rate: 25 Hz", 25.0),
        ("Sample rate of all channels: 51.2 kS/s", 51200.0), ("örnekleme hızı 1000 Hz", 1000.0),
        ("rate gyro bandwidth 80 Hz", None), ("sample beam, low pass", None), ("sample beam lowpass 200 Hz", None),
        ("strain rate test at 5 Hz", None), ("Sampling: filter corner 100 Hz", None), ("refresh rate 60 Hz", None),
        ("sampling rate: -100 Hz", None), ("sample rate 1000 Hz, decimated to 100 Hz", None),
        ("sampling rate (before averaging) 10 kHz", None),
    ],
)  # fmt: skip
def test_a_rate_is_that_of_the_data(text, rate_hz):
    """Other frequencies beside the words sample or rate are none, nor is the rate before data were thinned out."""
    assert stated_sampling([text], ".").rate_hz == rate_hz


def test_rates_that_contradict_each_other(log):
    """None of two different rates is taken, and both are named; a rate and its step in few digits are one."""
    found = log(f"# rate: 2 kHz\n# rate: 100 Hz\na (N),b (N)\n{ROWS}")
    assert found.recording.groups[0].clock is None
    assert "100 Hz, 2000 Hz" in found.message("header_contradiction")
    assert stated_sampling(["rate: 3000 Hz", "dt = 0.000333 s"], ".").rate_hz == 3000.0


@pytest.mark.parametrize(
    "line",
    [
        "Samples: 500",
        "Number of samples,500,500",
        "# no. of samples = 500",
        "Anzahl Messwerte;500",
        "Örnek sayısı: 500",
    ],
)
def test_fewer_samples_than_stated_are_refused(log, line):
    """They cannot be told apart from a cut file."""
    found = log(f"{line}\n\na (N),b (N)\n{ROWS}")
    assert found.message("count_contradiction") == "the lines above the data state 500 samples, 300 are there"
    assert len(found.column("a (N)")) == 300


def test_more_samples_than_stated_are_said(log):
    """Nothing is lost; as many as stated, also in each of several recordings, are no finding."""
    assert "header_contradiction" in log(f"Samples: 200\n\na (N),b (N)\n{ROWS}").codes
    for text in (ROWS, f"{ROWS}a (N),b (N)\n{ROWS}"):
        found = log(f"Samples: 300\n\na (N),b (N)\n{text}")
        assert not {"header_contradiction", "count_contradiction"} & found.codes


@pytest.mark.parametrize("names", ["a (N),b (N)\n", ""])
def test_pairs_above_as_many_columns_are_no_data(log, names):
    """Lines such as ``Channels,2`` above two columns are neither data nor names."""
    found = log(f"Channels,2\nSerial,1234\n\n{names}{ROWS}")
    assert [len(c) for c in found.data[found.group().name]] == [300, 300]
    assert [c.name for c in found.group().channels] == (["a (N)", "b (N)"] if names else ["col0", "col1"])
    assert not np.isnan(found.data[found.group().name]).any()


def test_a_first_row_with_a_word_is_data(log):
    """Without a blank line or names below it, it stays a row."""
    found = log("a (N),b (N)\nOverload,1.5\n" + ROWS)
    assert np.isnan(found.column("a (N)")[0])
    assert found.column("b (N)")[0] == 1.5


NOTES = ("Operator: Ali\nPayload 5\nRepeat 3\n", "code 0\n", "# engine\nbore: 82\nstroke: 90\n")


@pytest.mark.parametrize("text", NOTES)
def test_notes_are_no_log(log, text):
    """A word and a number on each line are notes that lie beside the logs, unless a person says that they are data."""
    with pytest.raises(Refusal, match="as in notes"):
        log(text)


def test_states_before_numbers_are_data(log):
    """Words that come again are a column of states; words that do not are data if a person says so."""
    found = log("OK 1.5\nOK 2.5\nLOW 3.5\n")
    assert found.column("col1").tolist() == [1.5, 2.5, 3.5]
    assert log(NOTES[0], ReadOptions(header=False)).column("col1").tolist() == [5.0, 3.0]
