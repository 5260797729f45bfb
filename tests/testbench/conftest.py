"""A brief simulated campaign, made once, for the tests of what comes after the logs."""

from pathlib import Path
from typing import NamedTuple

import pytest


class Simulated(NamedTuple):
    """Where a simulated campaign lies: its logs with the truth, and the stored runs."""

    logs: Path
    campaign: Path


def simulated(folder: Path, plan: str, rig: str = "parallelogram-6bar") -> Simulated:
    """Simulate a plan (its text) and ingest the logs."""
    from testbench import plan as plans
    from testbench import rig as rigs
    from testbench.bench.campaign import SHEET, simulate
    from testbench.ingest import Ingest
    from testbench.ingest.runsheet import plan as sheet

    bench = rigs.load(rig)
    logs = simulate(plans.from_text(plan), bench, folder / "logs")
    campaign = folder / "campaign"
    campaign.mkdir()
    ingest = Ingest(campaign, bench)
    for run in sheet(logs, folder / "logs" / SHEET):
        assert {outcome.status for outcome in ingest.run(run)} == {"stored"}
    return Simulated(folder / "logs", campaign)


def built(*motions: str) -> str:
    """A plan of these motions at 3.4116 kg with the counter-masses that were built for it, one run each."""
    return f"""
mechanism = "parallelogram-6bar"
seed = 5
[[conditions]]
payload = "3.4116 kg"
counter_masses = {{ counter_A0A = "17.1105 kg", counter_B0B = "17.1105 kg" }}
motion = {list(motions)}
peak_acceleration = "3 g0"
also_without = false
"""


@pytest.fixture(scope="session")
def brief(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    """The shipped brief plan: four conditions, with and without counter-masses."""
    from balance import datasets

    text = datasets.find("kiper2019-brief", "plans", ".toml").read_text("utf-8")
    return simulated(tmp_path_factory.mktemp("brief"), text)
