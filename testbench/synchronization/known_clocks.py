"""Instants of one logger's clock on that of another of the run, where that takes no search: by the recorded alignment,
else by a trigger that both recorded.
"""

from contextlib import suppress

import numpy as np

from balance.arrays import Floats
from balance.errors import CounterpoiseError

from ..rig.sensors import Trigger
from ..runs.si_run import SIRun
from .clock_map import ClockMap
from .common_signals import named_channels
from .event_alignment import by_trigger
from .run_alignment import stored_clock_maps


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
    by_edges = [(own := one.to_own(instants), _half_width(one, own)) for one in _by_trigger(run, source, group)]
    return min(by_edges, key=lambda one: one[1], default=None)


def _half_width(clock: ClockMap, own: Floats) -> float:
    return max(clock.half_width(float(at)) for at in own)


def _by_trigger(run: SIRun, reference: str, own: str) -> list[ClockMap]:
    """Of the group ``own`` onto ``reference``, without a drift and with one; none where no trigger tells it."""
    triggers = [column for column in run.rig.columns_of(Trigger) if run.holds(column)]
    recorded = [next((c.channel for c in triggers if run.holds(c, group)), None) for group in (reference, own)]
    found: list[ClockMap] = []
    if recorded[0] and recorded[1]:
        with suppress(CounterpoiseError):  # one edge tells no drift
            shared = named_channels(run.recorded, recorded[0], recorded[1])
            for drift in (False, True):
                one = by_trigger(shared, drift)
                found += [] if one.findings else [one.clock]
    return found
