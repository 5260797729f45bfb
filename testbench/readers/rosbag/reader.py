"""Reader of bags of ROS 1, by rosbags in a process of its own."""

from pathlib import Path

from ...recording import Recording
from ..extras import needs
from ..isolated import open_isolated
from ..registry import Reader, ReadOptions


def open_rosbag(path: Path, options: ReadOptions) -> Recording:
    """Look at the topics; the messages are read when asked for."""
    return open_isolated(path, "testbench.readers.rosbag.library", "open_library")


READER = Reader(
    name="ROS 1 bag",
    extensions=(".bag",),
    identify=lambda head: head.startswith(b"#ROSBAG V2"),
    open=open_rosbag,
    needs=needs("rosbag"),
)
