"""Steps 2 and 3: a simulated campaign of the published test conditions, as logs, into HDF5, to reductions."""

import json
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from balance.figures.mechanism import save
from testbench.figures.runs import base_acceleration, command_performance, force_sensors, motor_torques
from testbench.store import open_campaign
from testbench.store.run import Run

from .console import command, heading, saved
from .overview import overview

SHOWN = {"payload_kg": 5.0, "motion": "x", "peak_acceleration_g": 3.0}
"""The condition whose time series the source shows."""


def run(out: Path) -> None:
    """Simulate, ingest, verify, analyse, compare, draw."""
    heading("2. The 26 published conditions, with and without counter-masses: simulated logs into HDF5")
    command(["testbench", "simulate", "--plan", "kiper2019", "--rig", "parallelogram-6bar", "-o", "logs"], out)
    logs = sorted(path.relative_to(out) for path in (out / "logs").glob("r*_*.csv"))
    sheet = ["--rig", "parallelogram-6bar", "--runs", "logs/runs.csv", "-o", "campaign", "--json"]
    printed = command(
        ["testbench", "ingest", *logs, *sheet], out, shown=f"testbench ingest logs/r*_*.csv {' '.join(sheet)}"
    )
    _summarise(json.loads(printed)["runs"])
    command(["testbench", "verify", "campaign", "-q"], out)

    heading("3. How much the base's vibration fell: analysed from the logs, simulated anew, published")
    command(["testbench", "report", "campaign", "--published", "kiper2019", "-o", "report.html", "-q"], out)
    saved(out / "report.html", "all 78 reductions beside those simulated and published (simulated logs)")
    _draw(out)


def _summarise(stored: list[dict]) -> None:
    """How many logs were stored, of which origin, with which findings."""
    for what in ("status", "origin"):
        print(f"   {what}: {_counted(log[what] for log in stored)}")
    print(f"   findings: {_counted(finding['code'] for log in stored for finding in log['findings'])}")


def _counted(words: Iterable[str]) -> str:
    return ", ".join(f"{word} {count}" for word, count in Counter(words).most_common()) or "none"


def _draw(out: Path) -> None:
    """The source's figures, of simulated runs."""
    runs = open_campaign(out / "campaign").runs
    balanced, unbalanced = _shown(runs, with_counter_masses=True), _shown(runs, with_counter_masses=False)
    figures = {
        "overview": overview(balanced, unbalanced),
        "base-acceleration": base_acceleration(balanced, unbalanced),
        "motor-torques": motor_torques(balanced, unbalanced),
        "force-sensors": force_sensors(balanced, unbalanced),
        "command-performance": command_performance(balanced),
    }
    for name, figure in figures.items():
        save(figure, out / f"{name}.png")
        saved(out / f"{name}.png", f"{name.replace('-', ' ')} (simulated)")


def _shown(runs: "tuple[Run, ...]", *, with_counter_masses: bool) -> Run:
    return next(
        run
        for run in runs
        if all(run.conditions.get(key) == value for key, value in SHOWN.items())
        and bool(run.conditions.get("counter_masses")) is with_counter_masses
    )
