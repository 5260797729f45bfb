"""Instants of one logger's clock on that of another of the run, where that takes no search: by the recorded alignment
or by a trigger that both recorded, whichever is surer, through the clocks of further loggers too.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

from balance.arrays import Floats
from balance.errors import CounterpoiseError
from balance.mechanism.mechanism import Mechanism

from ..runs.si_run import SIRun
from .clock_map import ClockMap, same_clock
from .common_signals import common_triggers, named_channels, signal_pairs, trigger_groups, trigger_pairs
from .event_alignment import METHODS, by_trigger
from .offset_and_drift import AlignedClock
from .run_alignment import RunClocks, align_run, reference_group, stored_clock_maps


def on_clock_of(run: SIRun, instants: Floats, source: str, group: str) -> tuple[tuple[Floats, float] | None, str]:
    """Instants (n,) [s] of the clock of the group ``source`` on that of another, (n,) [s], and the largest half of
    their 95 % intervals [s], with what relates the two; where nothing does, None, and why a trigger that the rig names
    does not.
    """
    if source == group:
        return (instants, 0.0), ""
    known = related_clocks(run, group)
    if (clock := known.maps.get(source)) is None:
        return None, "; ".join(known.refused)
    return (clock.to_reference(instants), _half_width(clock, instants)), known.how


class KnownClocks(NamedTuple):
    """The clocks of a run's groups, as far as a record or a trigger relates them."""

    maps: dict[str, ClockMap]
    """Onto the clock of one of the groups, itself included; empty where nothing relates any other to it."""
    by_trigger: dict[str, AlignedClock]
    """Those that a trigger told, onto that clock or onto one that is related to it, by group."""
    refused: tuple[str, ...]
    """Why a trigger that the rig names told no more."""

    @property
    def how(self) -> str:
        """What relates them, in words."""
        recorded = ["recorded alignments"] * (not self.by_trigger or len(self.maps) > 1 + len(self.by_trigger))
        edges = "; ".join(dict.fromkeys(one.content for one in self.by_trigger.values()))
        return ", ".join([*recorded, *[f"the trigger that the rig names ({edges})"] * bool(edges)])


def related_clocks(
    run: SIRun, reference: str | None = None, recorded: Mapping[str, ClockMap] | None = None
) -> KnownClocks:
    """The clocks of a run's groups onto that of ``reference``, or of the reference of the newest record.

    By records and triggers, in the order of the half widths over their groups' records: each by the surest way through
    those before it. Half widths over other records need not grow along a way: one through a later clock is not looked
    for. ``recorded`` are maps onto the reference to take for those of the newest record.
    """
    hub = reference or reference_group(run)
    if recorded is None:
        recorded = stored_clock_maps(run.path) if run.path.parent.is_dir() else {}
        hub = next((name for name, one in recorded.items() if not one.covariance.any()), hub)
    reference, recorded = reference or hub, {**recorded, hub: same_clock((0.0, 0.0))}
    timed = {one.name for one in run.groups if one.has_time and one.samples}
    maps: dict[str, ClockMap] = {}
    told: dict[str, AlignedClock] = {}
    refused: list[str] = []
    offered: dict[str, tuple[ClockMap, AlignedClock | None]] = {}
    if reference in timed:
        offered[reference] = same_clock((0.0, 0.0)), None
    while offered:
        through = min(offered, key=lambda name: within(run, name, offered[name][0]))
        maps[through], edges = offered.pop(through)
        told |= {} if edges is None else {through: edges}
        for group in sorted(timed - maps.keys()):
            edges, why = clock_by_trigger(run, through, group)
            refused += [why] if why else []
            ways: list[tuple[ClockMap, AlignedClock | None]] = []
            if edges is not None:
                ways.append((edges.clock.then(maps[through]), edges))
            if {group, through} <= recorded.keys():
                ways.append((recorded[group].then(recorded[through].inverse).then(maps[through]), None))
            ways += [offered[group]] if group in offered else []
            if ways:
                offered[group] = min(ways, key=lambda way: within(run, group, way[0]))
    return KnownClocks(maps if len(maps) > 1 else {}, told, tuple(dict.fromkeys(refused)))


def align_by(
    by: str,
    run: SIRun,
    mechanism: Callable[[], Mechanism],
    reference: str | None = None,
    drift: bool = True,
    cutoff: float | None = None,
) -> RunClocks:
    """All clocks of a run by one of METHODS (see :func:`align_run`); those that no correlation tells by a trigger that
    its rig names, or why not by it.
    """
    pairs = trigger_pairs if by == "trigger" else signal_pairs
    found = align_run(run, mechanism, reference, drift, cutoff, METHODS[by], pairs=pairs)
    aligned, refused = dict(found.aligned), dict(found.refused)
    for group in found.refused if by == "correlation" else ():
        edges, why = clock_by_trigger(run, found.reference, group, drift)
        if edges is not None:
            aligned[group] = edges
            del refused[group]
        elif why:
            refused[group] += f"; nor by the trigger that the rig names: {why}"
    return replace(found, aligned=aligned, refused=refused)


def clock_by_trigger(run: SIRun, reference: str, own: str, drift: bool = True) -> tuple[AlignedClock | None, str]:
    """The clock of the group ``own`` onto ``reference`` by a trigger, of any line, with a ``drift`` or without,
    whichever is surer over the record of ``own``; where there is none, why a trigger that the rig names tells nothing,
    if any.
    """
    if {reference, own}.isdisjoint(trigger_groups([run])):
        return None, ""
    found, why = list[AlignedClock](), ""
    try:
        for there, here in common_triggers(run, reference, own):
            shared = named_channels(run.recorded, there, here)
            for sloping in (False, True)[: 1 + drift]:  # one edge tells no drift
                one = by_trigger(shared, sloping)
                why = "; ".join([f"{shared.name}: {text}" for text in one.findings])
                found += [] if one.findings else [one]
    except CounterpoiseError as error:
        why = str(error)
    return min(found, key=lambda one: within(run, own, one.clock), default=None), "" if found else why


def within(run: SIRun, group: str, clock: ClockMap) -> float:
    """Largest half of a 95 % interval of a group's clock over its record [s]."""
    return _half_width(clock, run.time(group)[[0, -1]])


def _half_width(clock: ClockMap, own: Floats) -> float:
    return max(clock.half_width(float(at)) for at in own)
