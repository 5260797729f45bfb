"""How often intervals of reductions hold the truth, as a user gets them: whole simulated campaigns, analysed.

Each seed is a campaign of the shipped bench in memory, with what ``testbench ingest`` would have stored of it; analysed
are all its runs at once, so that repeats of all conditions are pooled. One condition shakes the base hardly more than
the accelerometer's noise. ``python -m benchmarks.reduction_campaigns SEEDS REPEATS [METRIC...]``
"""

import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from balance.mechanism import Mechanism
from balance.quantities import G0
from testbench.bench.recorded import SimulatedRun, record_run
from testbench.bench.run import BenchRun, simulate_run
from testbench.bench.sampling import instants
from testbench.bench.sensors import base_acceleration
from testbench.plan import PlannedRun
from testbench.recording import Channel, UniformClock
from testbench.reductions import analyze
from testbench.rig import Rig, load
from testbench.store.run import Run, StoredGroup
from testbench.vibration import METRICS, Measure

SENSOR, LOGGER = "base_acc", "daq"
CONDITIONS = ((3.4116, 17.1105, "x", 1.0), (5.0, 24.2626, "y", 2.0), (5.0, 24.2626, "x", 0.25))
"""Payload [kg], counter-mass on each arm [kg], motion, peak acceleration [g0]."""


class MemoryRun(Run):
    """A run whose data are in memory, by path."""

    def _read(self, group: StoredGroup, index: int) -> np.ndarray:
        return self.provenance["data"][f"{group.path}/{group.keys[index]}"]


def simulated(rig: Rig) -> dict[tuple[int, bool], tuple[PlannedRun, BenchRun]]:
    """What happens without noise, by condition and whether counter-masses are on."""
    mechanism, found = Mechanism.load(rig.mechanism), {}
    for number, (payload, mass, motion, acceleration) in enumerate(CONDITIONS):
        for balanced in (True, False):
            masses = {"counter_A0A": mass, "counter_B0B": mass} if balanced else {}
            planned = PlannedRun("r", payload, masses, motion, acceleration * G0, 1)
            found[number, balanced] = planned, simulate_run(rig, mechanism, planned)
    return found


def stored(made: SimulatedRun, rig: Rig, name: str) -> MemoryRun:
    """What ingest would have stored of the accelerometers' log."""
    log, logger, columns = made.logs[LOGGER], rig.loggers[LOGGER], list(rig.columns(LOGGER))
    data = {f"{LOGGER}/{c.channel}": np.round(log.columns[c.channel], logger.decimals) for c in columns}
    channels, keys = tuple(Channel(c.channel, c.unit) for c in columns), tuple(c.channel for c in columns)
    clock = UniformClock(logger.rate)
    group = StoredGroup(LOGGER, channels, clock, len(log.true), logger.rate, "declared", LOGGER, keys)
    return MemoryRun(Path(f"{name}.h5"), (group,), "simulated", made.planned.conditions, rig.text, (), {"data": data})


def truth(rig: Rig, run: BenchRun, measure: Measure) -> dict[str, float]:
    """Amplitude without noise, by axis [m/s2]."""
    logger = rig.loggers[LOGGER]
    true = instants(logger, float(run.time[-1]))[1]
    seen = base_acceleration(rig.sensors[SENSOR], run)
    return {axis: measure.of(np.interp(true, run.time, seen[axis]), logger.rate) for axis in "xyz"}


def campaigns(rig: Rig, seeds: int, repeats: int) -> Iterator[list[MemoryRun]]:
    """Of every seed all runs."""
    happened = simulated(rig)
    for seed in range(seeds):
        runs = [pair for pair in happened.values() for _ in range(repeats)]
        yield [
            stored(record_run(rig, planned, run, {}, (seed, number)), rig, f"r{number:03d}")
            for number, (planned, run) in enumerate(runs)
        ]


def study(seeds: int, repeats: int, metric: str) -> dict[tuple[int, str], Counter[str]]:
    """What became of the intervals, by condition and axis."""
    rig, measure = load("parallelogram-6bar"), Measure(metric)
    true = {key: truth(rig, run, measure) for key, (_, run) in simulated(rig).items()}
    numbers = {(payload, motion): n for n, (payload, _, motion, _) in enumerate(CONDITIONS)}
    found: dict[tuple[int, str], Counter[str]] = {}
    for runs in campaigns(rig, seeds, repeats):
        for reduction in analyze(runs, measure).reductions:
            number = numbers[reduction.key.payload_kg, reduction.key.motion]
            ratio = true[number, True][reduction.axis] / true[number, False][reduction.axis]
            some = found.setdefault((number, reduction.axis), Counter())
            some["below_noise"] += reduction.below_noise
            some["none"] += reduction.interval is None
            if reduction.interval:
                some["held"] += reduction.interval[0] <= 100.0 * (1.0 - ratio) <= reduction.interval[1]
                some["count"] += 1
    return found


def main(words: list[str]) -> None:
    """Print how often the truth was held, of the intervals that there are."""
    seeds, repeats = int(words[0]), int(words[1])
    for metric in words[2:] or METRICS:
        for (number, axis), some in study(seeds, repeats, metric).items():
            payload, _, motion, acceleration = CONDITIONS[number]
            chance = binomtest(some["held"], some["count"], 0.95).pvalue if some["count"] else float("nan")
            print(f"{repeats} runs a side, {payload:g} kg, motion {motion}, {acceleration:g} g0, {axis} {metric:12s} "
                  f"{some['held']:4d} of {some['count']}  p {chance:.4f}  below noise {some['below_noise']}  "
                  f"none {some['none']}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
