"""Loggers of a bench aligned by what its rig says that they saw."""

import re
from dataclasses import replace

import numpy as np
import pytest

from balance import datasets
from balance.closure import Trajectory
from balance.mechanism.mjcf_parser import load_mechanism
from balance.results import document
from studies import simulated_runs as memory
from studies.clocks import CASES, REFERENCE, aligned, tally
from studies.clocks import truth as true_instant
from testbench import rig as rigs
from testbench.errors import AnalysisError
from testbench.kinematics.encoder_motion import loaded_mechanism, mechanism_of
from testbench.runs.aligned_run import AlignedRun
from testbench.runs.si_run import SIRun
from testbench.synchronization import known_clocks, run_alignment
from testbench.synchronization.clock_map import ClockMap, same_clock
from testbench.synchronization.common_signals import trigger_groups, trigger_pairs, weight_caution
from testbench.synchronization.event_alignment import by_trigger
from testbench.synchronization.offset_and_drift import by_correlation
from testbench.synchronization.run_alignment import align_named, align_run

from ..coverage import assert_holds
from . import loggers


@pytest.fixture(scope="module")
def moved():
    """The x move with the counter-masses that were built: forces and accelerations that the base's motion changes."""
    return memory.scene("x")


def aligned_by(run, rig, **options):
    """The clocks of a run, by the rig and the mechanism that it names."""
    si = SIRun.of(run, rig)
    return align_run(si, lambda: loaded_mechanism(si, mechanism_of(si, None)), **options)


def truth(scene, seed, group, own):
    """An own instant's true time on the controller's clock [s]."""
    starts = scene.starts(seed)
    pace, reference = (1.0 + 1e-6 * starts[name]["drift_ppm"] for name in (group, "controller"))
    return (starts[group]["start"] + own / pace - starts["controller"]["start"]) * reference


@pytest.mark.parametrize("seed", range(3))
def test_bench(moved, seed):
    """Platform accelerometer and force sensors are aligned with the encoders to 0.1 ms, though the base moves."""
    run = moved.run(seed)
    found = aligned_by(run, moved.rig, drift=False)
    assert found.reference == "controller"
    assert not found.refused
    for group in ("daq", "forces"):
        clock = found.map_of(group)
        late = float(clock.to_reference(np.array([clock.at_own]))[0]) - truth(moved, seed, group, clock.at_own)
        assert abs(late) < 1e-4
        assert abs(late) < 2.0 * clock.half_width(clock.at_own)


@pytest.fixture(scope="module")
def filtered():
    """The same on a bench whose loggers filter: delays of 0.52 ms in the forces, 0.21 ms in the accelerations."""
    text = datasets.find_dataset("parallelogram-6bar", "rigs", ".toml").read_text("utf-8")
    for logger, corner in (("daq", "2 kHz"), ("forces", "800 Hz")):
        text = text.replace(f"[loggers.{logger}]", f'[loggers.{logger}]\nlow_pass = "{corner}"')
    return memory.scene("x", rig=rigs.rig_from_text(text))


@pytest.mark.parametrize("seed", range(2))
def test_delays_of_stated_filters_are_taken_off(filtered, seed):
    """Offsets are those of the clocks, within 0.1 ms and the interval, though the filters delay by more."""
    run = filtered.run(seed)
    found = aligned_by(run, filtered.rig, drift=False)
    delays = {"daq": 0.000208, "forces": 0.000520}
    for group, delay in delays.items():
        clock = found.map_of(group)
        late = float(clock.to_reference(np.array([clock.at_own]))[0]) - truth(filtered, seed, group, clock.at_own)
        assert abs(late) < min(1e-4, 2.0 * clock.half_width(clock.at_own))
        assert found.delays[group] == pytest.approx(delay, abs=1e-6)
    assert found.delays["controller"] is None


def test_a_filter_that_the_rig_does_not_state_stays_in_the_offset(filtered, moved):
    """Read by a rig that does not state it, the forces seem later by their filter's delay, and no delay is claimed."""
    run = filtered.run(0)
    stated, unstated = (aligned_by(run, rig, drift=False) for rig in (filtered.rig, moved.rig))
    late = unstated.map_of("forces").offset - stated.map_of("forces").offset
    assert late == pytest.approx(-0.00052, abs=5e-5)
    assert unstated.delays["forces"] is None


def test_without_the_base_accelerometer_the_interval_says_so(moved):
    """Without the base's acceleration the answer is off by its effect, and the interval is as wide."""
    run = moved.run(0)
    rig = moved.rig.model_copy(update={"sensors": {k: v for k, v in moved.rig.sensors.items() if k != "base_acc"}})
    clock = aligned_by(run, rig, drift=False).map_of("daq")
    late = float(clock.to_reference(np.array([clock.at_own]))[0]) - truth(moved, 0, "daq", clock.at_own)
    assert 3e-5 < abs(late) < clock.half_width(clock.at_own)


def test_named_channels(moved):
    """Two channels that a person names are aligned as they are; two of one logger share a clock."""
    run = moved.run(0)
    found = align_named(run, "TargetX", "PlatX", False, 60.0, by_correlation)
    clock = found.map_of("daq")
    assert abs(float(clock.to_reference(np.array([0.5]))[0]) - truth(moved, 0, "daq", 0.5)) < 2e-3
    with pytest.raises(AnalysisError, match="share a clock"):
        align_named(run, "theta1", "theta2", False, None, by_correlation)


def test_what_the_rig_does_not_pair_is_refused(moved):
    """An accelerometer on the base alone says nothing of the encoders' clock; the message says what to do."""
    run = moved.run(0)
    rig = moved.rig.model_copy(update={"sensors": {k: v for k, v in moved.rig.sensors.items() if k != "platform_acc"}})
    found = aligned_by(run, rig)
    assert "--pair" in found.refused["daq"]
    assert "base accelerometers with nothing else" in found.refused["daq"]


@pytest.mark.parametrize(
    ("gravity", "said"), [(9.81, "; link_1 turns in gravity: .* by a trigger or a tap$"), (0.0, "$")]
)
def test_weight_is_named_where_the_body_turns_in_it(gravity, said):
    """Behind the reason why the signals determine nothing."""
    arm = replace(load_mechanism("serial-1r"), gravity=np.array([0.0, -gravity, 0.0]))
    q = np.linspace(0.0, 1.0, 5)[:, None]
    path = Trajectory(arm.name, q[:, 0], q, 0 * q, 0 * q, q[:, :, None] ** 0, 0.0, 1.0, "")
    caution = weight_caution(arm, path, "link_1", arm.anchor("link_1", np.zeros(3)))
    white = np.random.default_rng(0).normal(size=(2, 2000))
    shared = replace(loggers.plain(*white), caution=caution)
    found = run_alignment._first_determined([lambda first: shared], False, by_correlation)
    assert re.search("no common content: .* recorded the same .* or a trigger" + said, found)


def test_maps_are_stored_and_restored():
    """A map read back from its dictionary is the same map; its interval is narrowest where the data are."""
    clock = ClockMap(3.0, 2.5, 4e-6, np.array([[1e-10, 1e-12], [1e-12, 4e-12]]), 18, (1.0, 5.0))
    again = ClockMap.from_dict(document(clock))
    assert again.offset == pytest.approx(clock.offset, abs=1e-15)
    assert again.offset_interval == pytest.approx(clock.offset_interval, abs=1e-15)
    assert clock.half_width(3.0) < clock.half_width(100.0)


@pytest.mark.parametrize("case", ["soft-x", "deep-x-without"])
def test_intervals_hold_on_other_benches(case):
    """What the model lacks of a softer bench, or of one with modes and inexact sensors, is in the intervals.

    ``studies.clocks`` is the study of which this is the brief version.
    """
    found = tally(CASES[case], range(2)).values()
    assert_holds(sum(t.hits for t in found), sum(t.count for t in found))


def test_a_gap_is_left_out():
    """Encoders that lost 12 ms of the motion align what is left, to 0.1 ms and within the interval, with a finding."""
    case = CASES["deep-y-without"]
    made = case.recorded(1)
    assert np.diff(made.logs[REFERENCE].time).max() > 0.01
    found = aligned(case, made)
    assert not found.refused
    assert len(found.findings) == 2
    assert "1 gap in the reference's record, 0.01312 s in all" in found.findings[0]
    for group in ("daq", "forces"):
        clock = found.map_of(group)
        late = clock.at_reference - true_instant(made, group, clock.at_own)
        assert abs(late) < min(1e-4, 2.0 * clock.half_width(clock.at_own))


@pytest.mark.parametrize("seed", [0, 2])
def test_gaps_do_not_hide_the_lag(moved, seed):
    """A tenth of half a second's motion is lost: what is left still aligns, for a gap counts for neither side."""
    run = memory.without(moved.run(seed), "controller", 0.45, 0.55)
    found = aligned_by(run, moved.rig, drift=False)
    assert not found.refused
    for group in ("daq", "forces"):
        clock = found.map_of(group)
        late = float(clock.to_reference(np.array([clock.at_own]))[0]) - truth(moved, seed, group, clock.at_own)
        assert abs(late) < 2.0 * clock.half_width(clock.at_own)


def test_a_trigger_that_the_rig_names():
    """Every logger with a sensor of kind trigger is aligned by its edges, no motion or mechanism needed.

    Edges are known to a sample of the slower logger; the rise of the line is one step of the simulation.
    """
    text = datasets.find_dataset("parallelogram-6bar", "rigs", ".toml").read_text("utf-8")
    for logger in ("controller", "daq", "forces"):
        text += f'\n[sensors.trigger_{logger}]\nkind = "trigger"\nlogger = "{logger}"\nchannel = "{logger}_sync"\n'
    scene = memory.scene("x", rig=rigs.rig_from_text(text))
    run = scene.run(0)
    found = aligned_by(run, scene.rig, drift=False, method=by_trigger, pairs=trigger_pairs)
    assert not found.refused
    for group in ("daq", "forces"):
        clock = found.map_of(group)
        late = float(clock.to_reference(np.array([clock.at_own]))[0]) - truth(scene, 0, group, clock.at_own)
        assert abs(late) < 1.5e-3
    assert trigger_groups([SIRun.of(run, scene.rig)]) == ["controller", "daq", "forces"]
    bare = rigs.rig_from_text(text.replace('channel = "daq_sync"', 'channel = "unplugged"'))
    refused = aligned_by(run, bare, drift=False, method=by_trigger, pairs=trigger_pairs).refused
    assert "no sensor of kind 'trigger' in daq: add one" in refused["daq"]


@pytest.mark.parametrize(
    ("triggers", "recorded", "deviation", "lines"),
    [
        ("controller daq", "forces", 1e-4, None),
        ("daq forces", "", 0.0, None),
        ("controller daq forces", "forces daq", 0.02, None),
        ("controller daq", "forces daq", 1e-4, None),
        ("controller daq forces", "", 0.0, "start gate"),
        ("controller daq forces", "", 0.0, "trigger trigger"),
    ],
    ids=["chain", "without encoders", "rough record", "record", "lines", "lines unnamed"],
)
def test_clocks_by_record_and_trigger(triggers, recorded, deviation, lines, monkeypatch):
    """The surest way from one clock to another, through a third one too, the same for each who asks; of two lines that
    a logger recorded, that which the other did.

    A line's edges are known to a sample of the slower logger.
    """
    text = datasets.find_dataset("parallelogram-6bar", "rigs", ".toml").read_text("utf-8")
    sensor = '\n[sensors.{0}]\nkind = "trigger"\nlogger = "{1}"\nchannel = "{0}"\nline = "{2}"\n'
    start, gate = (lines or "start gate").split()
    if lines:
        text += sensor.format("forces_start", "forces", start)
    for logger in triggers.split():
        text += sensor.format(f"{logger}_sync", logger, gate)
    scene = memory.scene("x", rig=rigs.rig_from_text(text))
    run, seed = scene.run(0), 0
    if lines:
        run = memory.with_values(run, "forces_start", np.roll(run.channel("forces_start"), -150))
    maps = {"controller": same_clock((0.0, 0.0))} if recorded else {}
    for group in recorded.split():
        late = truth(scene, seed, group, 0.0) + 1.5 * deviation
        maps[group] = ClockMap(0.0, late, 0.0, np.diag([deviation**2, 1e-12]), 1000, (0.0, 1.0))
    monkeypatch.setattr(known_clocks, "stored_clock_maps", lambda path: dict(maps))
    bound, at = SIRun.of(run, scene.rig), np.array([0.3])
    found, why = known_clocks.on_clock_of(bound, at, "forces", "daq")
    if lines == "trigger trigger":
        assert (found, "are triggers of one line, 'trigger'" in why) == (None, True)
        return
    (own,), half = found
    there, here = truth(scene, seed, "forces", at[0]), truth(scene, seed, "daq", own)
    assert abs(there - here) < 1.5 * half < 5e-3
    known = known_clocks.related_clocks(bound, "daq").maps["forces"]
    assert float(known.to_reference(at)[0]) == pytest.approx(own, abs=1e-12)
    if "controller" in triggers:
        aligned = AlignedRun(bound, load_mechanism("parallelogram-6bar"), maps)
        for group in ("forces", "daq"):
            late = float(aligned.related_clock(group).to_reference(at)[0]) - truth(scene, seed, group, at[0])
            assert abs(late) < 3e-3
