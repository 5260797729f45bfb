"""A rig against the logs: channels that are missing, units that differ, the ranges of the sensors."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from .. import units
from ..findings import Finding
from ..recording import Channel, Recording, SensorRange

if TYPE_CHECKING:
    from ..rig import Column, Rig

_CODE = "rig_contradiction"
_FLAT = {"clipping_suspected", "constant_channel"}


def ranges(rig: "Rig | None") -> dict[str, SensorRange]:
    """The range of each channel that the rig states, in the unit of the log."""
    columns = () if rig is None else rig.columns()
    return {c.channel: SensorRange(c.range / c.factor, c.unit) for c in columns if c.range is not None}


def without_commanded(rig: "Rig | None", recording: Recording, found: Iterable[Finding]) -> list[Finding]:
    """Findings less those of a flat signal in channels that the rig calls commanded: a target may rest and hold."""
    labels = {c.channel for c in (() if rig is None else rig.columns()) if c.commanded}
    names = {c.name for g in recording.groups for c in g.channels if c.label in labels}
    return [f for f in found if not (f.channel in names and f.code in _FLAT)]


def findings(rig: "Rig", recordings: Iterable[Recording]) -> list[Finding]:
    """Where the rig and the logs of one run differ. A logger of which the run holds no channel is not in the run."""
    channels = {c.label: c for r in recordings for g in r.groups for c in g.channels}
    found: list[Finding] = []
    matched = 0
    for logger in rig.loggers:
        columns = list(rig.columns(logger))
        present = [column for column in columns if column.channel in channels]
        matched += len(present)
        if present:
            found += [_missing(column, channels) for column in columns if column.channel not in channels]
        found += [f for column in present for f in _unit(column, channels[column.channel])]
    if not matched:
        message = f"none of the rig's channels is in the log, which holds {_listed(channels)}"
        found.append(Finding(_CODE, None, None, message))
    return found


def _missing(column: "Column", channels: Iterable[str]) -> Finding:
    message = f"the rig names it in sensors.{column.sensor} (logger {column.logger}); the log holds {_listed(channels)}"
    return Finding(_CODE, column.channel, None, message)


def _unit(column: "Column", channel: Channel) -> list[Finding]:
    """The unit that the rig gives a channel against the one that the log writes; a log without units has no say."""
    if channel.unit is None or units.same(channel.unit, column.unit):
        return []
    message = f"sensors.{column.sensor}: unit {column.unit!r} in the rig, {channel.unit!r} in the log"
    return [Finding(_CODE, channel.name, None, message)]


def _listed(channels: Iterable[str]) -> str:
    names = list(channels)
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
