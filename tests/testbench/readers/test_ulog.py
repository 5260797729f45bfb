"""ULog: every number and word of a log, and nothing that pyulog passes over is passed over in silence."""

import json
import struct

import numpy as np
import pytest
from pyulog import ULog

from testbench.errors import RecordingError

from . import examples, reading
from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")
FORMAT = "imu:uint64_t timestamp;float[2] a;char[8] state;uint8_t[4] _padding0;"


def _bytes(kind, text):
    return struct.pack("<Hc", len(text), kind) + text


def test_numbers_words_and_what_the_log_says_of_itself(tmp_path):
    """As pyulog gives them; padding is none of them."""
    path = examples.make(tmp_path, "run.ulg")
    found = reading.read(path)
    assert list(found.groups) == ["imu 0", "imu 1"]
    assert [(c.name, c.unit) for c in found.group().channels] == [("timestamp", "us"), ("a[0]", None), ("a[1]", None)]
    theirs = ULog(str(path)).get_dataset("imu", 1).data
    for name in ("timestamp", "a[0]", "a[1]"):
        np.testing.assert_array_equal(found.column(name, "imu 1"), theirs[name].astype(np.float64))
    assert found.recording.metadata["sys_name"] == "bench"
    assert json.loads(found.recording.metadata["parameters"]) == {"gain": 0.5}
    assert found.recording.metadata["message 1"] == "9 us, INFO: take-off"
    state = found.recording.texts.series["imu 0", "state"]
    assert (state.samples, state.texts) == ([0, 100], ["idle", "armed"])
    assert "1 dropouts, 0.02 s" in found.message("time_gap")
    assert found.checks["imu 0"].rate_hz == pytest.approx(64)


def test_times_that_were_never_set_are_no_clock_and_those_of_satellites_are_the_start(tmp_path):
    """Some topics of PX4 leave their timestamp zero; UTC comes with the receiver of satellites."""
    path = tmp_path / "run.ulg"
    gps, dead = "gps:uint64_t timestamp;uint64_t time_utc_usec;", "dead:uint64_t timestamp;uint8_t x;"
    examples.ulog(path, range(2), (FORMAT, gps, dead))
    more = [_bytes(b"A", struct.pack("<BH", 0, i) + name) for i, name in ((7, b"gps"), (8, b"dead"), (9, b"dead"))]
    more += [_bytes(b"D", struct.pack("<HQB", 9, t, 1)) for t in (5, 5, 6)]
    more += [_bytes(b"D", struct.pack("<HQQ", 7, t, utc)) for t, utc in ((10, 0), (20, 1_700_000_000_000_020))]
    more += [_bytes(b"D", struct.pack("<HQB", 8, 0, i)) for i in range(3)]
    path.write_bytes(path.read_bytes() + b"".join(more))
    found = reading.read(path)
    assert found.groups["dead 0"].clock is found.groups["dead 0 (8)"].clock is None
    assert found.column("x", "dead 0 (8)").tolist() == [0, 1, 2]
    assert {f.group: f.message[:10] for f in found.findings if f.code == "time_coarse"} == {
        "dead 0 (8)": "2 messages", "dead 0": "1 messages"
    }  # fmt: skip
    assert found.groups["gps"].zero.time == "2023-11-14T22:13:20Z"
    assert "not_a_number" not in found.codes


@pytest.mark.parametrize(
    ("what", "code", "said"),
    [
        (lambda raw: raw[:-30], "cut_file", "ends inside the message"),
        (lambda raw: raw + _bytes(b"D", struct.pack("<H", 99) + bytes(24)), "damaged_file", "400 of some 401"),
        (lambda raw: raw + _bytes(b"D", bytes(5)), "damaged_file", "400 of some 401"),
        (lambda raw: raw + _bytes(b"A", b"\0\0\0imu") + _bytes(b"D", bytes(26)), "damaged_file", "201 of some 401"),
        (lambda raw: raw[:-30] + bytes(12), "damaged_file", "no messages"),
    ],
    ids=["cut", "no subscription", "too short", "subscribed anew", "zeros"],
)
def test_what_pyulog_passes_over_is_said(tmp_path, what, code, said):
    """Each is an error that a person accepts; what is whole stays."""
    path = examples.make(tmp_path, "run.ulg")
    path.write_bytes(what(path.read_bytes()))
    found = reading.read(path)
    assert said in found.message(code)
    assert len(found.column("a[0]", "imu 0")) in (199, 200, 1)


def test_data_behind_a_crash_are_read(tmp_path):
    """A log whose last message is cut where the system died, with what was saved after it, as the header states."""
    path = examples.make(tmp_path, "run.ulg")
    raw = bytearray(path.read_bytes())
    raw[16 + 3 + 8] = 1
    raw[16 + 3 + 16 : 16 + 3 + 24] = struct.pack("<Q", len(raw) + 4)
    path.write_bytes(raw + _bytes(b"D", bytes(26))[:4] + _bytes(b"I", b"\x0cchar[3] dumpyes"))
    found = reading.read(path)
    assert not found.codes & {"cut_file", "damaged_file"}
    assert found.recording.metadata["dump"] == "yes"


@pytest.mark.parametrize("text", ["self:self[9] x;", "wide:float[5000] x;", "a:b[900] x;", "e:e x;"])
def test_messages_of_too_many_numbers_are_refused(tmp_path, text):
    """Also formats that hold themselves, of which pyulog makes no end."""
    path = tmp_path / "run.ulg"
    examples.ulog(path, formats=(FORMAT, "b:float[900] y;", text))
    with pytest.raises(RecordingError, match=f"messages '{text.partition(':')[0]}' of more than 4096"):
        reading.read(path)


def test_a_damaged_log_that_pyulog_reads_without_end_is_refused(tmp_path):
    """By the length of a message, not by what there was left of it, pyulog goes back; found by fuzzing."""
    path = tmp_path / "run.ulg"
    path.write_bytes(bytes.fromhex(
        "554c6f670112350101000000000000002800420000000000000000000000000000000000000000000000000000000000"
        "0000000000000000000000450046696d753a75696e743274205f3874696d657374616d703b666c6f61745b325d20613b"
        "636861725b385d2061747374653b75696e74385f745b345d205f70616464696e67303b16004910636861725b355d2073"
        "79735f6e00004c6e3f69646c650000000e79"
    ))  # fmt: skip
    with pytest.raises(RecordingError, match="come to no end"):
        reading.read(path)


def test_large_whole_numbers_are_a_finding(tmp_path):
    """2**53 + 1 has no float64."""
    path = tmp_path / "run.ulg"
    examples.ulog(path, range(2), (FORMAT, "big:uint64_t timestamp;int64_t n;"))
    more = _bytes(b"A", struct.pack("<BH", 0, 7) + b"big") + _bytes(b"D", struct.pack("<HQq", 7, 1, -(2**53) - 1))
    path.write_bytes(path.read_bytes() + more)
    assert [f.channel for f in reading.read(path).findings if f.code == "not_exact"] == ["n"]


@pytest.mark.parametrize("length", [8, 15, 16, 60])
def test_a_log_without_messages_is_refused(tmp_path, length):
    """By what is missing."""
    path = examples.make(tmp_path, "run.ulg")
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(RecordingError, match=r"inside its header|no message|0 messages before"):
        reading.read(path)
