"""Many designs of counter-masses on Dask: ``balance sweep --scheduler`` with two worker processes against one.

    python -m benchmarks.workers [--designs 1000000] [--samples 200] [--rounds 5]

Both schedulers run before anything is timed, and their workers have answered. Force, moment and torques of each design,
RMS and peak; each worker hands on its best designs. What both found is compared with this process's first.
"""

import argparse
import statistics
from functools import partial

import numpy as np

from balance.arrays import Floats
from balance.balancing.sweep import Problem, Sweep, Variable, joined
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion.motion_files import load_motion
from balance.task_pool import HERE, LOCAL, TaskPool, task_pool

from .designs import SITES, timed

REQUIRED = 1.7
"""How many times faster two workers are than one."""
RANKED_BY = "rms_F_N"


def best(columns: dict[str, Floats]) -> dict[str, Floats]:
    """The five designs of least force."""
    order = np.argsort(columns[RANKED_BY])[:5]
    return {name: values[order] for name, values in columns.items()}


def found(sweep: Sweep, pool: TaskPool) -> dict[str, Floats]:
    """The best designs of all parts."""
    return best(joined([columns for _, columns in sweep.run(pool)]))


def main() -> int:
    """Compare what one, two and no workers find, then time them in turn; 1 where two are too slow."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--designs", type=int, default=1_000_000)
    parser.add_argument("--samples", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    side = int(np.sqrt(given.designs))
    motion = load_motion("x")
    samples = motion.sample(given.samples / motion.duration)
    problem = Problem(load_mechanism("parallelogram-6bar").with_payload({"platform": 5.0}), samples)
    variables = tuple(Variable(name, "mass", np.linspace(0.1, 30.0, side)) for name in SITES)
    sweep = Sweep(problem, variables, chosen=best)
    with task_pool(LOCAL, 1) as one, task_pool(LOCAL, 2) as two:
        expected = found(sweep, HERE)
        for pool in (one, two):
            for name, values in found(sweep, pool).items():
                np.testing.assert_array_equal(values, expected[name], err_msg=f"{name}, {pool.workers} workers")
        print(f"{side * side} designs x {len(samples.time)} samples; one, two and no workers found the same")
        seconds = [(timed(partial(found, sweep, one)), timed(partial(found, sweep, two))) for _ in range(given.rounds)]
    ratios = sorted(alone / both for alone, both in seconds)
    ratio = statistics.median(ratios)
    print(f"one worker {min(seconds)[0]:.2f} s, two {min(both for _, both in seconds):.2f} s")
    print(f"two workers: {ratio:.2f} times one (needs {REQUIRED:g}); {', '.join(f'{r:.2f}' for r in ratios)}")
    return int(ratio < REQUIRED)


if __name__ == "__main__":
    raise SystemExit(main())
