"""Instants of one logger's clock on that of another of the run, where that takes no search: by the recorded alignment,
else by a trigger that both recorded.
"""

from typing import NamedTuple

import numpy as np

from balance.arrays import Floats
from balance.errors import CounterpoiseError

from ..rig.sensors import Trigger
from ..runs.si_run import SIRun
from .clock_map import ClockMap, same_clock
from .common_signals import named_channels
from .event_alignment import by_trigger
from .offset_and_drift import AlignedClock
from .run_alignment import reference_group, stored_clock_maps


def on_clock_of(run: SIRun, instants: Floats, source: str, group: str) -> tuple[Floats, float] | None:
    """Instants (n,) [s] of the clock of the group ``source`` on that of another, (n,) [s], and the largest half of
    their 95 % intervals [s]; None where nothing relates the two.
    """
    if source == group:
        return instants, 0.0
    maps = stored_clock_maps(run.path) if run.path.parent.is_dir() else {}
    if {source, group} <= maps.keys():
        there, here = maps[source], maps[group]
        own = here.to_own(there.to_reference(instants))
        return own, float(np.hypot(_half_width(there, instants), _half_width(here, own)))
    edges = [one.clock for one in trigger_clocks(run, source, group)[0]]
    by_edges = [(own := one.to_own(instants), _half_width(one, own)) for one in edges]
    return min(by_edges, key=lambda one: one[1], default=None)


class KnownClocks(NamedTuple):
    """The clocks of a run's groups, as far as a record or a trigger relates them."""

    maps: dict[str, ClockMap]
    """Onto the clock of one of the groups, itself included; empty where nothing relates any two of them."""
    by_trigger: tuple[AlignedClock, ...]
    """Those that a trigger told."""
    refused: tuple[str, ...]
    """Why a trigger that the rig names told no more."""


def related_clocks(run: SIRun) -> KnownClocks:
    """The clocks of a run's groups onto that of one of them: as recorded, else by a trigger that the rig names."""
    maps = stored_clock_maps(run.path) if run.path.parent.is_dir() else {}
    reference = next((name for name, one in maps.items() if not one.covariance.any()), reference_group(run))
    told: list[AlignedClock] = []
    refused: list[str] = []
    timed = [one.name for one in run.groups if one.has_time and one.samples]
    for group in timed if reference in timed else []:
        if group in {reference, *maps}:
            continue
        found, why = clock_by_trigger(run, reference, group)
        if found is not None:
            told.append(found)
            maps |= {reference: same_clock((0.0, 0.0)), group: found.clock}
        elif why:
            refused.append(why)
    return KnownClocks(maps, tuple(told), tuple(dict.fromkeys(refused)))


def clock_by_trigger(run: SIRun, reference: str, own: str) -> tuple[AlignedClock | None, str]:
    """The clock of the group ``own`` onto ``reference`` by a trigger, with a drift or without, whichever is surer over
    the record of ``own``; where there is none, why a trigger that the rig names tells nothing, else nothing.
    """
    found, why = trigger_clocks(run, reference, own)
    return min(found, key=lambda one: within(run, own, one.clock), default=None), why


def within(run: SIRun, group: str, clock: ClockMap) -> float:
    """Largest half of a 95 % interval of a group's clock over its record [s]."""
    return _half_width(clock, run.time(group)[[0, -1]])


def _half_width(clock: ClockMap, own: Floats) -> float:
    return max(clock.half_width(float(at)) for at in own)


def trigger_clocks(run: SIRun, reference: str, own: str) -> tuple[list[AlignedClock], str]:
    """Of the group ``own`` onto ``reference``, without a drift and with one, and why there are not both.

    Nothing, and no reason, where the rig names no trigger in these groups.
    """
    triggers = run.rig.columns_of(Trigger)
    recorded = [next((c.channel for c in triggers if run.holds(c, group)), None) for group in (reference, own)]
    if recorded[0] is None or recorded[1] is None:
        pairs = zip((reference, own), recorded, strict=True)
        lacking = [group for group, channel in pairs if channel is None]
        return [], "" if len(lacking) == 2 else f"the rig names a trigger, but no channel of it that {lacking[0]} holds"
    found: list[AlignedClock] = []
    why = ""
    try:
        shared = named_channels(run.recorded, recorded[0], recorded[1])
        for drift in (False, True):  # one edge tells no drift
            one = by_trigger(shared, drift)
            if one.findings:
                why = f"{shared.name}: {'; '.join(one.findings)}"
            else:
                found.append(one)
    except CounterpoiseError as error:
        why = str(error)
    return found, why
