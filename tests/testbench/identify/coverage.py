"""How often the known parameters of the simulated bench lie in their 95 % intervals, over seeds: a script, not a test.

python -m tests.testbench.identify.coverage [SEEDS]
"""

import sys
import tempfile
from pathlib import Path

import click
import numpy as np

from testbench.identify import identify
from testbench.identify.assembly import assemble

from . import bench

CONDITIONS = [(3.4116, 17.1105, "triangle"), (5.0, 17.1105, "triangle")]


def main(seeds: int) -> None:
    """Say, for torques and for forces, the share of base parameters inside, and the intervals' widths."""
    inside: dict[str, list[bool]] = {"torque": [], "wrench": []}
    for seed in range(seeds):
        with tempfile.TemporaryDirectory() as folder:
            runs = bench.runs(Path(folder), CONDITIONS, seed=100 + seed)
            for by, found in inside.items():
                taken = assemble(runs, bench.MECHANISM, by)
                result = identify(taken.records, taken.mechanism, "ls", others=False)
                found += [v.interval[0] <= v.in_file <= v.interval[1] for v in result.base_values()]
    for by, found in inside.items():
        click.echo(f"{by}: {np.mean(found):.1%} of {len(found)} intervals over {seeds} seeds hold the known value")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
