"""A simulated campaign on disk: logs as loggers would write them, the run table, and the truth in a folder of its own.

A log is text: comments that name its origin, a header with units, fixed decimals in the logger's notation. The truth
serves tests and the evaluation of an analysis, which never reads it: a Parquet file a run with the time series without
noise (base and drives in single precision), and one JSON document with all that was drawn.
"""

import json
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.balancing import conditions
from balance.balancing.conditions import Conditions
from balance.table_files import can_write_parquet, write_csv, write_csv_file, write_parquet
from balance.task_pool import HERE, TaskPool

from ..campaign_plan import Plan, PlannedRun
from ..errors import RigError
from ..ingestion.run_table import write_run_table
from ..rig import Column, Rig
from ..rig.bench import Logger
from . import simulated_logs
from .drive_trains import parameters_on_links
from .loggers import Log, is_irregular
from .run import BenchRun, payload_body
from .sensors import base_acceleration, draw_transducers
from .simulated_logs import SimulatedRun

TRUTH_FOLDER = "truth"
_WRENCH = ("Fx_N", "Fy_N", "Fz_N", "Mx_Nm", "My_Nm", "Mz_Nm")
_DISPLACEMENT = ("base_x_m", "base_y_m", "base_z_m", "base_phi_x_rad", "base_phi_y_rad", "base_phi_z_rad")
_ACCELERATION = tuple(
    f"base_{name}_acceleration_{unit}"
    for names, unit in ((("x", "y", "z"), "m_s2"), (("phi_x", "phi_y", "phi_z"), "rad_s2"))
    for name in names
)


def write_run_truth(folder: Path, rig: "Rig", run: "SimulatedRun", balance: Conditions) -> dict[str, Any]:
    """Write a run's true time series and return its other true values; ``balance`` are the mechanism's conditions."""
    _write_table(folder / run.planned.name, true_series(rig, run.bench))
    for name, log in run.logs.items():
        if is_irregular(rig.loggers[name]):
            instants = {"logged_s": log.time, "true_s": log.true_time}
            _write_table(folder / f"{run.planned.name}_{name}.instants", instants)
    return {
        "run": run.planned.name,
        **run.planned.conditions,
        "base_frequencies_hz": run.bench.base.frequencies_hz.tolist(),
        "first_moment_residual_kg_m": balance.first_moment_residual(
            parameters_on_links(run.bench.mechanism, balance.mechanism)
        ),
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


def _write_table(stem: Path, columns: Mapping[str, Floats | NDArray[np.float32]]) -> None:
    """Write columns (n,) as Parquet where pyarrow is installed; else as CSV, ten times as large."""
    if can_write_parquet():
        write_parquet(f"{stem}.parquet", columns)
    else:
        write_csv_file(f"{stem}.csv", columns)


def true_series(rig: "Rig", run: BenchRun) -> dict[str, Floats | NDArray[np.float32]]:
    """Columns (n,) [SI]: shaking wrench, base motion, drive torques, acceleration at the base accelerometers."""
    columns = {"time_s": run.time} | dict(zip(_WRENCH, run.wrench.T, strict=True))
    for name, sensor in rig.base_accelerometers.items():
        acceleration = base_acceleration(sensor, run)
        columns |= {f"{column.channel}_m_s2": acceleration[column.component] for column in sensor.columns(name)}
    moved = dict(zip(_DISPLACEMENT, run.motion.displacement.T, strict=True))
    moved |= dict(zip(_ACCELERATION, run.motion.acceleration.T, strict=True))
    moved |= {f"torque_{joint}_Nm": torque for joint, torque in run.torque.items()}
    return columns | {name: values.astype(np.float32) for name, values in moved.items()}


def write_campaign_truth(folder: Path, rig: "Rig", seed: int, runs: list[dict[str, Any]]) -> None:
    """Write the true values of the campaign: seed, clocks as the rig states them, sensors, runs."""
    clocks = {name: {"start_s": logger.start, "drift_ppm": logger.drift_ppm} for name, logger in rig.loggers.items()}
    sensors = {name: sensor.truth for name, sensor in draw_transducers(rig, seed).items()}
    document = {"origin": "simulated", "seed": seed, "clocks": clocks, "sensors": sensors, "runs": runs}
    (folder / "truth.json").write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


def write_log(path: Path, logger: Logger, columns: Sequence[Column], log: Log, about: Mapping[str, str]) -> None:
    """Write a log as CSV, marked as simulated; ``about`` goes into comments."""
    timed = logger.clock == "recorded"
    if not timed:
        about = {**about, "rate": f"{logger.rate:g} Hz"}
    comments = "".join(f"# {key}: {value}\n" for key, value in {"origin": "simulated", **about}.items())
    names = ["Time (s)"] * timed + [f"{column.channel} ({column.unit})" for column in columns]
    table = [*([log.time] if timed else []), *log.columns.values()]
    with path.open("wb") as file:
        file.write((comments + logger.delimiter.join(names) + "\n").encode("utf-8"))
        write_csv(file, table, logger.delimiter, logger.decimals, decimal_comma=logger.decimal == ",")


RUN_TABLE = "runs.csv"


def simulate_campaign(
    plan: Plan, rig: Rig, folder: Path, progress: Callable[[int], None] | None = None, pool: TaskPool = HERE
) -> list[Path]:
    """Simulate all runs of a plan into ``folder``, which must be new or empty; returns the logs.

    A run is a task of the ``pool``, whose processes must reach the folder. The logs are written to a temporary folder
    and moved at the end, so a failure leaves nothing behind. Raises RigError for a plan of another mechanism or a
    folder that is not empty.
    """
    if plan.mechanism != rig.mechanism:
        raise RigError(
            f"the plan names the mechanism {plan.mechanism!r}, the rig {rig.mechanism!r}: make them the same"
        )
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise RigError(f"{folder}: exists and is not empty; name a new folder")
    bench = simulated_logs.SimulatedBench.of(rig, plan.seed)
    for run in plan.runs():
        for contradiction in run.contradictions(bench.mechanism):
            raise RigError(f"{plan.source}: run {run.name}: {contradiction}")
    if plan.payload_body is not None:
        payload_body(bench.mechanism, plan.payload_body)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as temporary:
        made = Path(temporary).absolute() / "logs"
        (made / TRUTH_FOLDER).mkdir(parents=True)
        work = partial(_write_run, made, bench, conditions.balance_conditions(bench.mechanism))
        runs, found = plan.runs(), {}
        for place, written in pool.results(work, list(enumerate(runs))):
            found[place] = written
            if progress:
                progress(1)
        write_campaign_truth(made / TRUTH_FOLDER, rig, plan.seed, [found[place][1] for place in range(len(runs))])
        logs = [(name, run) for place, run in enumerate(runs) for name in found[place][0]]
        write_run_table(made / RUN_TABLE, [(name, run.name, "simulated", run.conditions) for name, run in logs])
        if folder.exists():
            folder.rmdir()
        shutil.move(made, folder)
    return [folder / name for name, _ in logs]


def _write_run(
    folder: Path, bench: simulated_logs.SimulatedBench, balance: Conditions, numbered: tuple[int, PlannedRun]
) -> tuple[list[str], dict[str, Any]]:
    """Simulate one run and write it; names of its logs, and what is true of it."""
    run = bench.simulated(numbered)
    names = []
    for name, log in run.logs.items():
        names.append(f"{run.planned.name}_{name}.csv")
        about = {"rig": bench.rig.name or bench.rig.mechanism, "run": run.planned.name, "logger": name}
        write_log(folder / names[-1], bench.rig.loggers[name], list(bench.rig.columns(name)), log, about)
    return names, write_run_truth(folder / TRUTH_FOLDER, bench.rig, run, balance)
