"""What the names and units of a group show, the same for every format."""

import numpy as np
import pytest

from testbench.quality.group_checks import RecordingCheck
from testbench.recording import Block, Channel, Group, Recording, UniformClock


def found_in(channels, samples=4, clock=None):
    """Codes by channel of a group of these channels."""
    group = Group("g", tuple(channels), clock)
    recording = Recording(None, "none", "none", (group,), lambda report: iter(()))
    check = RecordingCheck(recording)
    columns = tuple(np.arange(samples, dtype=float) ** (i + 1) for i in range(len(channels)))
    check.update(Block(group, columns, 0))
    return {(finding.code, finding.channel) for finding in check.findings()}


@pytest.mark.parametrize(
    ("label", "unit", "doubtful"),
    [
        ("Force", "g", True), ("Fx", "m/s^2", True), ("Kuvvet", "kg", True), ("F", "m/s^3", True),
        ("hammer", "g", True), ("AccX", "N", True), ("acc", "m/s^3", True), ("ivme", "kN", True), ("ax", "N", True),
        ("Force", "N", False), ("AccX", "g", False), ("load", "kg", False), ("mass", "kg", False),
        ("jerk", "m/s^3", False), ("Force", None, False),
    ],
)  # fmt: skip
def test_units_that_do_not_go_with_the_name(label, unit, doubtful):
    """Force in a unit of acceleration, mass or jerk, and acceleration in one of force or jerk, whatever the format."""
    assert (("unit_doubtful", label) in found_in([Channel(label, unit)])) == doubtful


@pytest.mark.parametrize(
    ("channels", "samples", "clock", "missing"),
    [
        ([Channel("a", "g")], 4, None, True),
        ([Channel("a", "g")], 4, UniformClock(9.0), False),
        ([Channel("a", "g")], 1, None, False),
        ([Channel("Frequency"), Channel("a", "g")], 4, None, False),
        ([Channel("f", "Hz"), Channel("a", "g")], 4, None, False),
        ([Channel("node"), Channel("x", "m")], 4, None, False),
    ],
)
def test_only_what_ought_to_follow_time_lacks_a_clock(channels, samples, clock, missing):
    """Single numbers and values over frequency or node have no time to lack."""
    assert (("no_clock", None) in found_in(channels, samples, clock)) == missing


def test_time_since_a_date_is_a_unit():
    """As netCDF writes it."""
    codes = found_in([Channel("time", "milliseconds since 2024-01-01"), Channel("x", "furlongs since 2024-01-01")])
    assert ("unit_unknown", "time") not in codes
    assert ("unit_unknown", "x") in codes
