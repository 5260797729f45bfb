"""Simulated campaigns below the file layer, with known truth: does a 95 % interval hold it 95 times in 100?

As a script the whole study: ``python tests/testbench/amplitudes/benches.py SEEDS REPEATS [BENCH...]``, of one run a
side, two, and so on up to REPEATS. Each seed is a campaign of one condition: the same motion of the same bench, seen
through new noise by the loggers of its rig.
"""

import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from balance.loading.loading import load_mechanism
from balance.quantities import G0
from testbench.amplitudes import Amplitude, Group, Judged, Noise, Ratio, Repeatability, Side
from testbench.bench.loggers import reading
from testbench.bench.run import simulate_run
from testbench.bench.sampling import instants
from testbench.bench.sensors import signals
from testbench.motion.segments import rest_before
from testbench.plan import PlannedRun
from testbench.rig import Rig, load
from testbench.signals import Band
from testbench.vibration import METRICS, Measure

try:
    from ..coverage import Tally
except ImportError:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from coverage import Tally

SHIPPED = load("parallelogram-6bar")


@dataclass(frozen=True)
class Case:
    """A bench and a condition on it."""

    rig: Rig
    payload: float
    counter_mass: float
    motion: str
    acceleration_g: float
    band: Band


def _rig(mechanism: str, edits: dict[str, str]) -> Rig:
    """The shipped rig with other words in it; each word must be there."""
    text = SHIPPED.text.replace('mechanism = "parallelogram-6bar"', f'mechanism = "{mechanism}"')
    for old, new in edits.items():
        assert old in text, old
        text = text.replace(old, new)
    return load(text)


SOFT = {  # softer mounts, a noisy sensor elsewhere that one sees in steps, a slow logger
    'stiffness = ["250 kN/m", "400 kN/m", "250 kN/m"]': 'stiffness = ["90 kN/m", "150 kN/m", "120 kN/m"]',
    'damping = ["400 N s/m", "600 N s/m", "400 N s/m"]': 'damping = ["500 N s/m", "700 N s/m", "600 N s/m"]',
    'noise = "0.002 g" ': 'noise = "0.006 g" ',
    'resolution = "0.0005 g"             # (assumed)\nposition = ["0.20 m", "-0.10 m", "0 m"]': (
        'resolution = "0.005 g"\nposition = ["-0.30 m", "0.25 m", "0.1 m"]'
    ),
    'rate = "5 kHz"\nstart = "-0.237 s"': 'rate = "1 kHz"\nstart = "-0.4 s"',
}
STIFF = {  # stiff mounts, a heavier base, a quiet sensor and a fast logger that starts late
    'stiffness = ["250 kN/m", "400 kN/m", "250 kN/m"]': 'stiffness = ["900 kN/m", "2000 kN/m", "900 kN/m"]',
    'mass = "150 kg"': 'mass = "420 kg"',
    'noise = "0.002 g" ': 'noise = "0.0008 g" ',
    'position = ["0.20 m", "-0.10 m", "0 m"]          # (assumed)\nattached_to = "base"': (
        'position = ["0.35 m", "0.2 m", "-0.1 m"]\nattached_to = "base"'
    ),
    'rate = "5 kHz"\nstart = "-0.237 s"': 'rate = "8 kHz"\nstart = "-0.12 s"',
}
CASES = {
    "shipped-x": Case(SHIPPED, 3.4116, 17.1105, "x", 1.0, Band(0.0, 200.0)),
    "shipped-y": Case(SHIPPED, 3.4116, 17.1105, "y", 1.0, Band(0.0, 200.0)),
    "soft": Case(_rig("parallelogram-6bar", SOFT), 5.0, 24.2626, "x", 1.0, Band(1.0, 100.0)),
    "stiff": Case(_rig("parallelogram-6bar-full", STIFF), 1.451, 9.0, "y", 2.0, Band(0.0, 150.0)),
}


@dataclass(frozen=True)
class Condition:
    """What the logger of the base's accelerometer saw, without noise [SI], by channel; and its rest."""

    case: Case
    seen: dict[str, np.ndarray]

    def draw(self, rng: np.random.Generator) -> dict[str, tuple[np.ndarray, Noise | None]]:
        """One run in noise: each axis of the base, with the noise of its own rest."""
        rig = self.case.rig
        logger = rig.sensors["base_acc"].logger
        rate = rig.loggers[logger].rate
        read = {c: reading(c, self.seen[c.channel], rng) * c.factor for c in rig.columns(logger)}
        still = rest_before(list(read.values()), rate)
        assert still is not None
        return {
            c.component: (values, Noise.of(values[still], rate, c.resolution))
            for c, values in read.items()
            if c.sensor == "base_acc"
        }

    def truth(self, axis: str, measure: Measure) -> float:
        """The amplitude without noise [m/s2]."""
        sensor = self.case.rig.sensors["base_acc"]
        rate = self.case.rig.loggers[sensor.logger].rate
        return measure.of(self.seen[sensor.channels[axis]], rate)


def conditions(case: Case) -> tuple[Condition, Condition]:
    """The runs of a case with counter-masses and without."""
    mechanism = load_mechanism(case.rig.mechanism)
    logger = case.rig.loggers[case.rig.sensors["base_acc"].logger]
    found = []
    for mass in (case.counter_mass, 0.0):
        masses = {"counter_A0A": mass, "counter_B0B": mass} if mass else {}
        run = simulate_run(
            case.rig, mechanism, PlannedRun("r", case.payload, masses, case.motion, case.acceleration_g * G0, 1)
        )
        true = instants(logger, float(run.time[-1]))[1]
        found.append(
            Condition(case, {name: np.interp(true, run.time, s) for name, s in signals(case.rig, run).items()})
        )
    return found[0], found[1]


@dataclass
class RatioTally(Tally):
    """And how many were below noise, or not defined."""

    below: int = 0
    undefined: int = 0

    def add(self, ratio: Ratio, truth: float) -> None:
        """Count one. Where no reduction is defined, nothing is claimed: every truth goes."""
        self.hold(ratio.speaks_for(truth))
        self.undefined += not ratio.defined
        self.below += ratio.defined and ratio.below_noise


def tally(case: Case, seeds: range, repeats: int = 1, axes: str = "xyz") -> dict[tuple[int, str, str], RatioTally]:
    """By runs a side, axis and metric, over campaigns of several seeds; fewer runs a side are the first of more."""
    pair = conditions(case)
    rate = case.rig.loggers[case.rig.sensors["base_acc"].logger].rate
    found: dict[tuple[int, str, str], RatioTally] = {}
    for seed in seeds:
        rng = np.random.default_rng([seed, 77])
        runs = [[condition.draw(rng) for condition in pair] for _ in range(repeats)]
        for axis, metric in product(axes, METRICS):
            measure = Measure(metric, case.band)
            truth = pair[0].truth(axis, measure) / pair[1].truth(axis, measure)
            judged = [[Judged.of(Amplitude(r[axis][0], rate, measure, r[axis][1])) for r in both] for both in runs]
            for count in range(1, repeats + 1):
                found.setdefault((count, axis, metric), RatioTally()).add(ratio(judged[:count]), truth)
    return found


def ratio(judged: list[list[Judged]]) -> Ratio:
    """Of runs with and without counter-masses, (repeats, 2), as those of a campaign of one condition."""
    balanced, unbalanced = (Group(runs) for runs in zip(*judged, strict=True))
    scatter = Repeatability.of([balanced, unbalanced])
    return Ratio(Side(balanced, scatter), Side(unbalanced, scatter))


def main(words: list[str]) -> None:
    """Print the coverage of every place."""
    seeds, repeats = range(int(words[0])), int(words[1])
    for name in words[2:] or CASES:
        for (count, axis, metric), t in tally(CASES[name], seeds, repeats).items():
            print(f"{name:10s} repeats {count} {axis} {metric:12s} {t.held:4d} of {t.count} "  # noqa: T201
                  f"p {t.pvalue:.4f}  below noise {t.below}  undefined {t.undefined}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
