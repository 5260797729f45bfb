"""What really happened in a simulated campaign, for tests and for judging an analysis; the analysis never reads it.

A Parquet file a run: noise-free time series, those of base and drives in single precision; one JSON document: what was
drawn, and what is true of each run.
"""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from balance.table_files import write_parquet

from .sampling import is_irregular
from .sensors import base_acceleration
from .transducers import draw

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from balance.arrays import Floats
    from balance.conditions import Conditions

    from ..rig import Rig
    from .recorded import SimulatedRun
    from .run import BenchRun

FOLDER = "truth"
_WRENCH = ("Fx_N", "Fy_N", "Fz_N", "Mx_Nm", "My_Nm", "Mz_Nm")
_DISPLACEMENT = ("base_x_m", "base_y_m", "base_z_m", "base_phi_x_rad", "base_phi_y_rad", "base_phi_z_rad")
_ACCELERATION = tuple(
    f"base_{name}_acceleration_{unit}"
    for names, unit in ((("x", "y", "z"), "m_s2"), (("phi_x", "phi_y", "phi_z"), "rad_s2"))
    for name in names
)


def write_run(folder: Path, rig: "Rig", run: "SimulatedRun", balance: "Conditions") -> dict[str, Any]:
    """Write a run's time series, SI; returns what else is true of it. ``balance`` are the mechanism's conditions."""
    write_parquet(folder / f"{run.planned.name}.parquet", time_series(rig, run.bench))
    for name, log in run.logs.items():
        if is_irregular(rig.loggers[name]):
            instants = {"logged_s": log.time, "true_s": log.true}
            write_parquet(folder / f"{run.planned.name}_{name}.instants.parquet", instants)
    return {
        "run": run.planned.name,
        **run.planned.conditions,
        "base_frequencies_hz": run.bench.base.frequencies_hz.tolist(),
        "first_moment_residual_kg_m": balance.values(run.bench.mechanism).tolist(),
        "clocks": {
            name: {
                "start_s": logger.start,
                "drift_ppm": logger.drift_ppm,
                "filter_delay_s": logger.delay,
                "lost_samples": run.logs[name].lost,
            }
            for name, logger in run.loggers.items()
            if name in run.logs
        },
    }


def time_series(rig: "Rig", run: "BenchRun") -> "dict[str, Floats | NDArray[np.float32]]":
    """Shaking wrench, base motion, drive torques, and what accelerometers on the base are exposed to, (n,) each."""
    columns = {"time_s": run.time} | dict(zip(_WRENCH, run.wrench.T, strict=True))
    for name, sensor in rig.base_accelerometers.items():
        seen = base_acceleration(sensor, run)
        columns |= {f"{column.channel}_m_s2": seen[column.component] for column in sensor.columns(name)}
    moved = dict(zip(_DISPLACEMENT, run.motion.displacement.T, strict=True))
    moved |= dict(zip(_ACCELERATION, run.motion.acceleration.T, strict=True))
    moved |= {f"torque_{joint}_Nm": torque for joint, torque in run.torque.items()}
    return columns | {name: values.astype(np.float32) for name, values in moved.items()}


def write_campaign(folder: Path, rig: "Rig", seed: int, runs: list[dict[str, Any]]) -> None:
    """Write what is true of the whole campaign: seed, clocks as the rig has them, sensors, runs."""
    clocks = {name: {"start_s": logger.start, "drift_ppm": logger.drift_ppm} for name, logger in rig.loggers.items()}
    sensors = {name: sensor.truth for name, sensor in draw(rig, seed).items()}
    document = {"origin": "simulated", "seed": seed, "clocks": clocks, "sensors": sensors, "runs": runs}
    (folder / "truth.json").write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
