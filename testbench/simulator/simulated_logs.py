"""Simulated runs in memory: what happened, and what each logger made of it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from balance.mechanism.mjcf_parser import load_mechanism

from ..campaign_plan import Plan, PlannedRun
from ..rig import Rig
from ..rig.bench import Logger
from .disturbances import is_disturbed, random_stream
from .loggers import Log, record, started
from .run import BenchRun, disturbed, simulate_run
from .sensors import Transducer, draw_transducer, sensor_reading, signals

MARGIN_S = 0.3
"""How long the bench is simulated before the first logger starts, where something shakes it or wanders [s]."""


@dataclass(frozen=True)
class SimulatedRun:
    """One run: the truth, and the logs."""

    planned: PlannedRun
    bench: BenchRun
    """What happened."""
    loggers: Mapping[str, Logger]
    """As they were started, by name."""
    logs: Mapping[str, Log]
    """What those that have channels recorded, by logger."""


def simulate_logs(plan: Plan, rig: Rig, seed: int | None = None) -> Iterator[SimulatedRun]:
    """The runs of a plan one after the other, drawn from ``seed`` or the plan's own; nothing is written.

    The same plan, rig and seed give the same runs. Raises RigError where plan or rig cannot be simulated.
    """
    seed = plan.seed if seed is None else seed
    mechanism, sensors = load_mechanism(rig.mechanism), draw_transducer(rig, seed)
    for number, planned in enumerate(plan.runs()):
        run = simulate_run(rig, mechanism, planned, lead_s(rig))
        yield record_run(rig, planned, run, sensors, (seed, number))


def record_run(
    rig: Rig, planned: PlannedRun, run: BenchRun, sensors: Mapping[str, Transducer], seed: tuple[int, int]
) -> SimulatedRun:
    """What chance and the loggers add to a run of ``simulate_run``, which may be recorded as often as wanted."""
    happened = disturbed(run, rig, seed)
    seen = sensor_reading(sensors, signals(rig, happened), run.time)
    loggers, logs = {}, {}
    for number, (name, logger) in enumerate(rig.loggers.items()):
        loggers[name] = started(logger, random_stream("start", *seed, name))
        if columns := list(rig.columns(name)):
            logs[name] = record(loggers[name], columns, run.time, seen, (*seed, number))
    return SimulatedRun(planned, happened, loggers, logs)


def lead_s(rig: Rig) -> float:
    """How long before the motion the simulation begins [s]: not at all where the bench rests until then."""
    if not is_disturbed(rig.bench) and not rig.bench.errors:
        return 0.0
    earliest = min(logger.start - 4.0 * logger.start_scatter for logger in rig.loggers.values())
    return max(0.0, -earliest) + MARGIN_S
