"""Bags of ROS 1 and MCAP: inertial data, wrenches and joint states, each topic with its own time."""

import sqlite3
import struct
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from testbench.errors import RecordingError
from testbench.readers.ros_messages import RosDecoder, message_fields
from testbench.readers.ros_topics import TooManyNumbers, Topic, UnknownType, Unreadable, json_message
from testbench.recording import TextLog, TextSeries, TimeColumn

from . import reading, robots
from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")

I = np.arange(robots.COUNT)  # noqa: E741


def _assert_known(found):
    """What ``robots.messages`` wrote."""
    np.testing.assert_array_equal(found.column("linear_acceleration.x", "/imu"), -I)
    np.testing.assert_array_equal(found.column("angular_velocity.y", "/imu"), I / 4)
    np.testing.assert_array_equal(found.column("linear_acceleration_covariance[8]", "/imu"), np.full(len(I), 8.0))
    np.testing.assert_array_equal(found.column("wrench.torque.z", "/ft"), -2 * I[::4])
    np.testing.assert_array_equal(found.column("position[knee]", "/joints"), -I[::4])
    np.testing.assert_array_equal(found.column("log time", "/imu"), I * robots.STEP)
    np.testing.assert_array_equal(found.column("header.stamp", "/imu"), I * robots.STEP - 1000)
    assert found.recording.metadata["zero"] == f"{robots.ZERO} ns since 1970"
    group = found.groups["/imu"]
    assert group.clock == TimeColumn([c.name for c in group.channels].index("header.stamp"), 1e-9)
    assert found.unit("header.stamp") == "ns"


@pytest.mark.parametrize("compression", [None, BagWriter.CompressionFormat.BZ2, BagWriter.CompressionFormat.LZ4])
def test_bags_give_what_was_written(tmp_path, compression):
    """Numbers, names of joints, and times to the nanosecond."""
    _assert_known(reading.read(robots.bag(tmp_path / "run.bag", compression)))


@pytest.mark.parametrize("version", [8, 9])
def test_bags_of_ros_2_give_what_was_written(tmp_path, version):
    """The same, with and without the descriptions of their types."""
    path = robots.ros2_bag(tmp_path / "run.db3", version)
    with closing(sqlite3.connect(path)) as database:
        database.execute(f"DELETE FROM {'message_definitions' if version == 9 else 'metadata'}")
        database.commit()
    _assert_known(reading.read(path))


def test_databases_that_are_no_bag_of_ros_2_are_refused(tmp_path):
    """By what they are; types that nobody describes, other encodings and messages of no topic by name."""
    other = tmp_path / "other.db3"
    with closing(sqlite3.connect(other)) as database:
        database.execute("CREATE TABLE topics (id INTEGER)")
    with pytest.raises(RecordingError, match="no bag of ROS 2"):
        reading.read(other)
    path = robots.ros2_bag(tmp_path / "run.db3")
    for change, said in (
        ("type = 'mine/msg/Force'", "neither the bag nor rosbags describes"),
        ("serialization_format = 'x'", "encoded as 'x'"),
    ):
        with closing(sqlite3.connect(path)) as database:
            database.execute(f"UPDATE topics SET {change} WHERE name = '/ft'")
            database.commit()
        found = reading.read(path)
        assert said in found.message("left_out")
        assert set(found.groups) == {"/imu", "/joints"}
    with closing(sqlite3.connect(path)) as database:
        database.execute("UPDATE messages SET topic_id = 77 WHERE id = 30")
        database.commit()
    with pytest.raises(RecordingError, match="a message of topic 77"):
        reading.read(path)
    path.with_name("run.db3-wal").write_bytes(b"x")
    with pytest.raises(RecordingError, match=r"messages of run\.db3-wal"):
        reading.read(path)
    path.write_bytes(bytes(range(256)) * 8)
    with pytest.raises(RecordingError, match="does not begin as an SQLite database"):
        reading.read(path)


def test_of_a_cut_bag_of_ros_2_whole_messages_are_read_and_never_zeros(tmp_path):
    """Messages of several pages and of less, the file cut at each of its pages and within: an error that says so."""
    path = robots.ros2_bag(tmp_path / "run.db3")
    text = "ab" * 5000
    raw = b"\0\1\0\0" + struct.pack("<I", len(text) + 1) + text.encode() + b"\0"
    with closing(sqlite3.connect(path)) as database:
        database.execute("INSERT INTO topics (id, name, type, serialization_format, offered_qos_profiles, "
                         "type_description_hash) VALUES (9, '/log', 'std_msgs/msg/String', 'cdr', '', '')")  # fmt: skip
        stamps = [(9, robots.ZERO + i * robots.STEP, raw) for i in range(12)]
        database.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", stamps)
        database.commit()
    whole, content, kept, refused = reading.read(path), path.read_bytes(), set(), []
    for at in range(1024, len(content), 2048):
        path.write_bytes(content[:at])
        try:
            found = reading.read(path)
        except RecordingError as error:
            refused.append(str(error))
            continue
        assert "cut_file" in found.codes
        for group, columns in found.data.items():
            for ours, theirs in zip(columns, whole.data[group], strict=True):
                np.testing.assert_array_equal(ours, theirs[: len(ours)])
        assert {t for series in found.recording.texts.kept for t in series.texts if series.group == "/log"} <= {text}
        kept.add(sum(len(columns[0]) for columns in found.data.values()))
    assert len(kept) > 5
    assert all("the file ends at byte" in said for said in refused)


@pytest.mark.parametrize("profile", ["ros1", "ros2"])
@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
def test_mcap_gives_what_was_written(tmp_path, profile, compression):
    """The same of both serialisations."""
    _assert_known(reading.read(robots.mcap(tmp_path / "run.mcap", profile, compression)))


def test_json_is_read_and_shapes_are_kept_apart(tmp_path):
    """Numbers by their path; where a message has others, another group begins; other encodings are named."""
    found = reading.read(robots.mcap(tmp_path / "run.mcap", extra=robots.json_topic))
    assert found.column("b.c[0]", "/json").tolist() == [0, 1, 2, 3]
    assert found.column("more", "/json part 2").tolist() == [1, 1]
    assert "'protobuf'" in found.message("left_out")


def test_integers_that_float64_rounds_are_said():
    """2**53 + 1 of one message; neither floating-point numbers as large nor times, which are counted from a zero."""
    topic, texts = Topic(Path("run"), "/json", json_message, robots.ZERO), TextLog()
    for i in range(3):
        raw = b'{"ticks": %d, "large": 1e300, "small": %d, "mode": "%s"}' % (2**53 + i, i, (b"idle", b"run")[i > 1])
        topic.take(robots.ZERO + i, raw, texts)
    assert texts.kept == [TextSeries("/json", "mode", [0, 2], ["idle", "run"])]
    findings = []
    (block,) = topic.remaining_blocks(findings.append)
    assert block.columns[0].tolist() == [0, 1, 2]
    assert [(f.code, f.channel) for f in findings] == [("not_exact", "ticks")]


@pytest.mark.parametrize(("stamps", "clock"), [([1, 2, 3], 1), ([1, 1, 2], 0), ([3, 2, 4], 0)])
def test_a_stamp_is_the_clock_where_it_rises(stamps, clock):
    """Messages of two sources with the same stamps, or late ones, go by the time at which they were logged."""
    topic = Topic(Path("run"), "/json", json_message, robots.ZERO)
    for stamp in stamps:
        topic.look(b'{"header": {"stamp": {"sec": %d, "nanosec": 0}}}' % stamp)
    (shape,) = topic.shapes.values()
    assert shape.group.clock.index == clock


@pytest.mark.parametrize("share", [0.3, 0.7, 0.98])
def test_a_cut_mcap_keeps_its_whole_messages(tmp_path, share):
    """How many messages come before the end; one who accepts the loss has them."""
    path = robots.mcap(tmp_path / "run.mcap")
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    found = reading.read(path)
    count = sum(len(columns[0]) for columns in found.data.values())
    assert f"{count} whole messages" in found.message("cut_file")
    assert 0 < count <= 60


def test_a_flipped_bit_in_a_chunk_is_found(tmp_path):
    """By the checksum of the chunk, or by what unpacks it."""
    path = robots.mcap(tmp_path / "run.mcap", compression=CompressionType.NONE)
    raw = bytearray(path.read_bytes())
    raw[raw.find(np.array([2.0, 0.5, -2.0]).tobytes()) + 3] ^= 1
    path.write_bytes(raw)
    with pytest.raises(RecordingError, match="crc"):
        reading.read(path)


def test_a_cut_bag_is_refused(tmp_path):
    """The index lies at the end; a bag that was never closed has none."""
    path = robots.bag(tmp_path / "run.bag")
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    with pytest.raises(RecordingError):
        reading.read(path)
    path.write_bytes(whole.replace(b"index_pos=", b"index_pos=" + bytes(8), 1)[:2000])
    with pytest.raises(RecordingError):
        reading.read(path)


def test_descriptions_are_read_as_text():
    """Constants, comments, defaults, arrays, nested messages, and types by their short name."""
    text = """
# a comment
uint8 MODE=3
string NAME=a b # c
Header header
float64[3] v
Inner[] inners
float32 gain 1.5
string<=10 s
int16[<=5] few
================================================================================
MSG: pkg/Inner
bool on
builtin_interfaces/Duration d
"""
    fields = message_fields(text, "pkg/msg/Outer", is_ros2=True)
    assert [(f.name, f.count, f.is_array) for f in fields] == [
        ("header", 1, False), ("v", 3, True), ("inners", -1, True), ("gain", 1, False), ("s", 1, False),
        ("few", -1, True),
    ]  # fmt: skip
    assert [f.kind for f in fields[2].kind] == ["bool", "duration"]


@pytest.mark.parametrize("text", ["Unknown x", "float64", "A a", "float64 __import__('os')", "float64[3 x"])
def test_descriptions_that_are_none_are_said(text):
    """What is no field is never guessed; a message within itself neither."""
    with pytest.raises(UnknownType):
        message_fields(text + "\n" + "=" * 80 + "\nMSG: pkg/A\nA a\n", "pkg/M", is_ros2=False)


@pytest.mark.parametrize(("is_cdr", "padding"), [(False, 0), (True, 7)])
def test_bytes_that_no_field_describes_are_said(is_cdr, padding):
    """A message longer than its description is of another one: its numbers would stand in the wrong places."""
    decoder = RosDecoder(message_fields("float64 x", "p/M", is_ros2=is_cdr), is_cdr=is_cdr)
    raw = (b"\x00\x01\x00\x00" if is_cdr else b"") + np.array([1.5], "<f8").tobytes()
    assert decoder.decode(raw + bytes(padding)).numbers == [1.5]
    with pytest.raises(Unreadable, match=f"is {padding + 1} longer"):
        decoder.decode(raw + bytes(padding + 1))


def test_messages_are_never_longer_than_their_bytes():
    """Lengths of gigabytes in a few bytes, and pictures."""
    decoder = RosDecoder(message_fields("float64[] x\nstring s", "p/M", False), is_cdr=False)
    assert decoder.decode(b"\x00\x00\x00\x00\x01\x00\x00\x00a").numbers == []
    for raw in (b"", b"\x02\x00\x00\x00" + bytes(8), b"\x00\x00\x00\x00\xff\xff\xff\xffa"):
        with pytest.raises(Unreadable):
            decoder.decode(raw)
    with pytest.raises(TooManyNumbers):
        decoder.decode(b"\xff\xff\xff\xff" + bytes(8))


def test_a_message_of_constants_is_a_byte_in_cdr():
    """DDS knows no structure without a member: rosbags writes one, so that what follows lies behind it."""
    text = f"pkg/Only[2] limits\nfloat64 x\n{'=' * 80}\nMSG: pkg/Only\nint32 MOST=3\n"
    types = get_typestore(Stores.EMPTY)
    types.register(get_types_from_msg(text, "pkg/msg/M"))
    only = types.types["pkg/msg/Only"]()
    raw = types.serialize_cdr(types.types["pkg/msg/M"]([only, only], 2.5), "pkg/msg/M")
    message = RosDecoder(message_fields(text, "pkg/msg/M", is_ros2=True), is_cdr=True).decode(bytes(raw))
    assert (message.names, message.numbers) == (["x"], [2.5])
