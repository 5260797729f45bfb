"""Public recordings: volts of a force plate to newtons, offsets of an instrumented wheel. Skipped where absent.

The sensitivities are assumed: the recordings bring none. What is held against them is the plate's own formula.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from testbench import rig as rigs
from testbench.calibration.definition import Calibration
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import PlannedRun
from testbench.loads.shaking_wrench import shaking_wrench
from testbench.runs.recalibrate import calibrate
from testbench.runs.si_run import SIRun, physical
from testbench.store import open_campaign, open_run

A, B = 0.12, 0.20
"""Half the distances between the plate's four sensors along x and y [m]."""
VERTICAL, SIDEWAYS = 3.85, 7.8
"""Assumed charge of a force on the plate [pC/N]."""
AMPLIFIER = 500.0
"""Assumed [pC/V]."""
CORNERS = ((A, B), (-A, B), (-A, -B), (A, -B))
PARTS = {"x12": ("x", 0.0, B), "x34": ("x", 0.0, -B), "y14": ("y", A, 0.0), "y23": ("y", -A, 0.0)} | {
    f"z{i + 1}": ("z", *corner) for i, corner in enumerate(CORNERS)
}
PART = """
[sensors.{name}]
kind = "force"
logger = "plate"
channel = "Channel {number}"
axis = "{axis}"
unit = "V"
position = ["{x} m", "{y} m", "0 m"]
unloaded = "rest"
[sensors.{name}.calibration]
sensitivity = "{charge} pC/N"
amplifier = "{amplifier} pC/V"
"""
PLATE = 'mechanism = "none"\n[loggers.plate]\nrate = "100 Hz"\n' + "".join(
    PART.format(
        name=name, number=i, axis=axis, x=x, y=y, charge=VERTICAL if axis == "z" else SIDEWAYS, amplifier=AMPLIFIER
    )
    for i, (name, (axis, x, y)) in enumerate(PARTS.items())
)
WHEEL = """
mechanism = "none"
[loggers.wheel]
[sensors.wheel]
kind = "wrench"
logger = "wheel"
channels = { Fx = "col18", Fy = "col19", Fz = "col20", Mx = "col21", My = "col22", Mz = "col23" }
unit = { F = "N", M = "N m" }
position = ["0 m", "0 m", "0 m"]
"""


def ingested(name, folder, rig):
    """A recording by the beginning of its name, stored with a rig."""
    (path,) = Path(os.environ["COUNTERPOISE_RECORDINGS"]).glob(f"{name}*")
    (outcome,) = Ingest(folder / "campaign", rigs.load_rig(rig)).run(PlannedRun("r1", (path,)))
    assert outcome.status == "stored", outcome.message
    return open_run(folder / "campaign" / "r1.h5")


@pytest.mark.recordings
def test_volts_of_a_force_plate(tmp_path):
    """Eight channels in volts, whose unit the log does not write, give the plate's force and moment in N and N m."""
    run = ingested("12_", tmp_path, PLATE)
    volts = [run.channel(f"Channel {i}") for i in range(8)]
    assert volts[0][0] == -0.045707
    x12, x34, y14, y23, *z = (v * AMPLIFIER / (SIDEWAYS if i < 4 else VERTICAL) for i, v in enumerate(volts))
    printed = {
        "Fx": x12 + x34,
        "Fy": y14 + y23,
        "Fz": sum(z),
        "Mx": B * (z[0] + z[1] - z[2] - z[3]),
        "My": A * (-z[0] + z[1] + z[2] - z[3]),
        "Mz": B * (-x12 + x34) + A * (y14 - y23),
    }
    wrench = shaking_wrench(SIRun.of(run), preload=True)
    for name, expected in printed.items():
        np.testing.assert_allclose(wrench.values[name], expected, rtol=1e-9, atol=1e-9)
    assert physical(run).group().channels[5].unit == "N"


@pytest.mark.recordings
def test_another_range_of_the_amplifier(tmp_path):
    """Found out later that the amplifier stood at another range: a record, and the forces double."""
    run = ingested("12_", tmp_path, PLATE)
    before = physical(run).to_pandas()["Channel 4 (N)"]
    calibrate([run], "z1", Calibration(sensitivity=f"{VERTICAL} pC/N", amplifier="1000 pC/V"), "range was 1000 pC/V")
    np.testing.assert_allclose(physical(run).to_pandas()["Channel 4 (N)"], 2.0 * before, rtol=1e-12)
    assert {state.status for state in open_campaign(run.path.parent).verify()} == {"intact"}


@pytest.mark.recordings
def test_offsets_of_a_wheel(tmp_path):
    """The offsets of an unloaded wheel, recorded later: means go to zero, what varies and what is stored stay."""
    run = ingested("11_", tmp_path, WHEEL)
    raw = {name: run.channel(f"col{18 + i}") for i, name in enumerate(("Fx", "Fy", "Fz", "Mx", "My", "Mz"))}
    offset = {name: f"{float(values.mean())!r} {'N' if name[0] == 'F' else 'N m'}" for name, values in raw.items()}
    calibrate([run], "wheel", Calibration(offset=offset), "baseline without load")
    table = physical(run).to_pandas()
    for i, (name, values) in enumerate(raw.items()):
        found = table[f"col{18 + i} ({'N' if name[0] == 'F' else 'N m'})"].to_numpy()
        assert abs(found.mean()) < 1e-9
        np.testing.assert_allclose(found - found[0], values - values[0], atol=1e-9)
    assert run.channel("col18")[0] == -3.11
