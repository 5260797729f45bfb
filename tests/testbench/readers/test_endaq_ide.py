"""enDAQ recordings. No writer is public: what is tested here are public recordings, and elements byte by byte."""

import numpy as np
import pytest

from testbench.errors import RecordingError
from testbench.readers import endaq_ide
from testbench.readers.byte_source import ByteSource
from testbench.recording import TimeColumn

from . import reading

NAME = "05_slamstick_SSX66115.IDE"
HEAD = endaq_ide.MAGIC + b"\x88\x42\x82\x84mide\x00"
BLOCK = b"\xa1\x84abcd"


def _check(tmp_path, raw):
    path = tmp_path / "run.ide"
    path.write_bytes(raw)
    with ByteSource(path) as source:
        return endaq_ide.whole_elements(source)


def test_whole_elements_are_in_order(tmp_path):
    """Headers, blocks and padding one behind the other."""
    assert _check(tmp_path, HEAD + BLOCK * 3 + b"\xec\x41\x00" + bytes(256) + b"\xfc\x83abc").findings == ()


@pytest.mark.parametrize("cut", [1, 3, 5])
def test_a_cut_element_is_said(tmp_path, cut):
    """How many whole blocks come before it."""
    (finding,) = _check(tmp_path, (HEAD + BLOCK * 3)[:-cut]).findings
    assert finding.code == "cut_file"
    assert "inside element 4" in finding.message
    assert "2 whole blocks" in finding.message


@pytest.mark.parametrize("filled", [b"\0", b"\xff"])
def test_space_that_was_never_written_is_said(tmp_path, filled):
    """A recorder that lost power leaves what it set aside."""
    (finding,) = _check(tmp_path, HEAD + BLOCK + filled * 5000).findings
    assert "never written" in finding.message


def test_what_is_no_element_is_refused(tmp_path):
    """Zeros with something behind them, an identifier that is too long."""
    for rest in (bytes(50) + b"abc" + bytes(50), b"\x00\x01" * 20, b"\x08" + bytes(40) + b"1"):
        with pytest.raises(RecordingError, match="no element"):
            _check(tmp_path, HEAD + BLOCK + rest)


@pytest.mark.recordings
def test_public_recording_gives_its_known_values():
    """Five channels at five rates, each with its own time in microseconds, calibrated."""
    found = reading.read(reading.real(NAME))
    names = {"8": "Main Acceleration", "32": "16g DC Acceleration", "36": "Pressure/Temperature"}
    for what, values in reading.known(NAME).items():
        number, _, rest = what.partition(".")
        channel, _, unit = rest[2:].removesuffix("]").rpartition(" [")
        group = names[number]
        reading.assert_values(found.column(channel, group), values)
        reading.assert_clock(found.time(group), values["time_us"])
        assert found.groups[group].clock == TimeColumn(0, 1e-6)
        assert found.unit(channel) == unit
    assert len(found.groups) == 5
    assert "calibration_applied" in found.codes


@pytest.mark.recordings
def test_small_blocks_give_the_same(tmp_path):
    """What idelib gives piece by piece is what it gives at once."""
    from testbench.readers import endaq_ide

    path = reading.real(NAME)
    whole = reading.read(path)
    kept = endaq_ide.block_samples
    try:
        endaq_ide.block_samples = lambda channels: 997
        blocks = list(endaq_ide.open_library(path).blocks(lambda finding: None))
    finally:
        endaq_ide.block_samples = kept
    for name, columns in whole.data.items():
        pieces = [b.columns for b in blocks if b.group.name == name]
        np.testing.assert_array_equal(np.concatenate(pieces, axis=1), columns)


@pytest.mark.recordings
@pytest.mark.parametrize("share", [0.1, 0.5, 0.999])
def test_a_cut_recording_says_so(tmp_path, share):
    """What is whole can be had by one who accepts the loss."""
    path = tmp_path / NAME
    whole = reading.real(NAME).read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    found = reading.read(path)
    assert "whole blocks of samples come before it" in found.message("cut_file")
