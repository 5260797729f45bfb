"""Sensors that failed and records that are not whole: said, and no reduction where there is none."""

from dataclasses import replace

import numpy as np
import pytest

from balance.results import document
from studies import simulated_runs as memory
from testbench.errors import AnalysisError
from testbench.quality.clipping import flat_tops, is_dead, stuck_value
from testbench.recording import Finding
from testbench.vibration.amplitude import Amplitude
from testbench.vibration.condition import unequal_durations
from testbench.vibration.metrics import Measure
from testbench.vibration.reduction import analyze
from testbench.vibration.run_pairs import ConditionKey, Pair

RATE = 5000.0


@pytest.fixture(scope="module")
def runs():
    """A run with counter-masses and one without."""
    return memory.scene("x").run(0), memory.scene("x", masses={}).run(1)


def analysed(balanced, unbalanced, *more):
    """The reductions of the base along x, and the findings."""
    named = [replace(run, path=run.path.with_name(f"r{i}.h5")) for i, run in enumerate((balanced, unbalanced, *more))]
    found = analyze(named, Measure())
    return [r for r in found.reductions if r.axis == "x"], {f.code: f for f in found.findings}


def changed(run, change):
    """The run with the base's acceleration along x changed."""
    return memory.with_values(run, "AccX", change(run.channel("AccX").copy()))


def cut(values, start, stop, put):
    """Values with a part replaced."""
    values[start:stop] = put
    return values


def test_whole_records_have_no_faults(runs):
    """A sound channel in noise shows none of it."""
    for run in runs:
        values = run.channel("AccX")
        assert not is_dead(values)
        assert stuck_value(values, RATE) is None
        assert flat_tops(values) is None
    assert not {"dead_channel", "held_value", "durations_differ", "not_analyzed"} & analysed(*runs)[1].keys()


@pytest.mark.parametrize("side", [0, 1])
def test_an_unplugged_sensor_tells_no_reduction(runs, side):
    """Zeros with counter-masses are no reduction of 100 %."""
    given = list(runs)
    given[side] = changed(given[side], np.zeros_like)
    (found,), findings = analysed(*given)
    assert found.percent is None
    assert found.interval is None
    assert "dead_channel" in findings
    assert "no_noise_floor" not in findings


def test_a_sensor_unplugged_in_the_motion_is_said(runs):
    """From the middle of the record on one value, before it noise and motion."""
    values = runs[0].channel("AccX")
    _, findings = analysed(changed(runs[0], lambda v: cut(v, len(v) // 3, len(v), 0.0)), runs[1])
    assert f"from {len(values) // 3 / RATE:.3f} s" in findings["held_value"].message


def test_a_coarse_channel_at_rest_is_not_unplugged():
    """Steps of 0.1 of a motion between two rests: what is held at rest is no fault."""
    motion = np.concatenate([np.zeros(2000), np.sin(np.arange(5000) / 100.0), np.zeros(3000)])
    assert stuck_value(np.round(motion, 1), RATE) is None


def test_flat_tops_below_the_stated_range_make_a_bound(runs):
    """An amplifier that ends at 2 m/s2 in front of a sensor of 50 g: the reduction is a lower bound."""
    top = 0.5 * np.abs(runs[1].channel("AccX")).max()
    (found,), findings = analysed(runs[0], changed(runs[1], lambda v: np.clip(v, -top, top)))
    assert found.limit == "at_least"
    assert findings["clipping_suspected"].where == "r1"


def test_a_run_that_cannot_be_read_keeps_no_other_out(runs):
    """Ten cells without a number in one of two repeats: the other is analysed, and the first is named."""
    odd = changed(runs[1], lambda v: cut(v, 100, 110, np.nan))
    (found,), findings = analysed(runs[0], runs[1], odd)
    assert found.n == (1, 1)
    assert "left out" in findings["not_analyzed"].message
    with pytest.raises(AnalysisError, match="AccX"):
        analysed(runs[0], odd)


def test_a_record_that_ends_in_the_motion_is_said(runs):
    """A run cut at a third of its length looks as if it vibrated less."""
    values = runs[1].channel("AccX")
    short = Pair(ConditionKey.of(runs[0]), {}, (runs[0],), (runs[1],))
    whole = [{("base_acc", "x"): Amplitude.of(v[None], RATE, Measure())[0]} for v in (values, values)]
    ended = [whole[0], {("base_acc", "x"): Amplitude.of(values[None, : len(values) // 3], RATE, Measure())[0]}]
    assert unequal_durations(short, whole) == []
    assert [f.code for f in unequal_durations(short, ended)] == ["durations_differ"]


def test_more_vibration_with_counter_masses_is_said(runs):
    """Where the sheet has them the wrong way round."""
    turned = [replace(run, conditions=other.conditions) for run, other in zip(runs, runs[::-1], strict=True)]
    (found,), findings = analysed(turned[1], turned[0])
    assert found.percent < 0.0
    assert "vibrates_more" in findings


def clipped(run):
    """The run with AccX at the end of its range, at six tenths of its largest value, as ingest finds it."""
    values = run.channel("AccX")
    middle = np.median(values)
    top = 0.6 * np.abs(values - middle).max()
    found = Finding("clipping", "AccX", run.name, f"{run.name}: AccX: at the end of its range")
    cut_off = changed(run, lambda v: middle + np.clip(v - middle, -top, top))
    return replace(cut_off, findings=(*run.findings, found))


def test_what_a_clipped_side_leaves_of_the_interval(runs):
    """Without counter-masses more was there than was read, with them more is left; of both nothing is known."""
    ((whole,), _), ((low,), _) = analysed(*runs), analysed(runs[0], clipped(runs[1]))
    assert whole.limit is None
    assert whole.interval[0] < whole.percent < whole.interval[1] < 100.0
    assert low.limit == "at_least"
    assert low.interval[0] < whole.percent
    assert low.percent < whole.percent
    assert low.interval[1] == 100.0
    assert document(low)["at_least_percent"] == low.interval[0]
    (high,), _ = analysed(clipped(runs[0]), runs[1])
    assert high.limit == document(high)["limit"] == "at_most"
    assert high.percent > whole.percent
    assert high.interval is document(high)["at_least_percent"] is None
    (unknown,), _ = analysed(*map(clipped, runs))
    assert unknown.limit is unknown.interval is None
