"""A stored run seen in SI: the channels that its rig names as they are calibrated now, all others as recorded."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from balance.units import SI_UNITS

from ..recording import Channel, Samples
from ..rig import Column
from ..store.run import Run, StoredGroup
from .si_run import SIRun, calibrations_in_force


@dataclass(frozen=True)
class PhysicalRun(Run):
    """A run whose channels are computed on reading; ``provenance["calibrations"]`` says by what."""

    si: SIRun
    columns: Mapping[tuple[str, int], Column]
    """What the rig knows, by group and index of the channel."""

    def channels_at(self, places: Sequence[tuple[StoredGroup, int]]) -> list[Samples]:
        """Values of channels by group and index, (n,) each, in their units here: SI where the rig knows them."""
        return [self._values(group, index) for group, index in places]

    def _values(self, group: StoredGroup, index: int) -> Samples:
        column = self.columns.get((group.name, index))
        if column is None:
            return self.si.recorded.channel_at(group.name, index)
        return np.asarray(self.si.loads(column), dtype=np.float64)


def physical(run: Run) -> PhysicalRun:
    """A run in SI, by the rig that is stored with it. Raises AnalysisError if there is none."""
    if isinstance(run, PhysicalRun):
        return run
    si = SIRun.of(run)
    places = {}
    for column in si.rig.columns():
        if si.holds(column):
            group, index = run.find(column.channel)
            places[group.name, index] = column
    units = {place: SI_UNITS[si.dimension(column)] for place, column in places.items()}
    given = {f.name: getattr(run, f.name) for f in fields(Run)}
    given["groups"] = tuple(_in_si(group, units) for group in run.groups)
    given["provenance"] = {**run.provenance, "calibrations": [one.as_dict() for one in calibrations_in_force([si])]}
    return PhysicalRun(**given, si=si, columns=places)


def _in_si(group: StoredGroup, units: Mapping[tuple[str, int], str]) -> StoredGroup:
    channels = list(group.channels)
    for i, channel in enumerate(channels):
        if (unit := units.get((group.name, i))) is not None:
            channels[i] = Channel(f"{channel.label} ({unit})", unit, channel.label)
    return replace(group, channels=tuple(channels))
