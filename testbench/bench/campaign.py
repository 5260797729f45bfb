"""A simulated campaign: a folder of logs as loggers would write them, the sheet of runs, and the truth apart."""

import csv
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from balance import conditions
from balance.loading.loading import load_mechanism
from balance.mechanism import Mechanism

from ..errors import RigError
from ..plan import Plan, PlannedRun
from ..rig import Rig
from . import logfile, recorded, truth
from .recorded import SimulatedRun
from .run import payload_body

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
    mechanism = load_mechanism(rig.mechanism)
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
    total, sheet, facts = len(plan.runs()), [], []
    balance = conditions.find(mechanism)
    for number, run in enumerate(recorded.simulate(plan, rig), 1):
        names = _write_logs(folder, rig, run)
        sheet += [_row(run.planned, name) for name in names]
        facts.append(truth.write_run(folder / truth.FOLDER, rig, run, balance))
        if progress:
            progress(number, total)
    truth.write_campaign(folder / truth.FOLDER, rig, plan.seed, facts)
    with (folder / SHEET).open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, _COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(sheet)
    return [row["file"] for row in sheet]


def _write_logs(folder: Path, rig: Rig, run: SimulatedRun) -> list[str]:
    names = []
    for name, log in run.logs.items():
        names.append(f"{run.planned.name}_{name}.csv")
        about = {"rig": rig.name or rig.mechanism, "run": run.planned.name, "logger": name}
        logfile.write(folder / names[-1], rig.loggers[name], list(rig.columns(name)), log, about)
    return names


def _row(planned: PlannedRun, file: str) -> dict[str, str]:
    """A line of the sheet, as a person at the bench would keep it."""
    masses = ";".join(f"{site}={mass:.12g}" for site, mass in planned.counter_masses.items())
    acceleration = f"{planned.conditions['peak_acceleration_g']:.12g}"
    cells = (planned.name, file, "simulated", f"{planned.payload:.12g}", masses, planned.motion, acceleration)
    return dict(zip(_COLUMNS, (*cells, str(planned.repeat)), strict=True))
