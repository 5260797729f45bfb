"""A stored run seen in SI: the channels that its rig names as they are calibrated now, all others as recorded."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from balance.quantities import SI_UNITS

from ..recording import Channel, Samples
from ..store.run import Run, StoredGroup
from . import applied
from .holding import of_runs

if TYPE_CHECKING:
    from ..rig import Column, Rig


@dataclass(frozen=True)
class PhysicalRun(Run):
    """A run whose channels are computed on reading; ``provenance["calibrations"]`` says by what."""

    recorded: Run | None = None
    columns: "Mapping[tuple[str, int], Column]" = field(default_factory=dict)
    """What the rig knows, by group and index of the channel."""

    def channel(self, name: str, group: str | None = None) -> Samples:
        """The values of a channel (n,), in its unit here: SI where the rig knows it."""
        where, i = self.find(name, group)
        return self.channel_at(where.name, i)

    def channel_at(self, group: str, index: int) -> Samples:
        """The values of the channel of this index in its group, (n,)."""
        assert self.recorded is not None
        column = self.columns.get((group, index))
        if column is None:
            return self.recorded.channel_at(group, index)
        return np.asarray(applied.loads(self.recorded, column), dtype=np.float64)


def physical(run: Run, rig: "Rig | None" = None) -> PhysicalRun:
    """A run in SI; the rig is the one stored with it unless given. Raises AnalysisError if there is none."""
    from ..pairing import rig_of

    if isinstance(run, PhysicalRun):
        return run
    known = rig or rig_of(run)
    places = {}
    for column in known.columns():
        if any(group.index(column.channel) is not None for group in run.groups):
            group, index = run.find(column.channel)
            places[group.name, index] = column
    given = {f.name: getattr(run, f.name) for f in fields(Run)}
    held = [holding.as_dict() for holding in of_runs([run], known)]
    units = {place: SI_UNITS[applied.dimension(run, column)] for place, column in places.items()}
    given["groups"] = tuple(_in_si(group, units) for group in run.groups)
    given["provenance"] = {**run.provenance, "calibrations": held}
    return PhysicalRun(**given, recorded=run, columns=places)


def _in_si(group: StoredGroup, units: Mapping[tuple[str, int], str]) -> StoredGroup:
    channels = list(group.channels)
    for i, channel in enumerate(channels):
        if (unit := units.get((group.name, i))) is not None:
            channels[i] = Channel(f"{channel.label} ({unit})", unit, channel.label)
    return replace(group, channels=tuple(channels))
