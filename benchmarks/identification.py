"""How often the known parameters of the simulated bench lie in their 95 % intervals, over seeds.

python -m benchmarks.identification [--seeds 10]
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from balance.loading.loading import load_mechanism
from testbench import plan, rig
from testbench.bench.campaign import simulate
from testbench.identify import identify
from testbench.identify.assembly import assemble
from testbench.ingest import Ingest, runsheet
from testbench.store import open_campaign

PLAN = """
mechanism = "parallelogram-6bar"
seed = {seed}
[[conditions]]
payload = "3.4116 kg"
counter_masses = {{ counter_A0A = "17.1105 kg", counter_B0B = "17.1105 kg" }}
motion = ["triangle"]
peak_acceleration = "3 g0"
also_without = false
[[conditions]]
payload = "5 kg"
counter_masses = {{ counter_A0A = "17.1105 kg", counter_B0B = "17.1105 kg" }}
motion = ["triangle"]
peak_acceleration = "3 g0"
also_without = false
"""


def inside(folder: Path, seed: int, by: str) -> list[bool]:
    """Whether each base parameter's known value lies in its interval."""
    mechanism = load_mechanism("parallelogram-6bar")
    if not (folder / "campaign").exists():
        (folder / "plan.toml").write_text(PLAN.format(seed=seed), encoding="utf-8")
        bench = rig.load("parallelogram-6bar")
        simulate(plan.load(folder / "plan.toml"), bench, folder / "logs")
        ingest = Ingest(folder / "campaign", bench)
        for planned in runsheet.plan(sorted((folder / "logs").glob("r*_*.csv")), folder / "logs" / "runs.csv"):
            ingest.run(planned)
    taken = assemble(open_campaign(folder / "campaign").runs, mechanism, by)
    found = identify(taken.records, taken.mechanism, "ls", others=False)
    return [v.interval[0] <= v.in_file <= v.interval[1] for v in found.base_values()]


def main() -> None:
    """Say, for torques and for forces, the share of intervals that hold the known value."""
    parser = argparse.ArgumentParser(description="Coverage of the intervals of testbench identify.")
    parser.add_argument("--seeds", type=int, default=10)
    seeds = parser.parse_args().seeds
    found: dict[str, list[bool]] = {"torque": [], "wrench": []}
    for seed in range(seeds):
        with tempfile.TemporaryDirectory() as folder:
            for by, hits in found.items():
                hits += inside(Path(folder), 100 + seed, by)
        for by, hits in found.items():
            print(f"{by}: {np.sum(hits)} of {len(hits)} intervals hold, {seed + 1} seeds", flush=True)


if __name__ == "__main__":
    main()
