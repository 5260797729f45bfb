import numpy as np
import pytest

from testbench.quality import log_description, time_steps
from testbench.quality.group_checks import RecordingCheck
from testbench.recording import Block, Channel, Group, Recording, TimeColumn, UniformClock

TIME, ACC = Channel("Time (s)", "s", "Time"), Channel("AccX (g)", "g", "AccX")


def checked(times_s, block=1000, channels=(TIME, ACC), stated=None, column=None):
    """The check of a recording with these times, read in blocks."""
    group = Group("log", channels, column or TimeColumn(0))
    recording = Recording(None, "made", "made", (group,), iter, stated_rate_hz=stated)
    check = RecordingCheck(recording)
    for start in range(0, len(times_s), block):
        part = times_s[start : start + block]
        columns = (part, np.sin(part))[: len(channels)]
        check.update(Block(group, columns, start, range(start + 2, start + 2 + len(part))))
    return check.groups["log"], {f.code: f for f in check.findings()}


@pytest.mark.parametrize("block", [1, 7, 1000, 10**6])
def test_steps_do_not_depend_on_blocks(block):
    """Median, extremes and ends of a jittery clock are those of the whole column, however it is cut in blocks."""
    random = np.random.default_rng(3)
    column = np.cumsum(random.normal(0.01, 1e-4, 3000))
    group, _ = checked(column, block)
    steps = np.diff(column)
    assert log_description.clock(group) == {
        "t_first_s": column[0], "t_last_s": column[-1], "dt_min_s": steps.min(), "dt_median_s": np.median(steps),
        "dt_max_s": steps.max(), "non_increasing": 0,
    }  # fmt: skip
    assert group.rate_hz == pytest.approx(1.0 / np.mean(steps), rel=1e-12)


def test_median_in_bounded_memory(monkeypatch):
    """With more different steps than are kept, the median is right to the promised part."""
    monkeypatch.setattr(time_steps, "_MOST_STEPS", 1 << 10)
    steps = np.random.default_rng(4).lognormal(-5, 0.02, 50_001)
    kept = time_steps.Steps()
    for part in np.array_split(steps, 40):
        kept.add(part)
    assert kept.quantile(0.5) == pytest.approx(np.median(steps), rel=2**-10)
    assert len(kept.values) <= 1 << 10
    assert kept.counts.sum() == len(steps)


def test_falling_and_repeated_times_across_blocks():
    """Each step that does not increase is found once, with its line and size, also where two blocks meet."""
    column = np.arange(30) / 10
    column[10], column[20:] = column[9], column[20:] - 1
    for block in (1, 10, 30):
        group, findings = checked(column, block)
        assert group.clock.non_increasing == 2
        assert findings["time_not_increasing"].where == "line 12, line 22"
        assert "-0.9 s at line 22" in findings["time_not_increasing"].message


@pytest.mark.parametrize(
    ("rate", "decimals"), [(2048, 4), (300, 4), (1024, 4), (51_200, 6), (3000, 6), (2560, 5), (833, 4)]
)
@pytest.mark.parametrize("first", [0.0, 86_400.0])
def test_the_rate_of_rounded_times(rate, decimals, first):
    """Rounding leaves the median at a whole number of the last digit; the rate is that of the mean, and it is said."""
    column = np.round(first + np.arange(20_000) / rate, decimals)
    group, findings = checked(column)
    assert abs(1 / np.median(np.diff(column)) / rate - 1) > 9e-5
    assert group.rate_hz == pytest.approx(rate, rel=2 * 10.0**-decimals / (column[-1] - first))
    assert group.rate_source == "mean_step"
    assert f"it is {group.rate_hz:.6g} Hz by their mean" in findings["rate_rounded"].message
    gap = np.concatenate([column[:9000], column[12_000:]])
    group, findings = checked(gap)
    assert group.rate_hz == pytest.approx(rate, rel=1e-4)
    assert "time_gap" in findings


def test_the_rate_of_times_rounded_to_floating_point():
    """Seconds since 1970 at 51.2 kHz: neighbours of float64 are a hundredth of a step apart."""
    group, _ = checked(1.7e9 + np.arange(20_000) / 51_200)
    assert (group.rate_hz, group.rate_source) == (pytest.approx(51_200, rel=1e-5), "mean_step")


def test_gaps_are_found_with_their_place():
    """A step of 6 samples is a gap before its line; a jitter of a tenth is none."""
    column = np.delete(np.arange(1000) / 100, range(500, 505))
    _, findings = checked(column)
    assert (findings["time_gap"].where, findings["time_gap"].channel) == ("line 502", "Time (s)")
    _, findings = checked(np.cumsum(np.random.default_rng(5).uniform(0.0095, 0.0105, 1000)))
    assert "time_gap" not in findings


def test_events_have_no_rate():
    """Times alone, or times whose steps scatter, are no sampled signal, and that is said."""
    edges = np.cumsum(np.linspace(0.01, 0.02, 500))
    group, findings = checked(edges, channels=(TIME,))
    assert group.rate_hz is None
    assert "event_times" in findings
    for change, code in ((0.0, "event_times"), (-0.001, "time_not_increasing")):  # at one time, or back in time
        _, findings = checked(np.insert(edges, 7, edges[6] + change), channels=(TIME,))
        assert ("time_not_increasing" in findings) == (code == "time_not_increasing")
        assert ("1 of them are at the time" in findings["event_times"].message) == (code == "event_times")
    group, findings = checked(edges)
    assert group.rate_hz is None
    assert "time_irregular" in findings


def test_header_against_time_column():
    """A header's rate that differs from the steps by more than its digits is a finding; a rounded one is not."""
    column = np.arange(1000) / 100.7
    assert "rate_contradiction" in checked(column, stated=100.0)[1]
    assert "rate_contradiction" not in checked(column, stated=100.5)[1]


def test_unit_of_time():
    """Milliseconds become seconds; no unit is said to be assumed; an unknown one gives no rate."""
    column = np.arange(100.0)
    group, _ = checked(column, column=TimeColumn(0, 1e-3))
    assert group.rate_hz == pytest.approx(1000.0)
    assert log_description.clock(group)["t_last_s"] == pytest.approx(0.099)
    assert "time_unit_assumed" in checked(column, column=TimeColumn(0, 1.0, assumed=True))[1]
    group, findings = checked(column, column=TimeColumn(0, None))
    assert (group.rate_hz, "time_unit_unknown" in findings) == (None, True)


def test_times_that_are_not_finite():
    """They are counted, and the steps round them are those of the finite ones."""
    column = np.arange(100) / 100
    column[50] = np.nan
    for block in (1, 50, 100):
        group, findings = checked(column, block)
        assert findings["time_unreadable"].message == "no finite number: 1 times"
        assert group.clock.dt_max == pytest.approx(0.02)


def test_a_declared_clock_needs_no_column():
    """Rate and source of a uniform clock are the declared ones."""
    group, _ = checked(np.arange(10.0), column=UniformClock(5120.0))
    assert (group.rate_hz, group.rate_source) == (5120.0, "declared")


def test_a_small_difference_to_the_header_is_said():
    """A clock that drifts from its header's rate by 0.1 % is a note; times that are merely rounded are none."""
    drifting = np.arange(1000) / 99.9
    assert "rate_rounded" in checked(drifting, stated=100.0)[1]
    assert "rate_rounded" not in checked(drifting, stated=99.9)[1]
    assert "rate_rounded" not in checked(np.round(np.arange(5000) / 3000, 6), stated=3000.0)[1]


def test_no_seconds_are_printed_where_the_unit_is_unknown():
    """The numbers of a clock carry their unit in the keys, and none where none is known."""
    for factor, keys in ((1e-3, "_s"), (None, "")):
        group, _ = checked(np.arange(100.0), column=TimeColumn(0, factor))
        assert log_description.clock(group)[f"t_last{keys}"] == 99.0 * (factor or 1.0)


@pytest.mark.parametrize(
    ("late", "lost"),
    [
        (lambda k: 0.0 * k, {}),
        (lambda k: 0.8 * (k == 300), {}),
        (lambda k: 0.3 * np.sin(40.0 * k), {}),
        (lambda k: 1e-4 * k, {}),
        (lambda k: np.floor(k / 2.0) * 2.0 - k, {}),
        (lambda k: 219.0 * (k > 300), {301: 219}),
        (lambda k: 2.0 * (k > 300) + 1.0 * (k > 303) + 0.1 * np.sin(40.0 * k), {301: 2, 304: 1}),
        (lambda k: 5.0 * (k > 300) - 5.0 * (k > 400), {301: 5}),
    ],
)
def test_how_many_samples_a_clock_left_out(late, lost):
    """Not by a late stamp, a jitter, a rate that is a little off, or coarse times; by what all that follows lags."""
    k = np.arange(1000.0)
    expected = np.arange(1000) + sum((number * (k >= at) for at, number in lost.items()), start=np.zeros(1000, int))
    found = time_steps.even_steps(1.7e9 + (k + late(k)) / 2000.0, 2000.0)
    assert (found is None) == (not lost)
    assert found is None or (found == expected).all()
