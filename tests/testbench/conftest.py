"""Simulated campaigns, each made once a test run, for the tests of what comes after the logs; and the command."""

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import pytest
from filelock import FileLock

from ..commands import Outcome
from ..commands import call as call_main

if TYPE_CHECKING:
    from testbench.vibration.reduction import Analysis


class Simulated(NamedTuple):
    """Where a simulated campaign lies: its logs with the truth, and the stored runs."""

    logs: Path
    campaign: Path


def simulated(folder: Path, plan: str, rig: str = "parallelogram-6bar") -> Simulated:
    """Simulate a plan (its text) and ingest the logs."""
    from testbench import campaign_plan as plans
    from testbench import rig as rigs
    from testbench.ingestion import Ingest
    from testbench.ingestion.planned_runs import plan_runs as sheet
    from testbench.simulator.campaign import RUN_TABLE, simulate_campaign

    bench = rigs.load_rig(rig)
    logs = simulate_campaign(plans.plan_from_text(plan), bench, folder / "logs")
    campaign = folder / "campaign"
    campaign.mkdir()
    ingest = Ingest(campaign, bench)
    for run in sheet(logs, folder / "logs" / RUN_TABLE):
        assert {outcome.status for outcome in ingest.run(run)} == {"stored"}
    return Simulated(folder / "logs", campaign)


CONDITION = """
[[conditions]]
payload = "{} kg"
{}motion = {}
peak_acceleration = "3 g0"
also_without = false
"""


def conditions(*several: tuple[float, float, tuple[str, ...]], seed: int = 5) -> str:
    """A plan of payloads [kg], counter-masses on each arm [kg] (zero: none) and motions, one run each."""
    mounted = 'counter_masses = {{ counter_A0A = "{0} kg", counter_B0B = "{0} kg" }}\n'
    parts = [CONDITION.format(p, mounted.format(m) if m else "", list(motions)) for p, m, motions in several]
    return f'mechanism = "parallelogram-6bar"\nseed = {seed}\n' + "".join(parts)


def built(*motions: str) -> str:
    """A plan of these motions at 3.4116 kg with the counter-masses that were built for it."""
    return conditions((3.4116, 17.1105, motions))


PAIR = conditions((3.4116, 17.1105, ("x",)), (3.4116, 0.0, ("x",)))
"""A plan of two runs along x, with the counter-masses that were built and without."""


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Simulated]:
    """Campaigns by plan and rig, each made once for all processes of a test run; who changes one copies it first."""
    base = tmp_path_factory.getbasetemp()
    base = (base.parent if base.name.startswith("popen-") else base) / "shared"
    base.mkdir(exist_ok=True)

    def made(plan: str, rig: str = "parallelogram-6bar") -> Simulated:
        folder = base / hashlib.sha256(f"{rig}\n{plan}".encode()).hexdigest()[:16]
        with FileLock(f"{folder}.lock"):
            if not (folder / "whole").exists():
                folder.mkdir()
                simulated(folder, plan, rig)
                (folder / "whole").touch()
        return Simulated(folder / "logs", folder / "campaign")

    return made


@pytest.fixture(scope="session")
def brief(shared: Callable[..., Simulated]) -> Simulated:
    """The shipped brief plan: four conditions, with and without counter-masses."""
    from balance import datasets

    return shared(datasets.find_dataset("kiper2019-brief", "plans", ".toml").read_text("utf-8"))


@pytest.fixture(scope="session")
def brief_analysis(brief: Simulated) -> "Callable[[str], Analysis]":
    """By metric the analysis of the brief plan within 0..200 Hz, each made once in a process."""
    from testbench.signal.filters import Band
    from testbench.store import open_campaign
    from testbench.vibration.metrics import Measure
    from testbench.vibration.reduction import analyze

    return cache(lambda metric: analyze(open_campaign(brief.campaign).runs, Measure(metric, Band(0.0, 200.0))))


@pytest.fixture(scope="session")
def pair_built(shared: Callable[..., Simulated]) -> Simulated:
    """Two runs, x and a triangle, at 3.4116 kg with the counter-masses that were built for it."""
    return shared(built("x", "triangle"))


@pytest.fixture
def command() -> Callable[..., Outcome]:
    """``testbench`` with words, in this process: exit code, standard output and error."""
    return call


def reported(run, *how):
    """The report of a run by itself; ``how`` as ``Reporting`` takes it."""
    from testbench.report import Reporting

    return Reporting(*how).runs([run])[1][run.name]


def call(*words: object) -> Outcome:
    """``testbench`` with words as a process of its own would do it, but in this one."""
    from testbench.cli import main

    return call_main(main, "testbench", *words)
