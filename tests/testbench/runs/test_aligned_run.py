"""A run on one clock: encoders, forces and accelerations at the same instants, gaps left out and not invented."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from balance import datasets
from balance.mechanism.mjcf_parser import load_mechanism
from studies import simulated_runs as memory
from testbench import rig as rigs
from testbench.errors import AnalysisError
from testbench.runs.aligned_run import AlignedRun, recorded_clocks, trigger_notes
from testbench.runs.joined_channels import joined_table
from testbench.runs.si_run import SIRun
from testbench.synchronization.clock_map import ClockMap, same_clock
from testbench.synchronization.known_clocks import align_by

MECHANISM = load_mechanism("parallelogram-6bar")
LATE = 0.0123
"""By which the force logger was started [s]."""


@pytest.fixture(scope="module")
def scene():
    """The manipulator's move along x with the counter-masses that were built."""
    return memory.scene("x")


@pytest.fixture(scope="module")
def run(scene):
    """One recording of it, its force logger's clock known."""
    known = ClockMap(0.0, LATE, 0.0, np.zeros((2, 2)), 10, (0.0, 1.0))
    return AlignedRun(SIRun.of(scene.run(0)), MECHANISM, {"forces": known, "daq": same_clock((0.0, 0.0))})


def test_the_mechanism_is_as_it_was_mounted(run, scene):
    """Payload and counter-masses of the run's conditions are on; the one given comes without."""
    added = sum(memory.BUILT.values())
    without = MECHANISM.with_payload({"platform": scene.planned.payload})
    assert run.mechanism.total_mass == pytest.approx(without.total_mass + added)
    assert run.unloaded is MECHANISM


def test_the_trajectory_is_that_of_the_bench(run, scene):
    """Accelerations of the driven joints to two per cent of the largest, and computed once a bandwidth."""
    path = run.trajectory(80.0)
    assert run.trajectory(80.0) is path
    start = scene.starts(0)["controller"]
    time = start["start"] + run.grid.time / (1.0 + 1e-6 * start["drift_ppm"])
    true = scene.bench.trajectory
    inside = (time > true.time[0]) & (time < true.time[-1])
    for joint in range(path.a.shape[1]):
        expected = np.interp(time[inside], true.time, true.a[:, joint])
        assert np.std(path.a[inside, joint] - expected) < 0.02 * np.abs(true.a).max()


def test_values_of_another_logger_are_carried_over(run):
    """A ramp of the other clock is the same ramp on the grid, late by the map."""
    time = run.run.time("forces")
    moved = run.on_grid("forces", time, time[:, None])[:, 0]
    inside = (run.grid.time > time[0] + LATE + 0.1) & (run.grid.time < time[-1] + LATE - 0.1)
    np.testing.assert_allclose(moved[inside], run.grid.time[inside] - LATE, atol=1e-6)


def test_gaps_are_masked_by_clock(scene):
    """A gap of the forces' clock lies where the map puts it; encoders alone have none."""
    cut = memory.without(scene.run(0), "forces", 0.5, 0.6)
    known = ClockMap(0.0, LATE, 0.0, np.zeros((2, 2)), 10, (0.0, 1.0))
    run = AlignedRun(SIRun.of(cut), MECHANISM, {"forces": known})
    assert run.valid_samples(80.0).kept.all()
    assert not run.gaps()
    lost = run.grid.time[run.valid_samples(80.0, {"forces"}).kept == 0.0]
    assert lost[0] == pytest.approx(0.5 + LATE - 2.0 / 80.0, abs=2.0 * run.grid.step)
    assert lost[-1] == pytest.approx(0.6 + LATE + 2.0 / 80.0, abs=2.0 * run.grid.step)


def test_a_rig_without_encoders_is_named(scene):
    """Nothing says how the mechanism moved."""
    left = {n: s for n, s in scene.rig.sensors.items() if s.kind != "encoder"}
    run = AlignedRun(SIRun.of(scene.run(0), scene.rig.model_copy(update={"sensors": left})), MECHANISM)
    with pytest.raises(AnalysisError, match="no encoder"):
        run.trajectory(80.0)


def test_what_the_campaign_does_not_hold_is_no_clock(scene):
    """A run in memory has no records."""
    assert recorded_clocks(SIRun.of(scene.run(0))) == {}


@cache
def triggered() -> memory.Scene:
    """Encoders and the base's accelerometers on two loggers, which record one line, and have nothing else in common."""
    text = datasets.find_dataset("parallelogram-6bar", "rigs", ".toml").read_text("utf-8")
    for logger in ("controller", "daq"):
        text += f'\n[sensors.trigger_{logger}]\nkind = "trigger"\nlogger = "{logger}"\nchannel = "{logger}_sync"\n'
    rig = rigs.rig_from_text(text)
    kept = {name: s for name, s in rig.sensors.items() if s.kind != "accelerometer" or s.attached_to == "base"}
    return memory.scene("x", rig=rig.model_copy(update={"sensors": kept}))


def test_a_trigger_that_the_rig_names_is_used_unasked():
    """For a clock that is asked for, and for a table of both loggers, which both say so; within its interval."""
    run, starts = triggered().run(3), triggered().starts(3)
    late = starts["daq"]["start"] - starts["controller"]["start"]
    aligned = AlignedRun(SIRun.of(run), MECHANISM)
    assert aligned.related_clock("daq") is aligned.clock("daq")
    assert abs(aligned.clock("daq").offset - late) < aligned.clock("daq").half_width(0.0) < 3e-3
    found = align_by("correlation", aligned.run, lambda: MECHANISM)
    assert found.aligned["daq"].clock.offset == pytest.approx(aligned.clock("daq").offset, abs=1e-12)
    (said,) = trigger_notes([aligned])
    assert re.match(
        r"Clocks of daq by the trigger that the rig names \(1 edge, daq_sync with controller_sync; drift unknown", said
    )
    table, doubts = joined_table(run, "1 kHz", ["daq_sync", "controller_sync"])
    how, within = table.attrs["clocks"].split("; 95 %: daq within ")
    assert (how.partition(";")[0], doubts) == (
        "the trigger that the rig names (1 edge, daq_sync with controller_sync",
        "",
    )
    assert float(within.removesuffix(" ms")) == pytest.approx(1e3 * aligned.clock("daq").half_width(0.0), rel=0.05)
    rises = [np.flatnonzero(np.diff(table[name]) > 0.0)[0] for name in table]
    assert abs(rises[0] - rises[1]) <= 1


@pytest.mark.parametrize(
    ("quiet", "channel", "why"),
    [
        (0.0, "daq_sync", "daq_sync with controller_sync: a channel that never changes"),
        (1.0, "unplugged", "the rig has no sensor of kind 'trigger' in daq"),
    ],
)
def test_why_a_trigger_relates_nothing(quiet, channel, why):
    """Is said with the channels, beside why nothing else that both recorded does, and of a table of both."""
    run = triggered().run(3)
    run = memory.with_values(run, "daq_sync", quiet * run.channel("daq_sync"))
    rig = rigs.rig_from_text(triggered().rig.text.replace("daq_sync", channel))
    run = replace(run, rig=rig.text)
    aligned = AlignedRun(SIRun.of(run), MECHANISM)
    with pytest.raises(AnalysisError, match=f"daq is not aligned: .*; nor by the trigger that the rig names: {why}"):
        aligned.clock("daq")
    assert aligned.related_clock("daq") is None
    assert why in align_by("correlation", aligned.run, lambda: MECHANISM).refused["daq"]
    assert trigger_notes([aligned]) == []
    assert why in joined_table(run, "1 kHz")[1]
