"""From stored runs to positions and torques in SI: which channel is which joint, or a refusal that says what lacks."""

from pathlib import Path

import numpy as np
import pytest

from balance import datasets
from balance.mechanism.mjcf_parser import load_mechanism
from testbench import rig as rigs
from testbench.errors import AnalysisError
from testbench.identification import joint_record
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import PlannedRun
from testbench.runs.aligned_run import AlignedRun
from testbench.runs.si_run import SIRun
from testbench.store import Run, open_run

ARM = load_mechanism("two-joint-arm-a0")
TIME = np.arange(0.0, 2.0, 0.01)
RIG = datasets.find_dataset("two-joint-arm-a0", "rigs", ".toml").read_text("utf-8")


def stored(folder: Path, rig: str | None, rows: list[str] | None = None) -> Run:
    """A run of a short log with the columns of the real ones, positions in degrees where the rig says so."""
    lines = rows or [f"{t:.3f},{t:.6f},{2 * t:.6f},{3 * t:.6f},{4 * t:.6f}" for t in TIME]
    log = folder / "arm.csv"
    log.write_text("\n".join(["time,pos1,pos2,tau1,tau2", *lines, ""]), encoding="utf-8")
    described = None if rig is None else rigs.load_rig(rig)
    outcome = Ingest(folder, described).run(PlannedRun("arm", (log,)))[0]
    assert outcome.status == "stored", outcome.message
    return open_run(folder / "arm.h5")


def bound(run: Run, rig: rigs.Rig | None = None) -> AlignedRun:
    """The run with the arm."""
    return AlignedRun(SIRun.of(run, rig), ARM)


def test_channels_by_joint_in_si(tmp_path):
    """Positions in degrees and torques in N mm come out in rad and N m, in the order of the driven joints."""
    rig = RIG.replace('unit = "rad"', 'unit = "deg"').replace('unit = "N m"', 'unit = "N mm"')
    record = joint_record(bound(stored(tmp_path, rig)))
    assert record.grid.rate == pytest.approx(100.0)
    np.testing.assert_allclose(record.q, np.radians(np.outer(record.grid.time, [1.0, 2.0])), atol=1e-9)
    np.testing.assert_allclose(record.torque, 1e-3 * np.outer(record.grid.time, [3.0, 4.0]), atol=1e-9)
    assert record.origin == "unstated"


def test_a_run_without_a_rig(tmp_path):
    """A run stored without a rig is refused, saying how to give one; one given by hand does."""
    run = stored(tmp_path, None)
    with pytest.raises(AnalysisError, match="ingest its logs into another folder with --rig"):
        joint_record(bound(run))
    assert joint_record(bound(run, rigs.load_rig("two-joint-arm-a0"))).q.shape == (200, 2)


def test_a_rig_without_a_joint(tmp_path):
    """A rig that has no torque on a driven joint is refused, naming the joint and those it has."""
    rig = RIG[: RIG.index("[sensors.motor_J2]")]
    with pytest.raises(AnalysisError, match=r"0 sensors of kind 'torque' on joint 'J2'.*has them on: J1"):
        joint_record(bound(stored(tmp_path, rig)))


def test_a_gap_in_time(tmp_path):
    """A log that pauses is known on either side: what lies between is in no stretch, and said with its place."""
    rows = [f"{t + (t > 1.0) * 0.5:.3f},{t:.6f},{t:.6f},{t:.6f},{t:.6f}" for t in TIME]
    record = joint_record(bound(stored(tmp_path, RIG, rows)))
    sound = record.valid(0.1)[:, 0] > 0.0
    time = record.grid.time
    assert not sound[(time > 0.9) & (time < 1.6)].any()
    assert sound[time < 0.87].all()
    assert sound[time > 1.64].all()
    assert "0.51 s in all, the first after 1 s: left out, with 0.12 s about each" in record.left_out(0.1)[0]
