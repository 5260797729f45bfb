"""A run's report against what the simulated bench knows of it."""

import json

import numpy as np
import pytest

from balance import datasets
from balance.mechanism.mjcf_parser import load_mechanism
from studies import simulated_runs as memory
from testbench import rig as rigs
from testbench.errors import AnalysisError
from testbench.kinematics.gaps import gap_reach
from testbench.report.sections import ENCODERS_HZ, motion_on_base_clock
from testbench.runs.aligned_run import AlignedRun
from testbench.runs.si_run import SIRun
from testbench.simulator.sensors import base_acceleration
from testbench.store import open_campaign

from ..conftest import reported

TEXT = datasets.find_dataset("parallelogram-6bar", "rigs", ".toml").read_text("utf-8")
PARTS = ("motions", "command", "vibration", "modes", "response", "wrench", "torque")


@pytest.fixture(scope="module")
def plain():
    """A run along y without counter-masses."""
    return memory.scene("y", masses={})


@pytest.fixture(scope="module")
def told(plain):
    """Its report."""
    return reported(plain.run(0), (0.1, 0.0, 0.0)).as_dict()


def test_every_part_is_told_and_defined(told):
    """JSON without a number that is none; a definition in every part that has numbers."""
    json.dumps(told, allow_nan=False)
    for name in PARTS:
        part = told[name]
        assert "reason" in part or "definition" in part or "definitions" in part
    assert {m["motion"] for m in told["motions"]["found"]} == {"y"}
    assert not told["findings"]


def test_modes_are_those_of_the_bench(plain, told):
    """What is determined lies on an eigenvalue of the base; what is not is null, with a reason."""
    values = np.linalg.eigvals(plain.bench.base.state_space()[0])
    true = np.abs(values[values.imag > 0]) / (2 * np.pi)
    modes = told["modes"]["modes"]
    known = [m for m in modes if m["reason"] is None]
    assert len(known) >= 2
    for mode in known:
        assert np.abs(true - mode["frequency_hz"]).min() < 0.02 * mode["frequency_hz"]
    assert all(m["frequency_hz"] is None for m in modes if m["reason"])


def test_forces_are_those_of_the_bench(plain, told):
    """Peak to peak of what the mechanism exerts about the point, within 2 %."""
    about = plain.bench.transmitted_wrench.copy()
    about[:, 3:] -= np.cross((0.1, 0.0, 0.0), about[:, :3])
    for i, (name, unit) in {1: ("Fy", "N"), 5: ("Mz", "Nm")}.items():
        found = told["wrench"]["components"][name][f"peak_to_peak_{unit}"]
        assert found == pytest.approx(np.ptp(about[:, i]), rel=0.02)


def test_a_clipped_force_is_null_with_the_stretch(plain):
    """What rests on a sensor at the end of its range is null, says when, and is a finding."""
    run = plain.run(0)
    clipped = reported(memory.with_values(run, "Fy2", np.clip(50.0 * run.channel("Fy2"), -2000.0, 2000.0))).as_dict()
    wrench = clipped["wrench"]
    assert wrench["components"]["Fy"] is None
    assert "end of its range in" in wrench["reasons"]["Fy"]
    assert wrench["clipped_s"]["Fy"]
    assert wrench["components"]["Fx"] is not None
    assert [f["code"] for f in clipped["findings"]] == ["clipping"]


def test_a_sheet_that_names_another_motion_is_a_finding(plain):
    """Command, encoders and what is felt each say y; the sheet says x."""
    run = plain.run(0)
    run.conditions["motion"] = "x"
    (found,) = reported(run).findings
    assert found.code == "motion_contradiction"
    assert "the command, the acceleration and the encoders: motion y" in found.message


def test_torques_of_another_size_than_the_model_are_findings(plain):
    """A wrong unit, of torque or of angle, shows as a torque far from the model's; a sound run has no finding."""
    run = plain.run(0)
    assert reported(run).findings == ()
    for channel in ("tau1", "tau2"):
        run = memory.with_values(run, channel, 0.01 * run.channel(channel))
    found = reported(run).findings
    assert [f.code for f in found] == ["torque_contradiction"] * 2
    assert "0.01 times the model's" in found[0].message


def test_what_a_rig_lacks_is_said_part_by_part(brief):
    """Without force sensors, torques and target the other parts are told."""
    run = open_campaign(brief.campaign).runs[0]
    text = run.rig[: run.rig.index("[sensors.k6d40]")] + run.rig[run.rig.index("[sensors.encoder_A0]") :]
    text = text[: text.index("[sensors.motor_A0]")] + text[text.index("[bench]") :]
    object.__setattr__(run, "rig", text)
    told = reported(run).as_dict()
    assert "no force sensors" in told["wrench"]["reason"]
    assert "kind torque" in told["torque"]["reason"]
    assert "target" in told["command"]["reason"]
    assert "no target" in told["motions"]["reasons"]["command"]
    assert told["vibration"]["axes"]
    assert told["modes"]["modes"]


def test_response_is_that_of_the_base():
    """Acceleration per force along y, from the sensors of one logger, is that of what really happened."""
    from scipy.signal import csd, welch

    text = TEXT.replace('kind = "accelerometer"\nlogger = "daq"', 'kind = "accelerometer"\nlogger = "forces"', 1)
    scene = memory.scene("y", masses={}, rig=rigs.rig_from_text(text))
    rows = {r["frequency_hz"]: r for r in reported(scene.run(0)).parts["response"]["rows"] if r["axis"] == "y"}
    start, run = scene.starts(0)["forces"], scene.run(0)
    time = start["start"] + run.time("forces") / (1.0 + 1e-6 * start["drift_ppm"])
    felt = base_acceleration(scene.rig.sensors["base_acc"], scene.bench)["y"]
    force, felt = (np.interp(time, scene.bench.time, v) for v in (scene.bench.transmitted_wrench[:, 1], felt))
    frequency, cross = csd(force, felt, 2000.0, nperseg=500)
    true = np.abs(cross) / welch(force, 2000.0, nperseg=500)[1]
    shared = [f for f in rows if 8.0 <= f <= 28.0]
    assert len(shared) > 3
    for f in shared:
        assert rows[f]["gain_1_kg"] == pytest.approx(true[np.abs(frequency - f).argmin()], rel=0.05)
        assert rows[f]["gain_interval_1_kg"][0] < rows[f]["gain_1_kg"] < rows[f]["gain_interval_1_kg"][1]


def test_response_that_follows_the_moment_is_marked():
    """Along x the base is shaken by force and moment together: the lines say so, and that it is not the force alone."""
    text = TEXT.replace('kind = "accelerometer"\nlogger = "daq"', 'kind = "accelerometer"\nlogger = "forces"', 1)
    found = reported(memory.scene("x", masses={}, rig=rigs.rig_from_text(text)).run(0)).parts["response"]
    along = [r for r in found["rows"] if r["axis"] == "x" and r["frequency_hz"] < 30.0]
    assert sum("Mz" in r["also_follows"] for r in along) > 0.5 * len(along)
    assert found["of_the_force_alone"] is False
    assert "also_follows" in found["definition"]


def test_response_needs_clocks_in_line(told):
    """Forces and accelerations of two loggers that are not aligned: the reason, and what to do."""
    assert "testbench align" in told["response"]["reason"]


@pytest.mark.parametrize("channel", ["daq_sync", "unplugged"])
def test_the_free_decay_begins_by_the_encoders_of_another_logger(channel):
    """Where a trigger relates the clocks, as wide as it is sure; else it is said that nothing does, and why."""
    text = TEXT
    for logger in ("controller", "daq"):
        text += f'\n[sensors.trigger_{logger}]\nkind = "trigger"\nlogger = "{logger}"\nchannel = "{logger}_sync"\n'
    scene = memory.scene("x", rig=rigs.rig_from_text(text))
    run = SIRun.of(scene.run(3), rigs.rig_from_text(text.replace("daq_sync", channel)))
    aligned = AlignedRun(run, load_mechanism("parallelogram-6bar"))
    if channel == "unplugged":
        why = "no sensor of kind 'trigger' in daq: .*"
        with pytest.raises(AnalysisError, match=rf"encoders are on that of controller, which nothing .*{why}\)$"):
            motion_on_base_clock(run, {}, None, lambda: aligned)
        return
    start, end = motion_on_base_clock(run, {}, None, lambda: aligned)
    speed = np.abs(scene.bench.trajectory.v).max(axis=1)
    moves = scene.bench.trajectory.time[speed > 1e-3 * speed.max()][[0, -1]] - scene.starts(3)["daq"]["start"]
    sure = gap_reach(ENCODERS_HZ) + 0.01  # what smoothing smears, and the edge's interval twice
    assert moves[0] - sure < start < moves[0]
    assert moves[1] < end < moves[1] + sure
