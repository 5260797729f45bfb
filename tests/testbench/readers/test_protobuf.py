"""Messages of Protocol Buffers in MCAP, encoded here byte by byte as the format's own documentation has them."""

import json
import struct

import numpy as np
import pytest
from mcap.writer import Writer

from testbench.errors import RecordingError
from testbench.readers.mcap_worker import ProtobufDecoder
from testbench.readers.ros_topics import TooManyNumbers, Unreadable

from . import reading
from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")

ZERO = 1_795_248_000_123_456_789
DOUBLE, FLOAT, INT64, INT32, BOOL, STRING, MESSAGE, SINT32 = 1, 2, 3, 5, 8, 9, 11, 17


def varint(value):
    """Seven bits a byte, the lowest first; negative numbers as 64 bits."""
    value &= (1 << 64) - 1
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def number(field, value):
    """An integer."""
    return varint(field << 3) + varint(value)


def double(field, value):
    """A number of eight bytes."""
    return varint(field << 3 | 1) + struct.pack("<d", value)


def inner(field, raw):
    """Bytes: a text, a message, packed numbers."""
    raw = raw.encode() if isinstance(raw, str) else raw
    return varint(field << 3 | 2) + varint(len(raw)) + raw


def described(name, *fields, inside=b""):
    """A DescriptorProto; fields are (name, number, label, type, type name, presence)."""
    raw = inner(1, name)
    for title, index, label, kind, of, *optional in fields:
        one = inner(1, title) + number(3, index) + number(4, label) + number(5, kind)
        one += inner(6, of) if of else b""
        raw += inner(2, one + (number(9, 0) + number(17, 1) if optional else b""))
        raw += inner(8, inner(1, f"_{title}")) if optional else b""
    return raw + inside


TIMESTAMP = inner(1, inner(1, "t.proto") + inner(2, "google.protobuf") + inner(12, "proto3") + inner(4, described(
    "Timestamp", ("seconds", 1, 1, INT64, ""), ("nanos", 2, 1, INT32, ""))))  # fmt: skip
VECTOR = described("Vec", ("x", 1, 1, DOUBLE, ""), ("y", 2, 1, DOUBLE, ""))
IMU = described(
    "Imu",
    ("timestamp", 1, 1, MESSAGE, ".google.protobuf.Timestamp"), ("frame_id", 2, 1, STRING, ""),
    ("acc", 3, 1, MESSAGE, ".lab.Imu.Vec"), ("count", 4, 1, INT32, ""), ("ok", 5, 1, BOOL, ""),
    ("raw", 6, 3, SINT32, ""), ("gain", 7, 1, DOUBLE, "", True), ("parts", 8, 3, MESSAGE, ".lab.Imu.Vec"),
    inside=inner(3, VECTOR),
)  # fmt: skip
SCHEMA = TIMESTAMP + inner(
    1, inner(1, "imu.proto") + inner(2, "lab") + inner(3, "t.proto") + inner(12, "proto3") + inner(4, IMU)
)


def imu(i):
    """A message: some fields are at their default and so not sent."""
    stamp = ZERO + i * 5_000_001
    raw = inner(1, number(1, stamp // 10**9) + number(2, stamp % 10**9)) + inner(2, "base")
    raw += inner(3, double(1, i / 4) + double(2, -i)) + (number(4, i - 5) if i != 5 else b"") + number(5, i % 2)
    raw += inner(6, b"".join(varint(value) for value in (2 * i, 2 * i + 1)))
    return raw + (double(7, 0.5) if i > 2 else b"") + inner(8, double(1, 1.0)) + inner(8, double(2, 2.0))


def recorded(path, schema=SCHEMA, name="lab.Imu", messages=None):
    """An MCAP file of these messages."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="", library="test")
        channel = writer.register_channel("/imu", "protobuf", writer.register_schema(name, "protobuf", schema))
        for i, raw in enumerate(messages or map(imu, range(20))):
            writer.add_message(channel, ZERO + i * 5_000_001 + 1000, raw, ZERO)
        writer.finish()
    return path


def test_the_documented_examples():
    """150 is 96 01; packed 3, 270, 86942; -1 as sint32 is 1; -2 as int32 has 64 bits; a nested message with 150."""
    fields = ("a", 1, 1, INT32, ""), ("b", 4, 3, INT32, ""), ("c", 5, 1, SINT32, ""), ("d", 3, 1, MESSAGE, ".T")
    file = inner(1, inner(1, "x.proto") + inner(12, "proto3") + inner(4, described("T", *fields)))
    decoder = ProtobufDecoder(file, "T")
    raw = bytes.fromhex("089601") + bytes.fromhex("2206038e029ea705") + number(5, 1) + bytes.fromhex("1a03089601")
    found = decoder.decode(raw)
    values = dict(zip(found.names, found.numbers, strict=True))
    assert [values[name] for name in ("a", "b[0]", "b[1]", "b[2]", "c", "d.a")] == [150, 3, 270, 86942, -1, 150]
    assert decoder.decode(number(1, -2)).numbers[0] == -2


def test_numbers_stamps_and_defaults(tmp_path):
    """Stamps are the clock to the nanosecond; unsent numbers are zero, unset ones NaN; lists are numbered."""
    found = reading.read(recorded(tmp_path / "run.mcap"))
    (group,) = found.groups.values()
    assert found.time().tolist() == [i * 5_000_001 - 1000 for i in range(20)]
    assert found.column("acc.x").tolist() == [i / 4 for i in range(20)]
    assert found.column("count").tolist() == [i - 5 for i in range(20)]
    assert found.column("raw[0]").tolist() == list(range(20))
    assert found.column("raw[1]").tolist() == [-i - 1 for i in range(20)]
    assert found.column("ok").tolist() == [0, 1] * 10
    assert np.isnan(found.column("gain")).tolist() == [i <= 2 for i in range(20)]
    assert found.column("parts[1].y").tolist() == [2.0] * 20
    assert found.column("parts[1].x").tolist() == [0.0] * 20
    assert "frame_id" not in {c.name for c in group.channels}


def test_a_message_within_that_was_not_sent_is_nan(tmp_path):
    """Its numbers are unknown, and not zero."""
    found = reading.read(recorded(tmp_path / "run.mcap", messages=[imu(0), number(4, 7)]))
    assert np.isnan(found.column("acc.x", "/imu part 2")).all()
    assert found.column("count", "/imu part 2").tolist() == [7]


@pytest.mark.parametrize(
    "raw", [b"\x08", b"\x08" + b"\xff" * 11, b"\x1a\x05ab", b"\x09abc", b"\x0b", b"\x00\x01", number(3, 5)]
)
def test_bytes_that_are_no_message_are_refused(tmp_path, raw):
    """Cut or endless integers, lengths beyond the end, unknown kinds: the file is damaged."""
    with pytest.raises(RecordingError, match="/imu"):
        reading.read(recorded(tmp_path / "run.mcap", messages=[imu(0), raw]))


@pytest.mark.parametrize(("schema", "name"), [(b"\x0a", "lab.Imu"), (SCHEMA, "lab.Nothing"), (b"", "lab.Imu")])
def test_topics_without_their_descriptors_are_left_out_by_name(tmp_path, schema, name):
    """Descriptors that are cut, empty, or of other messages."""
    with pytest.raises(RecordingError, match="encoded as 'protobuf', and its descriptors"):
        reading.read(recorded(tmp_path / "run.mcap", schema, name))


def test_hostile_descriptors_and_messages_end():
    """Messages that hold themselves, lists without end, a field of another kind."""
    itself = described("Me", ("x", 1, 1, DOUBLE, ""), ("me", 2, 1, MESSAGE, ".Me"))
    decoder = ProtobufDecoder(inner(1, inner(12, "proto3") + inner(4, itself)), "Me")
    raw = double(1, 1.0)
    for _ in range(50):
        raw = inner(2, raw)
    assert len(decoder.decode(raw).numbers) <= 30
    for _ in range(200):
        raw = inner(2, raw)
    with pytest.raises(Unreadable):
        decoder.decode(raw)
    many = ProtobufDecoder(inner(1, inner(4, described("L", ("v", 1, 3, INT32, "")))), "L")
    with pytest.raises(TooManyNumbers):
        many.decode(inner(1, b"\x01" * 5000))
    with pytest.raises(Unreadable):
        many.decode(double(1, 1.0))


def test_stamps_in_json(tmp_path):
    """Foxglove's JSON writes sec and nsec: one time, and the clock; a duration stays two numbers."""
    path = tmp_path / "run.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="", library="test")
        channel = writer.register_channel("/j", "json", writer.register_schema("any", "jsonschema", b"{}"))
        for i in range(5):
            stamp = ZERO + i * 1001
            said = {"timestamp": {"sec": stamp // 10**9, "nsec": stamp % 10**9}, "took": {"sec": 0, "nsec": 5}, "f": i}
            writer.add_message(channel, ZERO + i * 1001, json.dumps(said).encode(), ZERO)
        writer.finish()
    found = reading.read(path)
    assert found.time().tolist() == [0, 1001, 2002, 3003, 4004]
    assert found.group().channels[found.group().clock.index].name == "timestamp"
    assert found.column("took.nsec").tolist() == [5] * 5
