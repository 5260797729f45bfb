"""A log in volts of one accelerometer and one six-axis sensor, whose loads are known."""

from pathlib import Path

import numpy as np

from testbench import rig as rigs
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import PlannedRun
from testbench.store import Run, open_run

COUNT = 400
TIME = np.arange(COUNT) / 1000.0
ACCELERATION = 9.81 * np.sin(2.0 * np.pi * 7.0 * TIME)
"""[m/s2]"""
LOADS = np.array([[200.0], [100.0], [900.0], [4.0], [3.0], [2.0]]) * np.cos(
    2.0 * np.pi * np.outer([3.0, 5.0, 7.0, 2.0, 4.0, 6.0], TIME)
)
"""Of the six-axis sensor, by Fx ... Mz, (6, n) [N, N m]."""
PER_VOLT = np.diag([100.0, 100.0, 400.0, 4.0, 4.0, 4.0]) @ (np.eye(6) + 0.02 * np.sin(np.arange(36.0)).reshape(6, 6))
"""Loads = PER_VOLT @ volts [N/V, N m/V]."""
NAMES = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")

HEAD = """
name = "volts"
mechanism = "none"
[loggers.daq]
rate = "1 kHz"
[sensors.acc]
kind = "accelerometer"
logger = "daq"
channels = { x = "ch0" }
position = ["0 m", "0 m", "0 m"]
"""
SIX = """
[sensors.six]
kind = "wrench"
logger = "daq"
channels = { Fx = "ch1", Fy = "ch2", Fz = "ch3", Mx = "ch4", My = "ch5", Mz = "ch6" }
position = ["0 m", "0 m", "0 m"]
"""
MATRIX = (
    '[sensors.six.calibration]\nmatrix = { raw = "V", physical = { F = "N", M = "N m" }, rows = '
    + str(PER_VOLT.tolist())
    + " }\n"
)
SENSITIVITY = '[sensors.acc.calibration]\nsensitivity = "100 mV/g"\noffset = "2.5 V"\n'


def log(folder: Path, name: str = "r1", unit: str | None = "V", first: float = 2.5) -> Path:
    """Write the log; ``unit`` stands in its header; ``first`` is the first sample of the accelerometer [V]."""
    volts = [2.5 + 0.1 * ACCELERATION / 9.81, *np.linalg.solve(PER_VOLT, LOADS)]
    volts[0][0] = first
    names = ["time (s)", *(f"ch{i} ({unit})" if unit else f"ch{i}" for i in range(7))]
    rows = "\n".join(",".join(f"{value:.12f}" for value in row) for row in np.column_stack([TIME, *volts]))
    path = folder / f"{name}.csv"
    path.write_text(",".join(names) + "\n" + rows + "\n", encoding="utf-8")
    return path


def stored(folder: Path, rig: str, unit: str | None = "V", name: str = "r1", first: float = 2.5) -> Run:
    """The log, ingested with a rig."""
    planned = PlannedRun(name, (log(folder, name, unit, first),))
    (outcome,) = Ingest(folder / "campaign", rigs.load_rig(rig)).run(planned)
    assert outcome.status == "stored", outcome.message
    return open_run(folder / "campaign" / f"{name}.h5")
