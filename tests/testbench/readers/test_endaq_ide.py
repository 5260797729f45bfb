"""enDAQ recordings. No writer is public: what is tested here are public recordings, and elements byte by byte."""

from types import SimpleNamespace

import pytest

from testbench.errors import RecordingError
from testbench.readers import endaq_ide
from testbench.readers.byte_source import ByteSource

NAME = "05_slamstick_SSX66115.IDE"
HEAD = b"\x1aE\xdf\xa3\x88\x42\x82\x84mide\x00"
BLOCK = b"\xa1\x84abcd"


def _check(tmp_path, raw):
    path = tmp_path / "run.ide"
    path.write_bytes(raw)
    with ByteSource(path) as source:
        return endaq_ide.whole_elements(source)


def test_whole_elements_are_in_order(tmp_path):
    """Headers, blocks and padding one behind the other."""
    raw = HEAD + BLOCK * 3 + b"\xec\x41\x00" + bytes(256) + b"\xfc\x83abc"
    assert _check(tmp_path, raw) == (len(raw), None)


@pytest.mark.parametrize(
    ("raw", "end", "parts"),
    [
        *(((HEAD + BLOCK * 3)[:-n], len(HEAD + BLOCK * 2), ["inside element 4", "2 whole blocks"]) for n in (1, 3, 5)),
        *((HEAD + BLOCK + filled * 5000, len(HEAD + BLOCK), ["never written"]) for filled in (b"\0", b"\xff")),
    ],
)
def test_what_is_missing_is_said(tmp_path, raw, end, parts):
    """A cut element, and how many whole blocks come before it; what a recorder that lost power had set aside."""
    whole, finding = _check(tmp_path, raw)
    assert (whole, finding.code) == (end, "cut_file")
    assert all(part in finding.message for part in parts)


def test_what_is_no_element_is_refused(tmp_path):
    """Zeros with something behind them, an identifier that is too long."""
    for rest in (bytes(50) + b"abc" + bytes(50), b"\x00\x01" * 20, b"\x08" + bytes(40) + b"1"):
        with pytest.raises(RecordingError, match="no element"):
            _check(tmp_path, HEAD + BLOCK + rest)


def test_the_session_begins_at_a_second_of_utc():
    """The recorder's microseconds are zero then; a recorder whose clock was never set states none."""
    start = endaq_ide._zero(SimpleNamespace(utcStartTime=1_500_000_000))
    assert start.time.startswith("2017-07-14T02:40:00")
    assert endaq_ide._zero(SimpleNamespace(utcStartTime=0)) is None
