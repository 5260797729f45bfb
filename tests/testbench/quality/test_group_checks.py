"""What names, units and numbers of the channels of a group show, the same for every format."""

import numpy as np
import pytest

from balance.results import document
from testbench.quality.clipping import Clipping
from testbench.quality.group_checks import ChannelStats, GroupCheck, RecordingCheck
from testbench.recording import Block, Channel, Group, Recording, SensorRange, UniformClock

RANDOM = np.random.default_rng(7)


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


def gathered(samples, block):
    """Statistics of samples that come in blocks."""
    stats = ChannelStats()
    for start in range(0, len(samples), block):
        stats.update(samples[start : start + block])
    return stats


@pytest.mark.parametrize("block", [1, 13, 5000])
def test_numbers_are_of_the_finite_samples(block):
    """Counts are of all samples; min, max and mean of the finite ones; first and last as they are."""
    samples = RANDOM.normal(1e-4, 3.0, 5000)
    samples[[0, 7, 4000]] = np.nan, np.inf, -np.inf
    finite = samples[np.isfinite(samples)]
    found = document(gathered(samples, block))
    assert (found["n"], found["nan"], found["first"], found["last"]) == (5000, 3, None, samples[-1])
    assert (found["min"], found["max"]) == (finite.min(), finite.max())
    assert found["mean"] == pytest.approx(finite.mean(), rel=1e-9)


def test_sums_beyond_float64():
    """Samples whose sum overflows still have their extremes; their mean is not called a number."""
    found = document(gathered(np.full(10, 1.7e308), 10))
    assert (found["max"], found["nan"], found["mean"]) == (1.7e308, 0, None)


def clipped(samples, limit=None, block=100):
    """What is said of a channel that comes in blocks."""
    clipping = Clipping(limit)
    for start in range(0, len(samples), block):
        clipping.update(samples[start : start + block])
    return clipping, clipping.message("g")


@pytest.mark.parametrize("block", [1, 7, 100, 3000])
def test_samples_at_a_stated_range_are_counted(block):
    """Counts and longest run at +-16 g do not depend on blocks; 16 bits reach +15.9995 g only."""
    samples = np.clip(25 * np.sin(np.arange(3000) / 9.0), -16, 16 - 16 / 2**15)
    clipping, message = clipped(samples, SensorRange(16.0, "g", 16), block)
    top, bottom = samples >= 15.9995, samples <= -15.9995
    assert (clipping.above.count, clipping.below.count) == (top.sum(), bottom.sum())
    runs = np.diff(np.flatnonzero(np.diff(np.concatenate(([0], top | bottom, [0])))))[::2]
    assert max(clipping.above.longest, clipping.below.longest) == runs.max()
    assert message is not None


def test_a_signal_within_its_range_is_clean():
    """No sample at the limit: nothing is said."""
    samples = 15.9 * np.sin(np.arange(3000) / 9.0)
    assert clipped(samples, SensorRange(16.0, "g", 16))[1] is None


@pytest.mark.parametrize(("low", "high"), [(-10.0, 10.0), (-99.0, 10.0), (-10.0, 99.0)])
def test_flat_tops_are_suspected_without_a_range(low, high):
    """A fast signal cut on one side or both is noticed without a range, in blocks of any size."""
    samples = np.clip(RANDOM.normal(0, 1, 4000).cumsum() % 7 * np.sin(np.arange(4000) / 2.0) * 4, low, high)
    for block in (50, 4000):
        assert "longest run" in clipped(samples, block=block)[1]


@pytest.mark.parametrize(
    "samples",
    [
        np.round(np.sin(np.arange(5000) / 200.0) * 20) / 20,  # a slow signal, quantised: its peaks are flat
        np.repeat([0.0, 1.0], 500).tolist() * 5,  # a switch
        np.maximum(RANDOM.normal(-1, 1, 5000), 0.0),  # an unloaded force plate: flat at zero
        np.arange(5000) * 7.3 % 360.0,  # an angle that wraps
    ],
    ids=["quantised", "switch", "unloaded", "wrapping"],
)
def test_what_is_flat_by_nature_is_not_suspected(samples):
    """Quantised slow signals, switches, unloaded sensors and wrapping angles are no saturated sensors."""
    assert clipped(np.asarray(samples))[1] is None


@pytest.mark.parametrize(
    ("code", "count", "said"),
    [
        (9.9e37, 3, "3 samples are 9.9e+37, the code of an instrument's overflow"),
        (-9.9e37, 1, "1 samples are -9.9e+37"),
        (float(np.float32(9.91e37)), 2, "2 samples are 9.91e+37"),
        (3.4028234663852886e38, 2, "overflow"),
        (-9999.0, 2, "2 samples are -9999, the code of a missing value"),
        (-999.25, 5, "missing value"),
        (99999.0, 1, "missing value"),
        (-9998.0, 2, None),
    ],
)
def test_codes_of_overflow_and_missing_values(code, count, said):
    """They are found with their number and first place, in whatever block they stand."""
    samples = RANDOM.normal(0.0, 100.0, 5000)
    samples[RANDOM.permutation(4000)[:count] + 500] = code
    check = GroupCheck(Group("g", (Channel("F", "N"),)))
    for start in range(0, 5000, 700):
        check.update(Block(check.group, (samples[start : start + 700],), start))
    found = [(f.channel, f.where, f.message) for f in check.findings() if f.code == "coded_values"]
    first = int(np.argmax(samples == code))
    assert [(channel, where) for channel, where, _ in found] == ([("F", f"sample {first}")] if said else [])
    assert said is None or said in found[0][2]


def test_values_near_a_code_are_measured():
    """-9999 among samples down to -9000 is one of them; 9999 is a count that was reached."""
    check = GroupCheck(Group("g", (Channel("F", "N"), Channel("n"))))
    check.update(Block(check.group, (np.linspace(-9999.0, 0.0, 500), np.arange(9500.0, 10000.0)), 0))
    assert "coded_values" not in {finding.code for finding in check.findings()}
