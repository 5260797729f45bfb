"""Simulated runs in memory: the truth, and what each logger made of it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from balance.arrays import Floats
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism

from ..campaign_plan import Plan, PlannedRun
from ..recording import Channel, Samples, TimeColumn, UniformClock
from ..rig import Rig
from ..rig.bench import Logger
from ..rig.rig import mechanism_file
from ..store.run import Run, StoredGroup
from .disturbances import is_disturbed, random_stream
from .loggers import Log, record_log, start_logger
from .run import BenchRun, disturbed, simulate_run
from .sensors import Transducer, draw_transducers, transduced_signals, true_signals

MARGIN_S = 0.3
"""Simulated time before the first logger starts, where there are disturbances or sensor errors [s]."""


@dataclass(frozen=True)
class SimulatedRun:
    """One run: the truth, and the logs."""

    planned: PlannedRun
    bench: BenchRun
    """The truth."""
    loggers: Mapping[str, Logger]
    """With start and drift of this run, by name."""
    logs: Mapping[str, Log]
    """By logger that has channels."""


def simulate_logs(plan: Plan, rig: Rig, seed: int | None = None) -> Iterator[SimulatedRun]:
    """The runs of a plan one after the other, drawn from ``seed`` or the plan's own; nothing is written.

    The same plan, rig and seed give the same runs. Raises RigError where plan or rig cannot be simulated.
    """
    bench = SimulatedBench.of(rig, plan.seed if seed is None else seed)
    yield from map(bench.simulated, enumerate(plan.runs()))


@dataclass(frozen=True)
class SimulatedBench:
    """What all runs of a campaign share."""

    rig: Rig
    mechanism: Mechanism
    sensors: Mapping[str, Transducer]
    """As drawn, by name."""
    seed: int

    @classmethod
    def of(cls, rig: Rig, seed: int) -> "SimulatedBench":
        """The bench that a rig describes, with sensors drawn from a seed."""
        return cls(rig, mechanism_of_rig(rig), draw_transducers(rig, seed), seed)

    def simulated(self, numbered: tuple[int, PlannedRun]) -> SimulatedRun:
        """A run by its number from 0 on in the plan, on which nothing but what is drawn for it depends."""
        number, planned = numbered
        run = simulate_run(self.rig, self.mechanism, planned, lead_s(self.rig))
        return record_run(self.rig, planned, run, self.sensors, (self.seed, number))


def mechanism_of_rig(rig: Rig) -> Mechanism:
    """The mechanism that a rig names: of its folder, or a shipped one."""
    return load_mechanism(mechanism_file(rig.mechanism, rig.folder) or rig.mechanism)


def record_run(
    rig: Rig, planned: PlannedRun, run: BenchRun, sensors: Mapping[str, Transducer], seed: tuple[int, int]
) -> SimulatedRun:
    """Add disturbances, sensors and loggers to a run of ``simulate_run``, which may be recorded any number of times."""
    shaken = disturbed(run, rig, seed)
    signals = transduced_signals(sensors, true_signals(rig, shaken), run.time)
    loggers, logs = {}, {}
    for number, (name, logger) in enumerate(rig.loggers.items()):
        loggers[name] = start_logger(logger, random_stream("start", *seed, name))
        if columns := list(rig.columns(name)):
            logs[name] = record_log(loggers[name], columns, run.time, signals, (*seed, number))
    return SimulatedRun(planned, shaken, loggers, logs)


def lead_s(rig: Rig) -> float:
    """Simulated time before the motion [s]; zero where nothing moves the bench before it."""
    if not is_disturbed(rig.bench) and not rig.bench.errors:
        return 0.0
    earliest = min(logger.start - 4.0 * logger.start_scatter for logger in rig.loggers.values())
    return max(0.0, -earliest) + MARGIN_S


class MemoryRun(Run):
    """A run whose data are in memory, by path."""

    def channels_at(
        self, places: Sequence[tuple[StoredGroup, int]], begin: int = 0, end: int | None = None
    ) -> list[Samples]:
        """Values by group and index, from sample ``begin`` to ``end``."""
        data = self.provenance["data"]
        return [data[f"{group.path}/{group.keys[index]}"][begin:end] for group, index in places]


def stored(made: SimulatedRun, rig: Rig, path: str = "memory.h5") -> MemoryRun:
    """What ingest would have stored of a run's logs, their time columns too."""
    recorded = {name: {"Time": log.time} | written_values(log, rig, name) for name, log in made.logs.items()}
    return memory_run(path, rig, made.planned, recorded)


def written_values(log: Log, rig: Rig, name: str) -> dict[str, Floats]:
    """Values of a logger's channels with the decimals that it writes."""
    return {c.channel: np.round(log.columns[c.channel], rig.loggers[name].decimals) for c in rig.columns(name)}


def memory_run(path: str, rig: Rig, planned: PlannedRun, recorded: Mapping[str, Mapping[str, Floats]]) -> MemoryRun:
    """A run of a plan with these values by logger and channel, as the loggers write them."""
    data: dict[str, Floats] = {}
    groups = []
    for name, columns in recorded.items():
        logger, units = rig.loggers[name], {"Time": "s"} | {c.channel: c.assumed_unit for c in rig.columns(name)}
        data |= {f"{name}/{key}": values for key, values in columns.items()}
        timed = "Time" in columns and logger.clock != "uniform"
        clock = TimeColumn(0) if timed else UniformClock(logger.rate)
        keys, samples = tuple(columns), len(next(iter(columns.values())))
        channels = tuple(Channel(key, units[key]) for key in keys)
        groups.append(StoredGroup(name, channels, clock, None, samples, logger.rate, "declared", None, name, keys))
    return MemoryRun(Path(path), tuple(groups), "simulated", planned.conditions, rig.text, (), {"data": data})
