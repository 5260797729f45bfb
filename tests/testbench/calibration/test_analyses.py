"""What is computed from runs follows a corrected calibration, and nothing else does."""

import json
import shutil

import numpy as np
import pytest

from balance import datasets
from balance.mechanism.mjcf_parser import load_mechanism
from balance.units import G0
from studies import simulated_runs as memory
from testbench import rig as rigs
from testbench.calibration.definition import Calibration
from testbench.cli.analyze import analyze
from testbench.identification.records import joint_record
from testbench.kinematics import base_motion
from testbench.kinematics.encoder_motion import encoder_trajectory
from testbench.loads.shaking_wrench import shaking_wrench
from testbench.runs.aligned_run import AlignedRun
from testbench.runs.recalibrate import calibrate
from testbench.runs.si_run import SIRun
from testbench.store import open_campaign
from testbench.vibration.metrics import base_accelerations


@pytest.fixture
def campaign(brief, tmp_path):
    """The first pair of the brief campaign, to be corrected."""
    folder = tmp_path / "campaign"
    folder.mkdir()
    for name in ("r001.h5", "r002.h5"):
        for file in (name, f"{name}.sha256"):
            shutil.copy(brief.campaign / file, folder)
    return folder


def reductions(campaign, capsys):
    """What ``testbench analyze`` prints."""
    analyze.main([str(campaign), "--json"], standalone_mode=False)
    return json.loads(capsys.readouterr().out)


def test_reductions(campaign, capsys):
    """The run with counter-masses reads 3 % too high: corrected, its vibration is less, and the reduction more."""
    before = reductions(campaign, capsys)
    assert before["calibrations"] == []
    (run,) = [run for run in open_campaign(campaign).runs if run.conditions.get("counter_masses")]
    raw = base_accelerations(SIRun.of(run))
    calibrate([run], "base_acc", Calibration(sensitivity="1.03 g/g"), "amplifier was set 3 % too high")
    for place, (values, _) in base_accelerations(SIRun.of(run)).items():
        np.testing.assert_allclose(values, raw[place][0] / 1.03, rtol=1e-12)
    after = reductions(campaign, capsys)
    (held,) = after["calibrations"]
    assert (held["sensor"], held["calibration"], held["runs"]) == ("base_acc", "1.03 g/g", [run.name])
    for old, new in zip(before["reductions"], after["reductions"], strict=True):
        left = [1.0 - found["reduction_percent"] / 100.0 for found in (old, new)]
        assert left[1] == pytest.approx(left[0] / 1.03, rel=0.02)


def test_forces_torques_angles_and_base(campaign):
    """Supports, motors, encoders and the base's accelerometer: each follows the record about it, the others stay."""
    run, other = open_campaign(campaign).runs[-1], open_campaign(campaign).runs[0]
    mechanism = load_mechanism("parallelogram-6bar")
    forces, torques = shaking_wrench(SIRun.of(run), preload=True), joint_record(AlignedRun(SIRun.of(run), mechanism))
    path = encoder_trajectory(SIRun.of(run), mechanism, 40.0)[1]
    twice = {"futek_1": "0.5 N/N", "futek_2": "0.5 N/N", "motor_A0": "0.5 (N m)/(N m)", "base_acc": "0.5 g/g"}
    for sensor, text in twice.items():
        calibrate([run], sensor, Calibration(sensitivity=text), "test of a scale")
    calibrate([run], "encoder_A0", Calibration(offset="1 deg"), "zero was read again")
    single = run.channel("Fz3") + run.channel("Fz4")
    found = shaking_wrench(SIRun.of(run), preload=True)
    np.testing.assert_allclose(found.values["Fz"] - forces.values["Fz"], single, atol=1e-9)
    np.testing.assert_array_equal(found.values["Fx"], forces.values["Fx"])
    now = joint_record(AlignedRun(SIRun.of(run), mechanism))
    np.testing.assert_allclose(now.torque, torques.torque * [2.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(now.q - torques.q, np.broadcast_to([-np.pi / 180.0, 0.0], now.q.shape), atol=1e-12)
    raw = np.column_stack([run.channel(name) for name in ("AccX", "AccY", "AccZ")])
    felt = base_motion.base_acceleration(SIRun.of(run)).values
    np.testing.assert_allclose(np.diff(felt, axis=0), 2.0 * G0 * np.diff(raw, axis=0), atol=1e-12)
    calibrate([run], "base_acc", Calibration(sensitivity="0.5 g/g", offset="0.3 g"), "zeroed while tilted")
    np.testing.assert_allclose(base_motion.base_acceleration(SIRun.of(run)).values, felt, atol=1e-12)  # not the motion
    moved = encoder_trajectory(SIRun.of(run), mechanism, 40.0)[1].q - path.q
    assert np.abs(moved).max() == pytest.approx(np.pi / 180.0, rel=0.2)
    assert not any(h.sensor == "futek_1" for h in _held(other))


def test_a_simulated_bench_that_writes_volts():
    """The simulated loggers write what a calibrated sensor gives; on reading, the accelerations are the same again."""
    plain = datasets.find_dataset("parallelogram-6bar", "rigs", ".toml").read_text("utf-8")
    table = '[sensors.base_acc.calibration]\nsensitivity = "100 mV/g"\noffset = "2.5 V"\n[sensors.base_acc]'
    volts = plain.replace('unit = "g"', 'unit = "mV"', 1).replace("[sensors.base_acc]", table, 1)
    runs = [memory.scene("x", rig=rigs.load_rig(text)).run(0) for text in (plain, volts)]
    assert runs[1].channel("AccX").mean() == pytest.approx(2500.0, abs=5.0)
    first, second = (base_accelerations(SIRun.of(run)) for run in runs)
    for place, (values, _) in first.items():
        np.testing.assert_allclose(second[place][0], values, atol=1.1 * 0.5e-5 * G0)


def _held(run):
    return SIRun.of(run).calibrations
