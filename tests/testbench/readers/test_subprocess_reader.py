"""Reading in a process of its own."""

import sys
import time
from pathlib import Path

import numpy as np
import pytest

from testbench.errors import RecordingError
from testbench.readers import subprocess_reader
from testbench.readers.subprocess_reader import open_in_subprocess
from testbench.recording import Refusal

from . import misbehaving


@pytest.fixture
def opened(tmp_path, monkeypatch):
    """Open with one of the functions of ``misbehaving``, which the process finds beside this file."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    path = tmp_path / "run.bin"
    path.write_bytes(b"x")
    return lambda function: open_in_subprocess(path, "misbehaving", function)


def test_a_recording_comes_through_as_it_is(opened):
    """Names, clocks, numbers to the bit, findings, and a group that comes late; what libraries print does not."""
    recording, expected = opened("well"), misbehaving.well(Path("run.bin"))
    for name in ("format", "groups", "origin", "settings", "metadata", "comments", "ranges", "stated_rate_hz"):
        assert getattr(recording, name) == getattr(expected, name)
    assert recording.findings == expected.findings
    findings = []
    first, second = recording.blocks(findings.append)
    assert (first.group, first.start, first.bytes_read) == (misbehaving.GROUP, 0, 17)
    np.testing.assert_array_equal(first.columns, [[1.5, np.nan], [0.0, 1.0]])
    assert second.group == misbehaving.LATE
    np.testing.assert_array_equal(second.columns[0], np.arange(200_000.0))
    assert [f.message for f in findings] == ["ünusual"]


@pytest.mark.parametrize(
    ("function", "code", "said"),
    [
        ("crashes", "damaged_file", "crashed on it"),
        ("refuses", "cut_file", "it is cut"),
        ("fails", "damaged_file", "KeyError"),
        ("nests", "damaged_file", "nested without end"),
    ],
)
def test_what_befalls_the_process_is_a_refusal(opened, function, code, said):
    """A crash, a refusal, an error of a library: each with its code."""
    with pytest.raises(Refusal, match=said) as caught:
        opened(function)
    assert caught.value.finding.code == code


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited on Linux only")
def test_memory_is_limited(opened, monkeypatch):
    """A library that asks for more than it may is stopped, and the file refused."""
    with pytest.raises(Refusal, match="GiB of memory") as caught:
        opened("swallows")
    assert caught.value.finding.code == "too_large"


def test_patience_ends(opened, monkeypatch):
    """A library that does not come back is stopped."""
    monkeypatch.setattr(subprocess_reader, "PATIENCE_S", 1.0)
    began = time.monotonic()
    with pytest.raises(Refusal, match="no end within 1 s"):
        opened("hangs")
    assert time.monotonic() - began < 10


def test_a_crash_in_the_middle_is_a_refusal(opened):
    """The header was fine; the blocks before the crash came through."""
    blocks = opened("crashes_later").blocks(lambda finding: None)
    assert next(blocks).columns[0].tolist() == [0, 1, 2]
    with pytest.raises(Refusal, match="crashed"):
        next(blocks)


def test_a_missing_library_is_no_damage(opened):
    """The message of the reader comes through."""
    with pytest.raises(RecordingError, match="pip install it"):
        opened("lacks")


def test_leaving_early_ends_the_process(opened):
    """A reader that is not read to its end leaves nothing running."""
    blocks = opened("well").blocks(lambda finding: None)
    next(blocks)
    blocks.close()


def test_header_and_data_come_from_one_process(opened, monkeypatch):
    """Opening is not done twice; where another file was opened in between, or data are asked for again, it is."""
    started = []
    begin = subprocess_reader.Process.__init__
    monkeypatch.setattr(subprocess_reader.Process, "__init__", lambda self, *a: started.append(self) or begin(self, *a))
    recording = opened("well")
    assert len(list(recording.blocks(lambda finding: None))) == 2
    assert len(started) == 1
    assert len(list(recording.blocks(lambda finding: None))) == 2
    assert len(started) == 2
    first, second = opened("well"), opened("well")
    assert [len(list(each.blocks(lambda finding: None))) for each in (second, first)] == [2, 2]
    assert len(started) == 5


def test_a_recording_that_is_dropped_leaves_no_process(opened, monkeypatch):
    """Nor does one that is opened and never read, once another is opened."""
    started = []
    begin = subprocess_reader.Process.__init__
    monkeypatch.setattr(subprocess_reader.Process, "__init__", lambda self, *a: started.append(self) or begin(self, *a))
    first = opened("well")
    second = opened("well")
    assert started[0]._process.poll() is not None
    assert started[1]._process.poll() is None
    del first, second
    assert started[1]._process.poll() is not None
