"""C3D, written by ezc3d and byte by byte."""

import struct

import ezc3d
import numpy as np
import pytest

from testbench.readers.c3d import DEC, INTEL, SGI, floats
from testbench.recording import UniformClock

from . import reading

RANDOM = np.random.default_rng(3)


def _written(tmp_path, frames=40, per_frame=5):
    """A file by ezc3d: two points, three analog channels, and the arrays in it."""
    c3d = ezc3d.c3d()
    points = RANDOM.normal(size=(4, 2, frames)).astype(np.float32)
    analog = RANDOM.normal(size=(1, 3, frames * per_frame)).astype(np.float32)
    c3d["header"]["points"]["frame_rate"] = 100.0
    c3d["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    c3d["parameters"]["POINT"]["LABELS"]["value"] = ("knee", "HipAngle")
    c3d["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    c3d.add_parameter("POINT", "ANGLES", ["HipAngle"])
    c3d.add_parameter("POINT", "ANGLE_UNITS", ["deg"])
    c3d["parameters"]["ANALOG"]["RATE"]["value"] = [100.0 * per_frame]
    c3d["parameters"]["ANALOG"]["LABELS"]["value"] = ("Fx", "Fz", "EMG")
    c3d["parameters"]["ANALOG"]["UNITS"]["value"] = ["N", "N", ""]
    c3d["data"]["points"], c3d["data"]["analogs"] = points, analog
    residuals = np.zeros((1, 2, frames))
    residuals[0, 1, 7] = -1
    c3d["data"]["meta_points"] = {"residuals": residuals, "camera_masks": np.zeros((7, 2, frames), dtype=bool)}
    path = tmp_path / "walk.c3d"
    c3d.write(str(path))
    return path, points, analog[0]


def _parameter(name, group, kind, dimensions, raw, order):
    body = struct.pack("bB", kind, len(dimensions)) + bytes(dimensions) + raw + b"\0"
    return struct.pack("bb", len(name), group) + name.encode() + struct.pack(f"{order}H", len(body) + 2) + body


def _bytes(processor, words, frames=3, points=1, channels=2, per_frame=2, unsigned=False, pack=None):
    """A file of one processor: points scaled by 0.5, analog = (n - 10) * 0.25 * 2."""
    order = ">" if processor == SGI else "<"
    number = {INTEL: lambda x: struct.pack("<f", x), SGI: lambda x: struct.pack(">f", x), DEC: _dec}[processor]
    scale = -0.5 if pack else 0.5
    header = struct.pack("BB", 2, 0x50) + struct.pack(f"{order}5H", points, channels * per_frame, 1, frames, 0)
    header += number(scale) + struct.pack(f"{order}2H", 4, per_frame) + number(50.0)
    section = bytes([1, 0x50, 2, processor])
    section += struct.pack("bb", -5, -1) + b"POINT" + struct.pack(f"{order}H", 3) + b"\0"
    section += struct.pack("bb", -6, -2) + b"ANALOG" + struct.pack(f"{order}H", 3) + b"\0"
    section += _parameter("SCALE", 2, 4, [2], number(0.25) * 2, order)
    section += _parameter("GEN_SCALE", 2, 4, [], number(2.0), order)
    section += _parameter("OFFSET", 2, 2, [2], struct.pack(f"{order}2h", 10, 10), order)
    if unsigned:
        section += _parameter("FORMAT", 2, -1, [8], b"UNSIGNED", order)
    section += b"\0\0"
    data = b"".join(map(pack, words)) if pack else np.array(words).astype(f"{order}i2").tobytes()
    return header.ljust(512, b"\0") + section.ljust(1024, b"\0") + data


def _dec(value):
    """DEC's F float of ``value``: four times it in IEEE, halves swapped."""
    raw = struct.pack("<f", value * 4)
    return raw[2:] + raw[:2]


WORDS = [2, 4, 6, 0, 14, 18, 22, 26] * 3


def test_headers_of_other_programs(tmp_path):
    """Channels counted where their samples of a frame belong; parameters that go on to the data, declared shorter."""
    path, _, analog = _written(tmp_path)
    raw = bytearray(path.read_bytes())
    raw[4:6] = struct.pack("<H", 3)
    raw[514] = 1
    path.write_bytes(raw)
    found = reading.read(path)
    np.testing.assert_array_equal(found.column("EMG"), analog[2])
    assert {f.code for f in found.findings if f.severity} == {"header_contradiction", "invalid_samples"}


def test_points_and_channels_are_groups_of_their_own_rate(tmp_path):
    """Numbers, labels, units and rates are those that another program wrote; an unseen point is NaN."""
    path, points, analog = _written(tmp_path)
    found = reading.read(path)
    assert found.groups["walk analog"].clock == UniformClock(500.0, 0.0)
    assert found.groups["walk points"].clock == UniformClock(100.0, 0.0)
    np.testing.assert_array_equal(found.data["walk analog"], analog)
    expected = points[0, 1].astype(np.float64)
    expected[7] = np.nan
    np.testing.assert_array_equal(found.column("HipAngle X"), expected)
    units = [found.unit(name) for name in ("Fx", "EMG", "knee Z", "HipAngle X")]
    assert units == ["N", None, "mm", "deg"]
    assert "1 positions" in found.message("invalid_samples")
    assert "not_a_number" not in found.codes


@pytest.fixture
def old(tmp_path):
    """A file of these bytes."""

    def write(raw):
        (tmp_path / "old.c3d").write_bytes(raw)
        return tmp_path / "old.c3d"

    return write


@pytest.mark.parametrize("processor", [INTEL, DEC, SGI])
def test_integers_are_scaled_by_the_law_of_the_standard(old, processor):
    """(n - offset) * scale * general scale for channels, n * scale for points, whatever machine wrote them."""
    found = reading.read(old(_bytes(processor, WORDS)))
    assert found.column("point 1 Y").tolist() == [2.0, 2.0, 2.0]
    assert found.column("analog 1").tolist() == [2.0, 6.0] * 3
    assert found.column("analog 2").tolist() == [4.0, 8.0] * 3
    assert found.groups["old analog"].clock == UniformClock(100.0, 0.0)


@pytest.mark.parametrize(("processor", "pack"), [(DEC, _dec), (SGI, lambda x: struct.pack(">f", x))])
def test_floats_of_other_machines_are_read(old, processor, pack):
    """A negative scale means floats, in the machine's own form; points are then not scaled."""
    found = reading.read(old(_bytes(processor, [w + 0.5 for w in WORDS], pack=pack)))
    assert found.column("point 1 X").tolist() == [2.5] * 3
    assert found.column("analog 1").tolist() == [(14.5 - 10) / 2, (22.5 - 10) / 2] * 3


def test_dec_floats_come_back():
    """DEC's numbers of many sizes, and zero."""
    values = [0.0, 1.0, -2.5, 1e-9, 3e30]
    np.testing.assert_allclose(floats(b"".join(map(_dec, values)), DEC), values, rtol=1e-7)


def test_unsigned_integers_and_residuals(old):
    """65534 is not -2 where FORMAT says UNSIGNED; the fourth word is data if it is more than seen or not seen."""
    found = reading.read(old(_bytes(INTEL, [2, 4, 6, 257, -2, 18, 22, 26] * 3, unsigned=True)))
    assert found.column("analog 1")[0] == (65534 - 10) * 0.5
    assert found.column("point 1 residual").tolist() == [257.0] * 3


@pytest.mark.parametrize(
    ("change", "message", "frames"),
    [
        (lambda raw: raw[:-516], "cut_file: 40 frames are declared, 38 whole ones", 38),
        (lambda raw: raw + bytes(4096), "count_contradiction: 40 frames are declared, the file has room for", 40),
    ],
)
def test_another_number_of_frames_than_declared(tmp_path, change, message, frames):
    """Whole frames can be read by one who accepts the loss; data behind the declared ones are an error, not silence."""
    path, _, _ = _written(tmp_path)  # 40 frames of 92 bytes, filled up to blocks of 512
    path.write_bytes(change(path.read_bytes()))
    assert message in reading.said(path)
    assert len(reading.read(path).column("Fx")) == frames * 5


@pytest.mark.parametrize("changed", [{0: 0xFF}, {1: 0x51}, {515: 1}, {2: 0, 3: 0, 4: 0, 5: 0}])
def test_a_header_that_contradicts_itself_is_refused(old, changed):
    """Parameters beyond the end, another mark, an unknown processor, no points and no channels."""
    raw = bytearray(_bytes(INTEL, WORDS))
    for at, value in changed.items():
        raw[at] = value
    assert reading.said(old(raw)).startswith(("damaged_file", "cut_file"))
