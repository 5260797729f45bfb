"""Stored runs of the simulated bench, whose true parameters are known."""

from collections.abc import Sequence
from pathlib import Path

from balance.loading.loading import load_mechanism
from testbench import plan, rig
from testbench.bench.campaign import simulate
from testbench.ingest import Ingest, runsheet
from testbench.store import Run, open_campaign

MECHANISM = load_mechanism("parallelogram-6bar")
CONDITION = """
[[conditions]]
payload = "{payload} kg"
{counter}motion = ["{motion}"]
peak_acceleration = "3 g0"
also_without = {without}
"""
COUNTER = 'counter_masses = {{ counter_A0A = "{0} kg", counter_B0B = "{0} kg" }}\n'
Condition = tuple[float, float, str]
"""Payload [kg], counter-mass on each arm [kg] (zero: none), motion."""


def runs(folder: Path, conditions: Sequence[Condition], seed: int = 5) -> Sequence[Run]:
    """Runs of the shipped bench, one a condition, ingested with their rig."""
    parts = []
    for payload, mass, motion in conditions:
        counter = COUNTER.format(mass) if mass else ""
        parts.append(CONDITION.format(payload=payload, counter=counter, motion=motion, without="false"))
    text = f'mechanism = "parallelogram-6bar"\nseed = {seed}\n' + "".join(parts)
    (folder / "plan.toml").write_text(text, encoding="utf-8")
    bench = rig.load("parallelogram-6bar")
    simulate(plan.load(folder / "plan.toml"), bench, folder / "logs")
    ingest = Ingest(folder / "campaign", bench)
    for planned in runsheet.plan(sorted((folder / "logs").glob("r*_*.csv")), folder / "logs" / "runs.csv"):
        ingest.run(planned)
    return open_campaign(folder / "campaign").runs
