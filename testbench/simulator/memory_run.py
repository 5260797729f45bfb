"""A simulated run as ingest would have stored it, in memory: for what a run would show, without files."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from balance.arrays import Floats

from ..campaign_plan import PlannedRun
from ..recording import Channel, Samples, TimeColumn, UniformClock
from ..rig import Rig
from ..store.run import Run, StoredGroup
from .loggers import Log
from .simulated_logs import SimulatedRun


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
        logger, units = rig.loggers[name], {"Time": "s"} | {c.channel: c.unit for c in rig.columns(name)}
        data |= {f"{name}/{key}": values for key, values in columns.items()}
        timed = "Time" in columns and logger.clock != "uniform"
        clock = TimeColumn(0) if timed else UniformClock(logger.rate)
        keys, samples = tuple(columns), len(next(iter(columns.values())))
        channels = tuple(Channel(key, units[key]) for key in keys)
        groups.append(StoredGroup(name, channels, clock, None, samples, logger.rate, "declared", None, name, keys))
    return MemoryRun(Path(path), tuple(groups), "simulated", planned.conditions, rig.text, (), {"data": data})
