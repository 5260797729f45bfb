"""The study of conformance: its manifest is whole, and it sees what a reader would do wrong."""

import numpy as np
import pytest
from scipy.io import wavfile

from studies import conformance
from studies.conformance_libraries import LIBRARIES, Library, Series
from testbench.public_recordings import FOLDER_VARIABLE

RAMP = np.arange(50.0)


@pytest.fixture
def there(tmp_path):
    """What our reader makes of a ramp."""
    wavfile.write(tmp_path / "ramp.wav", 1000, RAMP)
    return conformance.read_here(tmp_path / "ramp.wav")


def test_the_manifest_is_whole():
    """At least 300 files of one commit each, by digest and licence, of names of their own, with a library each."""
    files = conformance.manifest()
    assert len({file.file for file in files}) == len({file.sha256 for file in files}) == len(files) >= 300
    assert all(len(file.commit) == 40 and len(file.sha256) == 64 and file.bytes and file.licence for file in files)
    assert {file.what for file in files} == set(LIBRARIES)


@pytest.mark.parametrize(
    ("series", "said"),
    [
        (Series("channel 1", RAMP), []),
        (Series("channel 1", RAMP, rate_hz=1000.0), []),
        (Series("channel 1", RAMP + 1), ["'channel 1' (50): no channel has its numbers"]),
        (Series("channel 1", RAMP[:-1]), ["'channel 1' (49): no channel has its numbers"]),
        (Series("force", RAMP), ["'force' (50): named channel 1"]),
        (Series("channel 1", RAMP, "N"), ["'channel 1': unit None, there 'N'"]),
        (Series("channel 1", RAMP, rate_hz=999.0), ["'channel 1': not 999 Hz but UniformClock"]),
        (Series("channel 1", RAMP, start_ns=0), ["'channel 1': starts at [] ns, there 0"]),
        (Series("state", ["on", "off"]), ["text 'state' is not there"]),
    ],
)
def test_what_differs_is_seen(there, series, said):
    """Numbers, lengths, names, units, rates, starts and texts."""
    found = list(conformance.differences([series], there))
    assert len(found) == len(said)
    assert all(text.startswith(start) for text, start in zip(found, said, strict=True))


def test_less_than_the_library_recovers_is_seen(tmp_path, there):
    """A cut that is told is no fault, unless the library has more rows."""
    path = tmp_path / "ramp.wav"
    assert not list(conformance._cut(path, tmp_path / "cut.wav", there, LIBRARIES["WAV"], 3))
    more = Library("more", lambda path: [Series("", RAMP)])
    assert len(list(conformance._cut(path, tmp_path / "cut.wav", there, more, 3))) == 3


def test_without_its_files_the_study_says_so(tmp_path, monkeypatch):
    """No figure is made up, and the address and the variable are named."""
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    (row,) = conformance.study(1, brief=True)
    assert (row.value, row.required) == (0, "")
    assert FOLDER_VARIABLE in row.note
