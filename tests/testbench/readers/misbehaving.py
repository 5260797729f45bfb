"""Readers that do what a library may do on a damaged file; they run in a process of their own."""

import os
import time

import numpy as np

from testbench.errors import RecordingError
from testbench.recording import (
    Block,
    Channel,
    Finding,
    Group,
    Recording,
    Refusal,
    SensorRange,
    TimeColumn,
    UniformClock,
)

GROUP = Group("fast µ", (Channel("a [N]", "N", "a"), Channel("t", None)), TimeColumn(1, 1e-6, assumed=True))
LATE = Group("late", (Channel("b"),), UniformClock(0.1 + 0.2, -1.5))


def well(path):
    """A recording of all kinds of things."""

    def read(report):
        yield Block(GROUP, (np.array([1.5, np.nan]), np.arange(2.0)), 0, None, 17)
        report(Finding("constant_channel", "a [N]", "line 3", "ünusual"))
        os.write(1, b"libraries print things")
        yield Block(LATE, (np.arange(200_000.0),), 0)

    return Recording(
        path, "Test", "test", (GROUP,), read, "simulated", {"a": "b"}, {"c": "d"}, ("e",),
        (SensorRange(16.0, "g", 16),), 1 / 3, (Finding("dialect", None, None, "text"),),
    )  # fmt: skip


def crashes(path):
    """As a library in C on a damaged file."""
    os.abort()


def crashes_later(path):
    """The header is fine."""

    def read(report):
        yield Block(LATE, (np.arange(3.0),), 0)
        os.abort()

    return Recording(path, "Test", "test", (LATE,), read)


def hangs(path):
    """Forever."""
    while True:
        time.sleep(1)


def swallows(path):
    """More memory than any file needs."""
    held = []
    while True:
        held.append(np.empty(1 << 26))


def refuses(path):
    """As a reader should."""
    raise Refusal(path.name, Finding("cut_file", "a", "byte 3", "it is cut"))


def lacks(path):
    """As where a library is missing."""
    raise RecordingError("pip install it")


def fails(path):
    """As a library in Python on a damaged file."""
    raise KeyError("missing")


def nests(path):
    """Without end."""
    return nests(path)
