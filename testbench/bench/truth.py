"""What really happened in a simulated campaign, for tests and for judging an analysis; the analysis never reads it."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .run import BenchRun
from .sensors import base_acceleration

if TYPE_CHECKING:
    from ..plan import PlannedRun
    from ..rig import Rig

FOLDER = "truth"


def write_run(folder: Path, rig: "Rig", planned: "PlannedRun", run: BenchRun) -> dict[str, Any]:
    """Write a run's time series as Parquet, SI, noise-free; returns what else is true of it."""
    import polars

    names = ("Fx_N", "Fy_N", "Fz_N", "Mx_Nm", "My_Nm", "Mz_Nm")
    columns = {"time_s": run.time} | dict(zip(names, run.wrench.T, strict=True))
    for name, sensor in rig.base_accelerometers.items():
        seen = base_acceleration(sensor, run)
        columns |= {f"{column.channel}_m_s2": seen[column.component] for column in sensor.columns(name)}
    polars.DataFrame({name: values.copy() for name, values in columns.items()}).write_parquet(
        folder / f"{planned.name}.parquet"
    )
    return {"run": planned.name, **planned.conditions, "base_frequencies_hz": run.base.frequencies_hz.tolist()}


def write_campaign(folder: Path, rig: "Rig", seed: int, runs: list[dict[str, Any]]) -> None:
    """Write what is true of the whole campaign: seed, clocks, runs."""
    clocks = {name: {"start_s": logger.start, "drift_ppm": logger.drift_ppm} for name, logger in rig.loggers.items()}
    document = {"origin": "simulated", "seed": seed, "clocks": clocks, "runs": runs}
    (folder / "truth.json").write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
