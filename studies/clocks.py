"""Coverage of the intervals of ``testbench align``: simulated benches whose clocks are known.

Each seed is a campaign: its own sensors, clocks and noise, encoders mounted anywhere within a step, floor and drives
where the rig has them, on the same motion of the same bench.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from balance.mechanism.mjcf_parser import load_mechanism
from balance.units import G0
from testbench.campaign_plan import PlannedRun
from testbench.kinematics.encoder_motion import loaded_mechanism
from testbench.rig import Rig, load_rig
from testbench.rig.sensors import Encoder
from testbench.runs.si_run import SIRun
from testbench.simulator.run import BenchRun, simulate_run
from testbench.simulator.sensors import Transducer, draw_transducers
from testbench.simulator.simulated_logs import SimulatedRun, lead_s, record_run, stored
from testbench.synchronization.run_alignment import RunClocks, align_run

from .laboratories import FAMILIES
from .simulated_runs import disturbed, edited_rig
from .table import Row, Tally, covered

DEEP = load_rig("parallelogram-6bar-deep")
REFERENCE = "controller"
NOISES, SHARE = ("floor", "hum", "drift", "all mixed"), 0.05
"""Families of noise, and the residual for them as a share of a channel's standard deviation."""


SOFT = edited_rig({  # other mounts, a coarser and slower accelerometer elsewhere, encoders of 15 bit
    'stiffness = ["250 kN/m", "400 kN/m", "250 kN/m"]': 'stiffness = ["90 kN/m", "150 kN/m", "120 kN/m"]',
    'position = ["0.20 m", "-0.10 m", "0 m"]': 'position = ["-0.30 m", "0.25 m", "0.1 m"]',
    'noise = "0.010 g"': 'noise = "0.020 g"',
    'rate = "5 kHz"': 'rate = "2 kHz"',
    'resolution = "4.8e-5 rad"': 'resolution = "1.9e-4 rad"',
})  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A condition on a bench, and how its clocks are aligned."""

    rig: Rig
    payload: float
    counter_mass: float
    motion: str
    acceleration_g: float
    drift: bool = False
    noise: str = ""
    """Family of noise that is added to all but the encoders."""

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
        return record_run(rig, self.planned, self.bench, draw_transducers(self.rig, seed) | self._steps(rng), (seed, 0))

    def _steps(self, rng: np.random.Generator) -> dict[str, Transducer]:
        """Encoders with their zero anywhere within a step, as encoders are mounted."""
        found = {}
        for name, sensor in self.rig.of_kind(Encoder).items():
            step = 0.0 if sensor.resolution is None else sensor.resolution.value
            zero = step * rng.uniform(-0.5, 0.5, 1)
            found[name] = Transducer((sensor.channel,), np.eye(1), zero, np.zeros(1), None)
        return found


CASES = {
    "plain-x": Case(load_rig("parallelogram-6bar"), 3.4116, 17.1105, "x", 3.0),
    "plain-y": Case(load_rig("parallelogram-6bar"), 3.4116, 17.1105, "y", 3.0),
    "soft-x": Case(SOFT, 5.0, 24.2626, "x", 2.0),
    "deep-x": Case(DEEP, 5.0, 24.2626, "x", 3.0),
    "deep-y": Case(DEEP, 5.0, 24.2626, "y", 3.0),
    "deep-x-without": Case(DEEP, 5.0, 0.0, "x", 3.0),
    "deep-y-without": Case(DEEP, 5.0, 0.0, "y", 3.0, drift=True),
}
for name in ("plain-x", "soft-x"):
    CASES |= {f"{name}, {noise}": replace(CASES[name], noise=noise) for noise in NOISES}


def aligned(case: Case, made: SimulatedRun, seed: int = 0) -> RunClocks:
    """The clocks as ``testbench align`` finds them; ``seed`` is that of the case's noise."""
    run = stored(made, case.rig)
    if case.noise:
        run = disturbed(run, FAMILIES[case.noise], SHARE, seed)
    si = SIRun.of(run, case.rig)
    return align_run(si, lambda: loaded_mechanism(si, load_mechanism(case.rig.mechanism)), drift=case.drift)


def truth(made: SimulatedRun, group: str, own: float) -> float:
    """An own instant's true time on the reference's clock [s]."""
    logger, reference = made.loggers[group], made.loggers[REFERENCE]
    happened = logger.start + own / (1.0 + 1e-6 * logger.drift_ppm)
    return (happened - reference.start) * (1.0 + 1e-6 * reference.drift_ppm)


@dataclass
class ClockTally(Tally):
    """And how far off the worst was, and how many clocks were refused."""

    refused: int = 0
    worst: float = 0.0
    """[s]"""


def tally(case: Case, seeds: range) -> dict[str, ClockTally]:
    """Of every logger, an interval a seed at the middle of what it and the reference both saw."""
    found = {name: ClockTally() for name in case.rig.loggers if name != REFERENCE}
    for seed in seeds:
        made = case.recorded(seed)
        clocks = aligned(case, made, seed)
        for group, sums in found.items():
            if group in clocks.refused:
                sums.refused += 1
                continue
            clock = clocks.map_of(group)
            late = abs(clock.at_reference - truth(made, group, clock.at_own))
            sums.add(late <= clock.half_width(clock.at_own))
            sums.worst = max(sums.worst, late)
    return found


def study(count: int, brief: bool) -> Iterator[Row]:
    """Coverage of every logger's offset in every case; briefly in two cases."""
    for name in ("plain-x", "deep-y") if brief else CASES:
        for group, t in tally(CASES[name], range(count)).items():
            note = f"worst {1e3 * t.worst:.3f} ms" + (f", {t.refused} refused" if t.refused else "")
            yield covered(f"{name}, {group}", t.hits, t.count, note)
