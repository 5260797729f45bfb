"""The channels of several loggers in one table: on one clock, at one rate.

Of a line the last sample is taken: of a trigger of the rig, of two values, of a counter (whole numbers that go up by
one, stay, or begin again at the lowest, but for losses; or down), and where every value stays for some samples and a
step of the table, so that none is lost. What is measured is none of these, or loses no more than the step of its
values.
"""

import json
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.units import si

from ..errors import AnalysisError
from ..rig import Column
from ..store.run import Run, StoredGroup
from ..synchronization.known_clocks import KnownClocks, related_clocks
from ..synchronization.run_alignment import stored_clock_maps
from .si_run import SIRun

if TYPE_CHECKING:
    import pandas

_PASSED = 0.4
"""Share of the new rate up to which frequencies are kept where that rate is below a logger's own."""
_GAP = 2.5
"""Steps between samples from which nothing is interpolated between them."""
_SAME = 1e-3
"""By what share a logger's own rate may be above the new one and counts as the same: clocks drift by less."""
_MOST_ROWS = 1 << 24
"""Of a table, whatever was recorded."""


def joined(run: Run, rate: float | str, channels: Sequence[str] | None = None) -> "pandas.DataFrame":
    """All groups with a time, or these ``channels``, over the time that all their groups recorded, at ``rate`` [Hz].

    Clocks are mapped by the newest recorded alignment or by a trigger that the rig names on both loggers, whichever is
    surer; a warning names those that have neither. Values are interpolated between two samples; faster loggers are low-
    passed first, without phase, those without a rate at that of their median step; of digital lines, counters and
    states the last sample is taken. In gaps there is no value. ``attrs`` has what was done; a warning names what may be
    codes, and was taken for a measurement.
    """
    frame, problem = joined_table(run, rate, channels)
    if problem:
        warnings.warn(problem, stacklevel=3)
    return frame


def joined_table(run: Run, rate: float | str, channels: Sequence[str] | None = None) -> "tuple[pandas.DataFrame, str]":
    """The table of ``joined``, and what is doubtful about it: clocks not aligned, codes; empty if nothing."""
    import pandas

    hertz, places = si(rate, "frequency"), _places(run, channels)
    groups = list({group.name: group for group, _ in places}.values())
    if not groups or not hertz > 0.0:
        raise AnalysisError(
            f"{run.name}: resampling to {hertz:g} Hz: expected a positive rate, and a group with a time"
        )
    known = _known_clocks(run)
    clocks = known.maps
    times = {
        g.name: clocks[g.name].to_reference(t) if g.name in clocks else t for g in groups if len(t := run.time(g.name))
    }
    first, last = max(t[0] for t in times.values()), min(t[-1] for t in times.values())
    if not last > first:
        raise AnalysisError(
            f"{run.name}: its loggers recorded at no time together: align their clocks (testbench align)"
            f"{_no_trigger(known)}"
        )
    if (last - first) * hertz > (most := max(_MOST_ROWS, 100 * max(map(len, times.values())))):
        raise AnalysisError(
            f"{run.name}: {last - first:.3g} s at {hertz:g} Hz are more than {most} rows, a hundred times what any "
            "logger recorded: expected a lower rate"
        )
    grid = first + np.arange(int((last - first) * hertz) + 1) / hertz
    found: dict[str, Floats] = {}
    units: dict[str, str | None] = {}
    lines: list[str] = []
    codes: list[str] = []
    of_rig = {column.channel: column for column in SIRun.of(run).rig.columns()} if run.rig else {}
    triggers = {name for name, column in of_rig.items() if not column.level}
    for group, index in places:
        if group.name not in times:
            continue
        name = group.channels[index].name
        labels = (name, f"{group.name}: {name}", f"{group.name}: {group.keys[index]}")
        label = next(label for label in labels if label not in found)
        values = np.asarray(run.channel_at(group.name, index), dtype=np.float64)
        if not triggers.isdisjoint(group.channels[index].names) or _is_line(values, times[group.name], 1.0 / hertz):
            lines.append(label)
            found[label] = _held(times[group.name], values, grid)
        else:
            found[label] = _resampled(run, group, index, times[group.name], values, grid, hertz)
            if _may_be_codes(values) and not np.isin(found[label][~np.isnan(found[label])], values).all():
                codes.append(label)
        units[label] = group.channels[index].unit or next(
            (_raw_unit(of_rig[name]) for name in group.channels[index].names if name in of_rig), None
        )
    frame = pandas.DataFrame(found, index=pandas.Index(grid, name="time (s)"))
    unaligned = [name for name in times if name not in clocks] if len(times) > 1 else []
    how, doubts = _how_related(known, times, grid), list[str]()
    if unaligned:
        how = f"as recorded, not aligned: {', '.join(unaligned)}"
        doubts.append(
            f"{run.name}: the clocks of {', '.join(unaligned)} are as recorded, not aligned: one instant may have "
            f"another time in each; align them first: testbench align {run.path.parent.name}{_no_trigger(known)}"
        )
    if codes:
        doubts.append(
            f"{run.name}: {', '.join(codes)}: whole numbers, few or each for some samples, taken for a measurement, "
            "with values between; if they are codes, take them as recorded, without resampling"
        )
    frame.attrs.update({
        "run": run.name, "origin": run.origin, "units": units, "resampled_to_hz": hertz, "clocks": how,
        "interpolation": f"linear; below a logger's own rate low-passed at {_PASSED * hertz:g} Hz first"
        + (f"; the last sample of digital lines: {', '.join(lines)}" if lines else ""),
    })  # fmt: skip
    if (applied := run.provenance.get("calibrations")) is not None:
        frame.attrs["calibrations"] = json.dumps(applied, ensure_ascii=False)
    if (g0 := run.provenance.get("g0_m_per_s2")) is not None:
        frame.attrs["g0_m_per_s2"] = g0
    return frame, "; ".join(doubts)


def _how_related(known: KnownClocks, times: Mapping[str, Floats], grid: Floats) -> str:
    """What relates the clocks of groups with ``times``, and how well over the ``grid`` (n,) [s]."""
    if len(times) == 1:
        return "as recorded"
    clocks = [(name, clock) for name, clock in known.maps.items() if name in times and clock.covariance.any()]
    within = [(name, max(clock.half_width(float(at)) for at in clock.to_own(grid[[0, -1]]))) for name, clock in clocks]
    if not within:
        return known.how
    return f"{known.how}; 95 %: {', '.join(f'{name} within {1e3 * half:.2g} ms' for name, half in within)}"


def _raw_unit(column: Column) -> str | None:
    """Of a channel's log, which writes none, as the rig states it; of a trigger none counts."""
    known = column.unit or (column.calibration.unit if column.calibration else None)
    return known or None if column.level else None


def _known_clocks(run: Run) -> KnownClocks:
    """Of the groups, with or without a rig."""
    if run.rig is None:
        return KnownClocks(stored_clock_maps(run.path) if run.path.parent.is_dir() else {}, {}, ())
    return related_clocks(SIRun.of(run))


def _no_trigger(known: KnownClocks) -> str:
    return f" (by the trigger that the rig names they are not: {'; '.join(known.refused)})" if known.refused else ""


def _places(run: Run, channels: Sequence[str] | None) -> list[tuple[StoredGroup, int]]:
    """Measured channels of groups with a time, or those of them that are asked for; each its group and index there."""
    places = [(group, index) for group in run.groups if group.has_time for index in group.measured]
    if channels is None:
        return places
    of_name = {name: [(g, i) for g, i in places if g.index(name) == i] for name in channels}
    for name in (name for name, found in of_name.items() if not found):
        known = ", ".join(sorted({group.channels[index].name for group, index in places}))
        raise AnalysisError(f"{run.name}: no channel {name!r} measured in a group with a time: {known}")
    return [place for place in places if any(place in found for found in of_name.values())]


SAME_INSTANT = 1e-3
"""Share of a step within which two instants are one: times are written in decimals."""


_LEAST_STAY = 3
"""Samples for which each value of a state stays."""
_MOST_CODES = 16
"""Different whole numbers that may be codes, however short they stay."""
_COUNTS = 0.9
"""Share of a counter's changes that are by one, or to its begin: the others are losses."""


def _is_line(values: Floats, time: Floats, step: float) -> bool:
    """Whether nothing lies between values (n,) at instants (n,) [s]: two, a counter, or all stay for ``step`` [s].

    NaN where there is no number.
    """
    at = np.flatnonzero(~np.isnan(values))
    known = values[at]
    low, high = np.min(known, initial=np.inf), np.max(known, initial=-np.inf)
    if not low < high or np.all((known == low) | (known == high)):
        return bool(low < high)
    rises = np.diff(known)
    changes, by = at[1:][rises != 0.0], rises[rises != 0.0]
    counted = max(((by == one) | (by == one * (low - high)) for one in (1.0, -1.0)), key=np.mean)
    spikes = ~counted[1:] & ~counted[:-1] & (np.sign(by[1:]) != np.sign(by[:-1]))  # there and back; losses stay
    if np.mean(counted) >= _COUNTS and not spikes.any() and np.all(known == np.rint(known)):
        return True
    stay = np.diff(time[changes]) >= step - SAME_INSTANT * float(np.median(np.diff(time)))
    return bool(np.all(stay & (np.diff(changes) >= _LEAST_STAY)))


def _may_be_codes(values: Floats) -> bool:
    """Whether values (n,) are whole numbers, few or each for some samples; of a coarse measurement they are, too."""
    known = values[~np.isnan(values)]
    if not np.all(known == np.rint(known)):
        return False
    stays = np.diff(np.flatnonzero(np.diff(known)))
    return len(np.unique(known)) <= _MOST_CODES or bool(np.all(stays >= _LEAST_STAY))


def _held(time: Floats, values: Floats, grid: Floats) -> Floats:
    """The last of values (n,) [any unit] at instants ``time`` (n,) [s] before each of ``grid`` (m,) [s], (m,).

    NaN where ``interpolated`` gives it.
    """
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    last = values[np.clip(np.searchsorted(time, grid + SAME_INSTANT * step, side="right") - 1, 0, None)]
    return np.where(np.isnan(interpolated(time, values, grid)), np.nan, last)


def _resampled(
    run: Run, group: StoredGroup, index: int, time: Floats, values: Floats, grid: Floats, rate: float
) -> Floats:
    """A channel (k,) [its unit] at the instants ``grid`` (n,) [s], (n,) [its unit]."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    own = group.rate_hz or (1.0 / step if step > 0.0 else 0.0)
    if own <= rate * (1.0 + _SAME):
        return interpolated(time, values, grid)
    if not np.isfinite(values).all():
        raise AnalysisError(
            f"{run.name}: channel {group.channels[index].name!r} holds samples that are no number: resample to at "
            f"least its own rate, {own:g} Hz"
        )
    found = np.full(len(grid), np.nan)
    for part in np.split(np.arange(len(time)), np.flatnonzero(np.diff(time) > _GAP * step) + 1):
        at, shown = time[part], values[part]
        if group.rate_hz is None:  # irregular: a filter needs equal steps
            even = at[0] + np.arange(int((at[-1] - at[0]) * own) + 1) / own
            at, shown = even, np.interp(even, at, shown)
        inside = (grid >= at[0]) & (grid <= at[-1])
        found[inside] = np.interp(grid[inside], at, _low_passed(shown, _PASSED * rate, own))
    return found


def _low_passed(values: Floats, cutoff: float, rate: float) -> Floats:
    """Values (n,) [any unit] at ``rate`` [Hz] without what is above ``cutoff`` [Hz], and without phase, (n,)."""
    from scipy.signal import butter, sosfiltfilt

    sections = butter(8, cutoff, fs=rate, output="sos")
    return np.asarray(sosfiltfilt(sections, values, padlen=min(6 * len(sections), len(values) - 1)))


def interpolated(time: Floats, values: Floats, grid: Floats) -> Floats:
    """Values (n,) [any unit] at instants ``time`` (n,) [s] between two samples at ``grid`` (m,) [s], (m,).

    NaN in gaps, and before the first and after the last sample.
    """
    if len(time) < 2:
        return np.full(len(grid), np.nan)
    after = np.clip(np.searchsorted(time, grid), 1, len(time) - 1)
    step = _GAP * float(np.median(np.diff(time)))
    inside = (time[after] - time[after - 1] <= step) | (time[after] == grid) | (time[after - 1] == grid)
    return np.where(inside, np.interp(grid, time, values, np.nan, np.nan), np.nan)
