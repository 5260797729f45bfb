"""Readers of messages of robots, MCAP and bags of ROS 1, by their libraries in a process of their own."""

from pathlib import Path

from ..recording import Recording
from .registry import Reader, ReadOptions, needs
from .subprocess_reader import open_in_subprocess


def open_mcap(path: Path, options: ReadOptions) -> Recording:
    """Look at the topics; the messages are read when asked for."""
    return open_in_subprocess(path, "testbench.readers.mcap_worker", extra="mcap")


def open_rosbag(path: Path, options: ReadOptions) -> Recording:
    """Look at the topics; the messages are read when asked for."""
    return open_in_subprocess(path, "testbench.readers.rosbag_worker", extra="rosbag")


MCAP = Reader(
    name="MCAP",
    extensions=(".mcap",),
    identify=lambda head: head.startswith(b"\x89MCAP0\r\n"),
    open=open_mcap,
    needs=needs("mcap"),
)
ROS_BAG = Reader(
    name="ROS 1 bag",
    extensions=(".bag",),
    identify=lambda head: head.startswith(b"#ROSBAG V2"),
    open=open_rosbag,
    needs=needs("rosbag"),
)
