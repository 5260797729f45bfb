"""Coverage of the intervals of ``testbench trim``: simulated campaigns whose missing first moments are known."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from balance.arrays import Floats
from balance.errors import CounterpoiseError
from balance.mechanism.mjcf_parser import load_mechanism
from testbench import rig as rigs
from testbench.rig import Rig
from testbench.simulator.run import simulate_run
from testbench.simulator.sensors import draw_transducers
from testbench.simulator.simulated_logs import MemoryRun, lead_s, record_run, stored
from testbench.trimming import trim_runs

from .laboratories import FAMILIES
from .simulated_runs import (
    BUILT,
    MANIPULATOR,
    Scene,
    aligned,
    disturbed,
    edited_rig,
    planned_run,
    scene,
)
from .table import Row, covered

Source = Literal["wrench", "torque", "vibration", "trials"]
MISSING = 0.0308090
"""On each arm of the manipulator with 3.4116 kg and the built 17.1105 kg [kg m]."""
MOTIONS = ("x", "y", "triangle")
BENCHES = {
    "shipped": rigs.load_rig(MANIPULATOR),
    "other": edited_rig({  # a lighter frame, on mounts that are stiffer sideways and softer upright, less damped
        'mass = "150 kg"': 'mass = "90 kg"',
        '"250 kN/m", "400 kN/m"': '"500 kN/m", "150 kN/m"',
        '"400 N s/m"': '"250 N s/m"',
        '"18 kg m^2"': '"9 kg m^2"',
    }),
    "deep": rigs.load_rig("parallelogram-6bar-deep"),
}  # fmt: skip
SHARE = 0.02
"""Of a channel's standard deviation: the residual whose share noise is."""
SOURCES: tuple[Source, ...] = ("wrench", "torque", "vibration", "trials")
CASES: tuple[tuple[Source, str, str], ...] = (
    *((source, bench, "white") for source in SOURCES for bench in ("shipped", "other")),
    ("wrench", "deep", "white"),
    *((source, "shipped", noise) for source in SOURCES for noise in ("floor", "hum", "drift", "all mixed")),
)
"""Source, bench and what noise is added to that of the sensors."""
BRIEF: tuple[tuple[Source, str, str], ...] = (
    ("wrench", "shipped", "white"),
    ("torque", "other", "hum"),
    ("trials", "shipped", "floor"),
)


def study(count: int, brief: bool) -> Iterator[Row]:
    """Coverage on the two arms by source and bench; on the deep bench of a hundred campaigns at most."""
    for source, bench, noise in BRIEF if brief else CASES:
        found, refused, doubtful = _trimmed(source, bench, noise, range(min(count, 100) if bench == "deep" else count))
        for arm, (value, low, high) in zip(("first", "second"), np.moveaxis(found, 0, 2), strict=True):
            bias, scatter, width = 1e3 * np.array([(value - MISSING).mean(), value.std(), 0.5 * (high - low).mean()])
            note = f"bias {bias:.2f}, scatter {scatter:.2f}, half width {width:.2f} g m"
            note += f", {refused} refused" * bool(refused) + f", {doubtful} doubtful" * bool(doubtful)
            hits = int(((low <= MISSING) & (high >= MISSING)).sum())
            yield covered(
                f"{source}, {bench} bench, {noise}, {arm} arm", hits, len(value), note, conservative=bench == "deep"
            )


def _trimmed(source: Source, bench: str, noise: str, seeds: range) -> tuple[Floats, int, int]:
    """First moments with their intervals, (campaigns, arms, 3) [kg m]; campaigns refused, and doubtful."""
    mechanism, scenes = load_mechanism(MANIPULATOR), campaign(source, BENCHES[bench])
    found, refused, doubtful = [], 0, 0
    for seed in seeds:
        runs = [one.run(1000 * seed + k) for k, one in enumerate(scenes)]
        if noise != "white":
            runs = [disturbed(run, FAMILIES[noise], SHARE, 1000 * seed + k) for k, run in enumerate(runs)]
        try:
            trim = trim_runs(aligned(runs, mechanism), source=source)
        except CounterpoiseError:
            refused += 1
            continue
        doubtful += trim.verdict == "doubtful"
        found.append([[m.first_moment.value, *m.interval] for m in trim.missing])
    return np.array(found).reshape(-1, 2, 3), refused, doubtful


def campaign(source: Source, rig: Rig) -> Sequence[Scene]:
    """Scenes of a campaign: the triangle by wrench on a bench without errors, else three motions; trial masses on."""
    deep = bool(rig.bench.errors)
    trials = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] if source == "trials" else [(0.0, 0.0)]
    sets = [{site: mass + more for (site, mass), more in zip(BUILT.items(), trial, strict=True)} for trial in trials]
    motions = ("triangle",) if source == "wrench" and not deep else MOTIONS
    made = _deep_scene if deep else lambda motion, masses, rig: scene(motion, masses=masses, rig=rig)
    return [made(motion, masses, rig) for masses in sets for motion in motions]


@dataclass(frozen=True)
class _DeepScene(Scene):
    """A scene whose sensors are drawn anew every 1000 seeds, and whose loggers start at any time."""

    def run(self, seed: int, loggers: Collection[str] | None = None) -> MemoryRun:
        rng = np.random.default_rng([seed, 77])
        started = {
            name: logger.model_copy(update={"start": logger.start - rng.uniform(0.0, 0.1)})
            for name, logger in self.rig.loggers.items()
        }
        rig = self.rig.model_copy(update={"loggers": started})
        made = record_run(rig, self.planned, self.bench, draw_transducers(self.rig, seed // 1000), (seed, 0))
        return stored(made, self.rig, f"seed{seed}.h5")


def _deep_scene(motion: str, masses: dict[str, float], rig: Rig) -> Scene:
    planned = planned_run(motion, masses)
    return _DeepScene(rig, planned, simulate_run(rig, load_mechanism(MANIPULATOR), planned, lead_s(rig) + 0.2), {})
