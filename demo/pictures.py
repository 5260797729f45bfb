"""The pictures of step 3: the source's figures, of simulated runs."""

import sys
from pathlib import Path

from balance.figures.mechanism import save
from testbench.figures.runs import base_acceleration, command_performance, force_sensors, motor_torques
from testbench.store import open_campaign
from testbench.store.run import Run

from .console import saved
from .overview import overview

SHOWN = {"payload_kg": 5.0, "motion": "x", "peak_acceleration_g": 3.0}
"""The condition whose time series the source shows."""


def run(out: Path) -> None:
    """Draw the overview and the source's figures."""
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


if __name__ == "__main__":
    run(Path(sys.argv[1]))
