"""How often intervals of reductions hold the truth, as a user gets them: whole simulated campaigns, analysed.

Each seed is a campaign of the shipped bench in memory, with what ``testbench ingest`` would have stored of it; analysed
are all its runs at once, so that repeats of all conditions are pooled. One condition shakes the base hardly more than
the accelerometer's noise. ``python -m benchmarks.reduction_campaigns SEEDS REPEATS [METRIC...]``
"""

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from balance.arrays import Floats
from balance.loading.loading import load_mechanism
from balance.quantities import G0
from testbench.bench.loggers import record
from testbench.bench.run import BenchRun, simulate_run
from testbench.bench.sampling import instants
from testbench.bench.sensors import base_acceleration, signals
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

    def channels_at(self, places: Sequence[tuple[StoredGroup, int]]) -> list[np.ndarray]:
        """Values by group and index."""
        return [self.provenance["data"][f"{group.path}/{group.keys[index]}"] for group, index in places]


@dataclass(frozen=True)
class Scene:
    """A run without noise, recorded as often as wanted."""

    rig: Rig
    planned: PlannedRun
    happened: BenchRun
    seen: Mapping[str, Floats]
    """By channel, (n,) [SI]."""

    def recorded(self, seed: int, number: int) -> MemoryRun:
        """What ingest would have stored of the accelerometers' log of run ``number``."""
        logger, columns = self.rig.loggers[LOGGER], list(self.rig.columns(LOGGER))
        log = record(logger, columns, self.happened.time, self.seen, (seed, number, 0))
        data = {f"{LOGGER}/{c.channel}": np.round(log.columns[c.channel], logger.decimals) for c in columns}
        channels, keys = tuple(Channel(c.channel, c.unit) for c in columns), tuple(c.channel for c in columns)
        clock, conditions = UniformClock(logger.rate), self.planned.conditions
        group = StoredGroup(LOGGER, channels, clock, len(log.true), logger.rate, "declared", LOGGER, keys)
        path = Path(f"r{number:03d}.h5")
        return MemoryRun(path, (group,), "simulated", conditions, self.rig.text, (), {"data": data})


def scenes(rig: Rig) -> dict[tuple[int, bool], Scene]:
    """By condition and whether counter-masses are on."""
    mechanism, found = load_mechanism(rig.mechanism), {}
    for number, (payload, mass, motion, acceleration) in enumerate(CONDITIONS):
        for balanced in (True, False):
            masses = {"counter_A0A": mass, "counter_B0B": mass} if balanced else {}
            planned = PlannedRun("r", payload, masses, motion, acceleration * G0, 1)
            happened = simulate_run(rig, mechanism, planned)
            found[number, balanced] = Scene(rig, planned, happened, signals(rig, happened))
    return found


def truth(scene: Scene, measure: Measure) -> dict[str, float]:
    """Amplitude without noise, by axis [m/s2]."""
    logger, time = scene.rig.loggers[LOGGER], scene.happened.time
    true = instants(logger, float(time[-1]))[1]
    seen = base_acceleration(scene.rig.sensors[SENSOR], scene.happened)
    return {axis: measure.of(np.interp(true, time, seen[axis]), logger.rate) for axis in "xyz"}


def study(seeds: int, repeats: int, metric: str) -> dict[tuple[int, str], Counter[str]]:
    """What became of the intervals, by condition and axis."""
    measure, all_scenes = Measure(metric), scenes(load("parallelogram-6bar"))
    true = {key: truth(scene, measure) for key, scene in all_scenes.items()}
    numbers = {(payload, motion): n for n, (payload, _, motion, _) in enumerate(CONDITIONS)}
    found: dict[tuple[int, str], Counter[str]] = {}
    for seed in range(seeds):
        planned = [scene for scene in all_scenes.values() for _ in range(repeats)]
        runs = [scene.recorded(seed, number) for number, scene in enumerate(planned)]
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
