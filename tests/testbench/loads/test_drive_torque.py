"""Torques of the drives against the model on the same motion."""

import numpy as np
import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from studies import simulated_runs as memory
from testbench.errors import AnalysisError
from testbench.loads.drive_torque import drive_torques
from testbench.runs.aligned_run import AlignedRun
from testbench.runs.si_run import SIRun

MECHANISM = load_mechanism("parallelogram-6bar")


@pytest.mark.parametrize("masses", [{}, memory.BUILT])
def test_bench(masses):
    """Torques of a bench that is simulated by the same mechanics are the model's, with and without counter-masses."""
    scene = memory.scene("x", masses=masses)
    found = drive_torques(AlignedRun(SIRun.of(scene.run(0), scene.rig), MECHANISM))
    assert [one.joint for one in found] == ["A0", "B0"]
    for one in found:
        told = one.as_dict()
        assert told["scale"] == pytest.approx(1.0, abs=0.01)
        assert told["rms_ratio"] == pytest.approx(1.0, abs=0.01)
        assert one.residual_share < 0.05
        assert abs(told["delay_s"]) < 5e-4


def test_a_sensor_that_is_off_shows():
    """A torque sensor that reads 1.3 times as much, late by 4 ms, is found so."""
    scene = memory.scene("x", masses={})
    run = scene.run(0)
    tau = run.channel("tau1")
    late = 1.3 * np.concatenate([np.full(4, tau[0]), tau[:-4]])
    off = AlignedRun(SIRun.of(memory.with_values(run, "tau1", late)), MECHANISM)
    (found,) = [one.as_dict() for one in drive_torques(off) if one.joint == "A0"]
    assert found["rms_ratio"] == pytest.approx(1.3, rel=0.02)
    assert found["delay_s"] == pytest.approx(0.004, abs=5e-4)
    assert found["residual_share"] > 0.1


def test_without_torque_sensors_there_is_nothing_to_compare():
    """The rig is named."""
    scene = memory.scene("x")
    left = {n: s for n, s in scene.rig.sensors.items() if s.kind != "torque"}
    with pytest.raises(AnalysisError, match="kind torque"):
        drive_torques(AlignedRun(SIRun.of(scene.run(0), scene.rig.model_copy(update={"sensors": left})), MECHANISM))
