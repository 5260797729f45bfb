"""Clocks of simulated benches with known truth: does a 95 % interval hold an instant's true time 95 times in 100?

As a script the whole study: ``python tests/testbench/clocks/benches.py SEEDS [CASE...]``. Each seed is a campaign: its
own sensors, clocks and noise, encoders mounted anywhere within a step, floor and drives where the rig has them, on the
same motion of the same bench.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from balance.loading.loading import load_mechanism
from balance.quantities import G0
from testbench.bench.recorded import SimulatedRun, lead_s, record_run
from testbench.bench.run import BenchRun, simulate_run
from testbench.bench.transducers import Transducer, draw
from testbench.clocks.mapping import ClockMap
from testbench.clocks.run import RunClocks, align_run
from testbench.motion.joint_motion import loaded
from testbench.plan import PlannedRun
from testbench.recording import Channel, TimeColumn, UniformClock
from testbench.rig import Rig, load
from testbench.rig import from_text as load_text
from testbench.rig.sensors import Encoder
from testbench.runs.si_run import SIRun
from testbench.store.run import Run, StoredGroup

try:
    from ..coverage import Tally
except ImportError:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from coverage import Tally

DEEP = load("parallelogram-6bar-deep")
REFERENCE = "controller"


def _soft() -> Rig:
    """Other mounts, a coarser and slower accelerometer elsewhere, encoders of 15 bit."""
    text = load("parallelogram-6bar").text
    for old, new in {
        'stiffness = ["250 kN/m", "400 kN/m", "250 kN/m"]': 'stiffness = ["90 kN/m", "150 kN/m", "120 kN/m"]',
        'position = ["0.20 m", "-0.10 m", "0 m"]': 'position = ["-0.30 m", "0.25 m", "0.1 m"]',
        'noise = "0.010 g"': 'noise = "0.020 g"',
        'rate = "5 kHz"': 'rate = "2 kHz"',
        'resolution = "4.8e-5 rad"': 'resolution = "1.9e-4 rad"',
    }.items():
        assert old in text, old
        text = text.replace(old, new)
    return load_text(text)


class MemoryRun(Run):
    """A run whose data are in memory, by path."""

    def channels_at(self, places: Sequence[tuple[StoredGroup, int]]) -> list[np.ndarray]:
        """Values by group and index."""
        return [self.provenance["data"][f"{group.path}/{group.keys[index]}"] for group, index in places]


@dataclass(frozen=True)
class Case:
    """A condition on a bench, and how its clocks are aligned."""

    rig: Rig
    payload: float
    counter_mass: float
    motion: str
    acceleration_g: float
    drift: bool = False

    @property
    def planned(self) -> PlannedRun:
        """The run."""
        on = {site: self.counter_mass for site in ("counter_A0A", "counter_B0B") if self.counter_mass}
        return PlannedRun("memory", self.payload, on, self.motion, self.acceleration_g * G0, 1)

    @cached_property
    def bench(self) -> BenchRun:
        """What happens, but for chance."""
        return simulate_run(self.rig, load_mechanism(self.rig.mechanism), self.planned, lead_s(self.rig) + 0.2)

    def recorded(self, seed: int) -> SimulatedRun:
        """One run of a campaign of its own; loggers start when they like, else encoders' steps would repeat."""
        rng = np.random.default_rng([seed, 77])
        loggers = {
            name: logger.model_copy(
                update={"start": logger.start - rng.uniform(0.0, 0.1), "drift_ppm": rng.uniform(-50, 50)}
            )
            for name, logger in self.rig.loggers.items()
        }
        rig = self.rig.model_copy(update={"loggers": loggers})
        return record_run(rig, self.planned, self.bench, draw(self.rig, seed) | self._steps(rng), (seed, 0))

    def _steps(self, rng: np.random.Generator) -> dict[str, Transducer]:
        """Encoders with their zero anywhere within a step, as encoders are mounted."""
        found = {}
        for name, sensor in self.rig.of_kind(Encoder).items():
            zero = (sensor.resolution or 0.0) * rng.uniform(-0.5, 0.5, 1)
            found[name] = Transducer((sensor.channel,), np.eye(1), zero, np.zeros(1), None)
        return found


CASES = {
    "plain-x": Case(load("parallelogram-6bar"), 3.4116, 17.1105, "x", 3.0),
    "plain-y": Case(load("parallelogram-6bar"), 3.4116, 17.1105, "y", 3.0),
    "soft-x": Case(_soft(), 5.0, 24.2626, "x", 2.0),
    "deep-x": Case(DEEP, 5.0, 24.2626, "x", 3.0),
    "deep-y": Case(DEEP, 5.0, 24.2626, "y", 3.0),
    "deep-x-without": Case(DEEP, 5.0, 0.0, "x", 3.0),
    "deep-y-without": Case(DEEP, 5.0, 0.0, "y", 3.0, drift=True),
}


def stored(made: SimulatedRun, rig: Rig) -> MemoryRun:
    """What ingest would have stored of a run's logs."""
    data: dict[str, np.ndarray] = {}
    groups = []
    for name, log in made.logs.items():
        logger, columns = rig.loggers[name], {c.channel: c.unit for c in rig.columns(name)}
        data |= {f"{name}/{c}": np.round(log.columns[c], logger.decimals) for c in columns}
        data[f"{name}/Time"] = log.time
        clock = UniformClock(logger.rate) if logger.clock == "uniform" else TimeColumn(0)
        keys = ("Time", *columns)
        channels = (Channel("Time", "s"), *(Channel(c, unit) for c, unit in columns.items()))
        groups.append(StoredGroup(name, channels, clock, len(log.time), logger.rate, "declared", name, keys))
    conditions = made.planned.conditions
    return MemoryRun(Path("memory.h5"), tuple(groups), "simulated", conditions, rig.text, (), {"data": data})


def aligned(case: Case, made: SimulatedRun) -> RunClocks:
    """The clocks as ``testbench align`` finds them."""
    run = stored(made, case.rig)
    return align_run(SIRun.of(run, case.rig), lambda: loaded(run, load_mechanism(case.rig.mechanism)), drift=case.drift)


def truth(made: SimulatedRun, group: str, own: float) -> float:
    """An own instant's true time on the reference's clock [s]."""
    logger, reference = made.loggers[group], made.loggers[REFERENCE]
    happened = logger.start + own / (1.0 + 1e-6 * logger.drift_ppm)
    return (happened - reference.start) * (1.0 + 1e-6 * reference.drift_ppm)


@dataclass
class ClockTally(Tally):
    """And how far off the worst was."""

    refused: int = 0
    worst: float = 0.0
    """[s]"""

    def add(self, clock: ClockMap, late: float) -> None:
        """Count an interval at the middle of what both saw."""
        self.hold(abs(late) <= clock.half_width(clock.at_own))
        self.worst = max(self.worst, abs(late))


def tally(case: Case, seeds: range) -> dict[str, ClockTally]:
    """Of every logger over campaigns of several seeds."""
    found = {name: ClockTally() for name in case.rig.loggers if name != REFERENCE}
    for seed in seeds:
        made = case.recorded(seed)
        clocks = aligned(case, made)
        for group, sums in found.items():
            if group in clocks.refused:
                sums.refused += 1
                continue
            clock = clocks.map_of(group)
            sums.add(clock, clock.at_reference - truth(made, group, clock.at_own))
    return found


def main(words: list[str]) -> None:
    """Print the coverage of every logger."""
    for name in words[1:] or CASES:
        for group, t in tally(CASES[name], range(int(words[0]))).items():
            print(f"{name:15s} {group:7s} {t.held:4d} of {t.count}  p {t.pvalue:.4f}  refused {t.refused}  "  # noqa: T201
                  f"worst {1e3 * t.worst:.3f} ms", flush=True)  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
