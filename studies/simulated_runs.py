"""Runs of the simulated bench in memory: what ingest would have stored, without files, for many seeds."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism
from balance.units import G0
from testbench import rig as rigs
from testbench.campaign_plan import PlannedRun
from testbench.recording import Channel, Finding, TimeColumn
from testbench.rig import Rig, rig_from_text
from testbench.rig.sensors import Accelerometer, ForceSensor, Torque, Wrench
from testbench.runs.aligned_run import AlignedRun
from testbench.runs.si_run import SIRun
from testbench.simulator.loggers import record_log
from testbench.simulator.run import BenchRun, simulate_run
from testbench.simulator.sensors import true_signals
from testbench.simulator.simulated_logs import MemoryRun, memory_run, written_values
from testbench.store.run import Run

from .laboratories import Family

MANIPULATOR = "parallelogram-6bar"
BUILT = {"counter_A0A": 17.1105, "counter_B0B": 17.1105}
"""Counter-masses that were built for 3.4116 kg [kg]: they leave 0.03081 kg m on each arm."""


@dataclass(frozen=True)
class Scene:
    """A run of the bench without noise, recorded as often as wanted."""

    rig: Rig
    planned: PlannedRun
    bench: BenchRun
    seen: dict[str, np.ndarray]

    def starts(self, seed: int) -> dict[str, dict[str, float]]:
        """Start [s] and drift [ppm] of each logger, drawn anew for each seed."""
        rng = np.random.default_rng([seed, 77])
        return {n: {"start": -rng.uniform(0.1, 0.3), "drift_ppm": rng.uniform(-50, 50)} for n in self.rig.loggers}

    def run(self, seed: int, loggers: Collection[str] | None = None) -> MemoryRun:
        """One recording, clocks and noise of this seed, by all loggers or those named."""
        recorded = {}
        for number, (name, logger) in enumerate(self.rig.loggers.items()):
            columns = list(self.rig.columns(name))
            if columns and (loggers is None or name in loggers):
                drawn = logger.model_copy(update=self.starts(seed)[name])
                log = record_log(drawn, columns, self.bench.time, self.seen, (seed, number))
                recorded[name] = written_values(log, self.rig, name)
        return memory_run(f"seed{seed}.h5", self.rig, self.planned, recorded)


def edited_rig(edits: Mapping[str, str], name: str = MANIPULATOR) -> Rig:
    """A shipped rig with other words in its text; each word must be there."""
    text = rigs.load_rig(name).text
    for old, new in edits.items():
        assert old in text, old
        text = text.replace(old, new)
    return rigs.rig_from_text(text)


def planned_run(
    motion: str, masses: Mapping[str, float] = BUILT, acceleration_g: float = 3.0, payload: float = 3.4116
) -> PlannedRun:
    """A run of the manipulator."""
    return PlannedRun("memory", payload, dict(masses), motion, acceleration_g * G0, 1)


def scene(
    motion: str,
    acceleration_g: float = 3.0,
    masses: Mapping[str, float] = BUILT,
    payload: float = 3.4116,
    rig: Rig | None = None,
) -> Scene:
    """The manipulator on its bench."""
    rig = rig or rigs.load_rig(MANIPULATOR)
    planned = planned_run(motion, masses, acceleration_g, payload)
    bench = simulate_run(rig, load_mechanism(MANIPULATOR), planned)
    return Scene(rig, planned, bench, true_signals(rig, bench))


def aligned(runs: Sequence[Run], mechanism: Mechanism, rig: Rig | None = None) -> list[AlignedRun]:
    """The runs with their mechanism; their rigs are those stored with them unless given."""
    return [AlignedRun(SIRun.of(run, rig), mechanism) for run in runs]


def with_values(run: MemoryRun, channel: str, values: np.ndarray) -> MemoryRun:
    """The same run with other values of a channel."""
    group, index = run.find(channel)
    data = {**run.provenance["data"], f"{group.path}/{group.keys[index]}": values}
    return replace(run, provenance={"data": data})


def disturbed(run: MemoryRun, family: Family, share: float, seed: int) -> MemoryRun:
    """The same run with noise of a family in all but the encoders; ``share`` of a channel is the residual for it.

    Steps of a family are those of the readings.
    """
    rng, rig = np.random.default_rng([seed, 1313]), rig_from_text(run.rig or "")
    for column in (c for kind in (Accelerometer, Wrench, ForceSensor, Torque) for c in rig.columns_of(kind)):
        group, index = run.find(column.channel)
        values = run.channels_at([(group, index)])[0]
        size, time = share * float(np.std(values)), np.arange(len(values)) / rig.loggers[group.name].rate
        noisy = values + family.law(rng, size)(rng, time, np.ones(len(values)))
        step = size * rng.uniform(*family.steps)
        run = with_values(run, column.channel, np.round(noisy / step) * step if step else noisy)
    return run


def without(run: MemoryRun, name: str, begin: float, end: float) -> MemoryRun:
    """The same run whose group ``name`` lacks the samples from one instant to another of its clock [s]."""
    time = run.time(name)
    kept = (time < begin) | (time >= end)
    gap = Finding("time_gap", "Time", None, f"a gap from {begin:g} to {end:g} s")
    return replace(_timed(run, name, time, kept), findings=(*run.findings, gap))


def started_at(run: MemoryRun, seconds: float) -> MemoryRun:
    """The same run by clocks that read so much more [s]."""
    for group in run.groups:
        run = _timed(run, group.name, run.time(group.name) + seconds, np.ones(group.samples, dtype=bool))
    return run


def _timed(run: MemoryRun, name: str, time: np.ndarray, kept: np.ndarray) -> MemoryRun:
    """The same run with instants [s] as a column of a group, and of it the samples that are kept."""
    group = run.group(name)
    data = dict(run.provenance["data"])
    for key in group.keys:
        data[f"{group.path}/{key}"] = data[f"{group.path}/{key}"][kept]
    data[f"{group.path}/Time"] = time[kept]
    channels, keys = (Channel("Time", "s"), *group.channels), ("Time", *group.keys)
    cut = replace(group, channels=channels, keys=keys, clock=TimeColumn(0), samples=int(kept.sum()))
    groups = tuple(cut if one.name == name else one for one in run.groups)
    return replace(run, groups=groups, provenance={"data": data})
