"""Messages of robots as files: a bag of ROS 1 by rosbags, MCAP by its library, of the same inertial data."""

import json

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import Writer as Ros2BagWriter
from rosbags.typesys import Stores, get_typestore

ZERO = 1_795_248_000_123_456_789
STEP = 5_000_001
COUNT = 40


def messages(store, is_ros1):
    """(topic, time [ns], message) of an IMU, a wrench and joint states, in order of time."""
    types = store.types
    header, stamp = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    vector, quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]

    def head(i, name):
        at = ZERO + i * STEP - 1000
        made = stamp(sec=at // 10**9, nanosec=at % 10**9)
        return header(seq=i, stamp=made, frame_id=name) if is_ros1 else header(stamp=made, frame_id=name)

    def three(i):
        return vector(x=float(i), y=i / 4, z=-float(i))

    for i in range(COUNT):
        imu = types["sensor_msgs/msg/Imu"](
            header=head(i, "imu"), orientation=quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=np.zeros(9), angular_velocity=three(i), angular_velocity_covariance=np.zeros(9),
            linear_acceleration=three(-i), linear_acceleration_covariance=np.arange(9.0),
        )  # fmt: skip
        yield "/imu", ZERO + i * STEP, imu
        if i % 4 == 0:
            wrench = types["geometry_msgs/msg/Wrench"](force=three(i), torque=three(2 * i))
            yield (
                "/ft",
                ZERO + i * STEP,
                types["geometry_msgs/msg/WrenchStamped"](header=head(i, "x" * i), wrench=wrench),
            )
            names = ["hip", "knee"]
            yield "/joints", ZERO + i * STEP, types["sensor_msgs/msg/JointState"](
                header=head(i, ""), name=names, position=np.array([i, -i], dtype=float), velocity=np.zeros(2),
                effort=np.array([], dtype=float),
            )  # fmt: skip


def _write(writer, store, is_ros1, serialized):
    """Every message, with a connection for each topic."""
    connections = {}
    for topic, at, message in messages(store, is_ros1):
        kind = message.__msgtype__
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=store)
        writer.write(connections[topic], at, serialized(message, kind))


def bag(path, compression=None):
    """A bag of ROS 1."""
    store = get_typestore(Stores.ROS1_NOETIC)
    writer = BagWriter(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        _write(writer, store, True, store.serialize_ros1)
    return path


def ros2_bag(path, version=9):
    """A bag of ROS 2 in SQLite."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    folder = path.with_suffix("")
    with Ros2BagWriter(folder, version=version) as writer:
        _write(writer, store, False, store.serialize_cdr)
    return (folder / f"{folder.name}.db3").rename(path)


def mcap(path, profile="ros2", compression=CompressionType.ZSTD, extra=None):
    """MCAP of ROS 1 or ROS 2, in small chunks; ``extra`` writes more."""
    is_ros1 = profile == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=2048, compression=compression)
        writer.start(profile=profile, library="test")
        channels = {}
        for topic, at, message in messages(store, is_ros1):
            kind = message.__msgtype__
            if topic not in channels:
                text, _ = store.generate_msgdef(kind, ros_version=1 if is_ros1 else 2)
                name = kind.replace("/msg/", "/") if is_ros1 else kind
                schema = writer.register_schema(name, "ros1msg" if is_ros1 else "ros2msg", text.encode())
                channels[topic] = writer.register_channel(topic, "ros1" if is_ros1 else "cdr", schema)
            raw = store.serialize_ros1(message, kind) if is_ros1 else store.serialize_cdr(message, kind)
            writer.add_message(channels[topic], at, bytes(raw), at)
        if extra is not None:
            extra(writer)
        writer.finish()
    return path


def json_topic(writer):
    """A topic of JSON whose shape changes, and one in an encoding that is not read."""
    schema = writer.register_schema("any", "jsonschema", b"{}")
    channel = writer.register_channel("/json", "json", schema)
    for i in range(6):
        document = {"a": i, "b": {"c": [i, 2.5]}, "text": "x"} | ({"more": True} if i > 3 else {})
        writer.add_message(channel, ZERO + i, json.dumps(document).encode(), ZERO + i)
    other = writer.register_channel("/other", "protobuf", writer.register_schema("p", "protobuf", b"\x0a"))
    writer.add_message(other, ZERO, b"\x01", ZERO)
