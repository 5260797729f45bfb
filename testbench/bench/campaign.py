"""A simulated campaign: a folder of logs as loggers would write them, the sheet of runs, and the truth apart."""

import csv
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from balance.mechanism import Mechanism

from ..errors import RigError
from ..plan import Plan, PlannedRun
from ..rig import Rig
from . import logfile, truth
from .loggers import record
from .run import BenchRun, payload_body, simulate_run
from .sensors import signals

SHEET = "runs.csv"
_COLUMNS = ("run", "file", "origin", "payload_kg", "counter_masses", "motion", "peak_acceleration_g", "repeat")


def simulate(plan: Plan, rig: Rig, folder: Path, progress: Callable[[int, int], None] | None = None) -> list[Path]:
    """Simulate all runs of a plan into ``folder``, which must be new or empty; returns the logs.

    The logs are made beside and moved there at the end: a failure leaves nothing behind.
    """
    if plan.mechanism != rig.mechanism:
        raise RigError(
            f"the plan is for {plan.mechanism!r}, the rig for {rig.mechanism!r}: expected the same mechanism"
        )
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise RigError(f"{folder}: exists and is not empty; name a new folder")
    mechanism = Mechanism.load(rig.mechanism)
    payload_body(mechanism, plan.payload_body)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as beside:
        made = Path(beside) / "logs"
        names = _write_all(plan, rig, mechanism, made, progress)
        if folder.exists():
            folder.rmdir()
        shutil.move(made, folder)
    return [folder / name for name in names]


def _write_all(
    plan: Plan, rig: Rig, mechanism: Mechanism, folder: Path, progress: Callable[[int, int], None] | None
) -> list[str]:
    (folder / truth.FOLDER).mkdir(parents=True)
    runs, sheet, facts = plan.runs(), [], []
    for number, planned in enumerate(runs):
        run = simulate_run(rig, mechanism, planned)
        names = _write_logs(folder, rig, planned, run, (plan.seed, number))
        sheet += [_row(planned, name) for name in names]
        facts.append(truth.write_run(folder / truth.FOLDER, rig, planned, run))
        if progress:
            progress(number + 1, len(runs))
    truth.write_campaign(folder / truth.FOLDER, rig, plan.seed, facts)
    with (folder / SHEET).open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, _COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(sheet)
    return [row["file"] for row in sheet]


def _write_logs(folder: Path, rig: Rig, planned: PlannedRun, run: BenchRun, seed: tuple[int, int]) -> list[str]:
    seen = signals(rig, run)
    names = []
    for number, (name, logger) in enumerate(rig.loggers.items()):
        columns = list(rig.columns(name))
        if not columns:
            continue
        log = record(logger, columns, run.time, seen, (*seed, number))
        names.append(f"{planned.name}_{name}.csv")
        about = {"rig": rig.name or rig.mechanism, "run": planned.name, "logger": name}
        logfile.write(folder / names[-1], logger, columns, log, about)
    return names


def _row(planned: PlannedRun, file: str) -> dict[str, str]:
    """A line of the sheet, as a person at the bench would keep it."""
    masses = ";".join(f"{site}={mass:.12g}" for site, mass in planned.counter_masses.items())
    acceleration = f"{planned.conditions['peak_acceleration_g']:.12g}"
    cells = (planned.name, file, "simulated", f"{planned.payload:.12g}", masses, planned.motion, acceleration)
    return dict(zip(_COLUMNS, (*cells, str(planned.repeat)), strict=True))
