"""Motions found in a record: x, y and triangle by each source; what is none of them is unknown."""

from dataclasses import replace

import numpy as np
import pytest

from balance import datasets
from balance.mechanism.mjcf_parser import load_mechanism
from studies import simulated_runs as memory
from testbench import rig as rigs
from testbench.kinematics.motion_recognition import Leg, legs_of_acceleration, name_motions, recognized_motions
from testbench.runs.aligned_run import AlignedRun
from testbench.runs.si_run import SIRun

MECHANISM = load_mechanism("parallelogram-6bar")


def found_in(run, rig):
    """The motions of a run by each source, and why a source tells nothing."""
    si = SIRun.of(run, rig)
    return recognized_motions(si, lambda: AlignedRun(si, MECHANISM))


@pytest.mark.parametrize(("motion", "legs", "extent"), [("x", 3, 0.04), ("y", 3, 0.04), ("triangle", 5, 0.0320)])
def test_each_source_names_the_motion_of_the_bench(motion, legs, extent):
    """Command and encoders: name, start and end within 10 ms, size within 1 %; what is felt, size within 5 %."""
    scene = memory.scene(motion)
    run = scene.run(0)
    by, reasons = found_in(run, scene.rig)
    moved = scene.bench.command.time[np.abs(scene.bench.command.acceleration).max(axis=1) > 0]
    assert not reasons
    for source, group, size, near in (
        ("command", "controller", 0.01, 0.01),
        ("encoders", "controller", 0.01, 0.01),
        ("acceleration", "daq", 0.05, 0.02),
    ):
        (one,) = by[source]
        start = scene.starts(0)[group]["start"]
        assert (one.name, one.legs, one.group) == (motion, legs, group)
        assert one.extent == pytest.approx(extent, rel=size)
        assert one.start == pytest.approx(moved[0] - start, abs=near)
        assert one.end == pytest.approx(moved[-1] - start, abs=near)


def leg(start, *chord, bend=0.0):
    """A leg of half a second."""
    return Leg(start, start + 0.5, np.array([*chord, 0.0]), bend)


def test_repeats_are_counted():
    """There and back is one motion; twice of x and once of y are three."""
    legs = [leg(0, 0.1, 0), leg(1, -0.1, 0), leg(2, 0.1, 0), leg(3, -0.1, 0), leg(4, 0, 0.1), leg(5, 0, -0.1)]
    assert [(m.name, m.repeat, m.start) for m in name_motions(legs, "command", "c")] == [
        ("x", 1, 0),
        ("x", 2, 2),
        ("y", 1, 4),
    ]


@pytest.mark.parametrize(
    ("legs", "reason"),
    [
        ([leg(0, 0.1, 0)], "ends 100.0 mm from"),
        ([leg(0, 0.1, 0.1), leg(1, -0.1, -0.1)], "neither along one axis"),
        ([leg(0, 0.1, 0, bend=0.3), leg(1, -0.1, 0)], "not straight"),
        ([leg(0, 0.1, 0), leg(1, 0, 0.1), leg(2, -0.1, 0), leg(3, 0, -0.1)], "nor round a triangle"),
    ],
)
def test_unknown_is_not_guessed(legs, reason):
    """A way that does not close, is oblique, bent, or a square has no name, and says why."""
    (one,) = name_motions(legs, "encoders", "c")
    assert one.name == "unknown"
    assert reason in one.reason


def test_a_triangle_that_starts_at_its_corner():
    """Three sides suffice."""
    (one,) = name_motions([leg(0, 0.05, 0), leg(1, -0.025, 0.04), leg(2, -0.025, -0.04)], "command", "c")
    assert one.name == "triangle"


def test_nothing_moves():
    """A record at rest holds no motion."""
    time = np.arange(1000) / 1000.0
    assert name_motions(legs_of_acceleration(time, np.zeros((1000, 3)), 0.01), "command", "c") == []


def test_slow_encoders_tell_the_motion():
    """At 200 samples a second the band is narrower, and the motion is still named."""
    text = datasets.find_dataset("parallelogram-6bar", "rigs", ".toml").read_text("utf-8")
    scene = memory.scene("x", rig=rigs.rig_from_text(text.replace('rate = "1 kHz"', 'rate = "200 Hz"')))
    by, _ = found_in(scene.run(0), scene.rig)
    assert [m.name for m in by["encoders"]] == ["x"]


@pytest.mark.parametrize("payload", ["platform", "C_platform"])
def test_a_payload_that_the_run_table_states_is_followed(payload):
    """Where the file names no body of the payload, the body or site that the run table names; else it is asked for."""
    scene = memory.scene("x")
    left = {n: s for n, s in scene.rig.sensors.items() if s.kind == "encoder"}
    rig = scene.rig.model_copy(update={"sensors": left})
    unnamed = replace(MECHANISM, payload_bodies=())
    run = scene.run(0)
    for payloads, source in (({payload: 1.0}, "by"), ({}, "reasons")):
        stated = replace(run, conditions={"motion": "x", "payloads": payloads})
        si = SIRun.of(stated, rig)
        by, reasons = recognized_motions(si, lambda si=si: AlignedRun(si, unnamed))
        assert ("encoders" in by) is (source == "by"), reasons
    assert "state the payload by body or site" in reasons["encoders"]


def test_what_a_source_lacks_is_said():
    """Without encoders and target, what is felt is left, and each other source says why."""
    scene = memory.scene("x")
    left = {n: s for n, s in scene.rig.sensors.items() if s.kind not in {"encoder", "target"}}
    by, reasons = found_in(scene.run(0), scene.rig.model_copy(update={"sensors": left}))
    assert [m.name for m in by["acceleration"]] == ["x"]
    assert "no target" in reasons["command"]
    assert "no encoder" in reasons["encoders"]
