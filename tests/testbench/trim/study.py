"""How often the intervals of trim hold the truth, over many seeds: a script, not a test.

python -m pytest runs a brief version (test_trim.py, test_sources.py). The whole study:

    python tests/testbench/trim/study.py torque --seeds 200 [--bench other|deep]

On the deep bench each seed is a campaign with sensors of its own.
"""

import argparse
import importlib.util
import os
import sys
from pathlib import Path

from balance.loading.loading import load_mechanism

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: more threads cost more than they bring

import numpy as np
from scipy.stats import binomtest

from balance.errors import CounterpoiseError
from testbench import rig as rigs
from testbench.bench.recorded import lead_s, record_run
from testbench.bench.run import simulate_run
from testbench.bench.transducers import draw
from testbench.trim import trim_runs

MISSING = 0.0308090
"""On each arm of the manipulator with 3.4116 kg and the built 17.1105 kg [kg m]."""
MOTIONS = ("x", "y", "triangle")
OTHER = {
    'mass = "150 kg"': 'mass = "90 kg"',
    '"250 kN/m", "400 kN/m"': '"500 kN/m", "150 kN/m"',
    '"400 N s/m"': '"250 N s/m"',
    '"18 kg m^2"': '"9 kg m^2"',
}
"""A lighter frame, on mounts that are stiffer sideways and softer upright, less damped."""


def bench(name: str) -> rigs.Rig:
    """``shipped``, ``other`` or ``deep``."""
    if name == "deep":
        return rigs.load("parallelogram-6bar-deep")
    text = rigs.load("parallelogram-6bar").text
    for old, new in OTHER.items() if name == "other" else ():
        text = text.replace(old, new)
    return rigs.from_text(text)


def campaigns(memory, source: str, rig: rigs.Rig):
    """Scenes of a campaign: a triangle by wrench (on the deep bench three), each motion by the others, thrice with
    trial masses.
    """
    deep = bool(rig.bench.errors)
    more = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] if source == "trials" else [(0.0, 0.0)]
    sets = [{s: m + d for (s, m), d in zip(memory.BUILT.items(), one, strict=True)} for one in more]
    motions = ("triangle",) if source == "wrench" and not deep else MOTIONS
    made = deep_scene if deep else memory.scene
    return [made(memory, motion, masses, rig) if deep else made(motion, masses=masses, rig=rig)
            for masses in sets for motion in motions]  # fmt: skip


def deep_scene(memory, motion: str, masses: dict[str, float], rig: rigs.Rig):
    """A scene whose sensors are drawn anew every 1000 seeds, and whose loggers start when they like."""

    class Deep(memory.Scene):
        def run(self, seed: int):
            drawn = np.random.default_rng([seed, 77])
            loggers = {
                n: one.model_copy(update={"start": one.start - drawn.uniform(0.0, 0.1)})
                for n, one in rig.loggers.items()
            }
            started = rig.model_copy(update={"loggers": loggers})
            made = record_run(started, self.planned, self.bench, draw(rig, seed // 1000), (seed, 0))
            return memory.stored(rig, self.planned, made.logs, f"seed{seed}.h5")

    planned = memory.planned_run(motion, masses)
    run = simulate_run(rig, load_mechanism(memory.MANIPULATOR), planned, lead_s(rig) + 0.2)
    return Deep(rig, planned, run, {})


def main() -> None:
    """Print hits, bias, scatter and width by arm."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("source", choices=["wrench", "torque", "vibration", "trials"])
    asked.add_argument("--seeds", type=int, default=200)
    asked.add_argument("--bench", choices=["shipped", "other", "deep"], default="shipped")
    options = asked.parse_args()
    memory, mechanism = _memory(), load_mechanism("parallelogram-6bar")
    scenes = campaigns(memory, options.source, bench(options.bench))
    found, refused, doubtful = [], 0, 0
    for seed in range(options.seeds):
        runs = [scene.run(1000 * seed + k) for k, scene in enumerate(scenes)]
        try:
            told = trim_runs(runs, mechanism, source=options.source)
        except CounterpoiseError:
            refused += 1
            continue
        doubtful += told.verdict == "doubtful"
        found.append([[m.first_moment, *m.interval] for m in told.missing])
        if seed % 10 == 9 or seed == options.seeds - 1:
            _say(options, np.array(found), f"refused {refused}, doubtful {doubtful}")


def _say(options: argparse.Namespace, found: "np.ndarray", beside: str) -> None:
    value, low, high = np.moveaxis(found, 2, 0)
    hits = ((low <= MISSING) & (high >= MISSING)).sum(axis=0)
    chances = [binomtest(int(h), len(found), 0.95).pvalue for h in hits]
    sys.stdout.write(
        f"{options.source}, {options.bench} bench, {len(found)} seeds: hits {hits}, binomial p "
        f"{[float(f'{p:.2g}') for p in chances]}, bias {(value - MISSING).mean(axis=0).round(5)}, scatter "
        f"{value.std(axis=0).round(5)}, half width {(0.5 * (high - low)).mean(axis=0).round(5)} kg m; {beside}\n"
    )
    sys.stdout.flush()


def _memory():
    """The module of runs in memory beside the tests."""
    where = Path(__file__).parents[1] / "memory.py"
    spec = importlib.util.spec_from_file_location("memory", where)
    module = importlib.util.module_from_spec(spec)
    sys.modules["memory"] = module
    spec.loader.exec_module(module)
    return module


if __name__ == "__main__":
    main()
