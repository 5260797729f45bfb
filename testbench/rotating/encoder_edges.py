"""Encoder edges: their instants, the number of each pulse, and checks that the log is what it claims to be.

Lost and spurious edges show as intervals much longer or shorter than their neighbours, unless a wide or narrow slot of
the disc explains them, which comes again a turn later. Lines without an edge in any turn are worn lines of the disc, no
lost edges. A wrong number of edges per turn shows by autocorrelation: the motion then repeats after another number.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np

from balance.arrays import Floats, Indices
from balance.results import Key

from ..errors import RecordingError

HDF5 = {".h5", ".hdf5", ".nxs"}
_NEIGHBOURS = 3
"""Intervals, or lags, compared on each side."""
_LONG, _SHORT = 1.5, 0.4
"""Shares of the expected interval above which an edge is lost, below which one is spurious.

Discs with slots 10 % out of place make intervals of 0.6 to 1.4, and more now and then.
"""
_WIDE, _NARROW = 1.3, 0.7
"""Shares above and below which the interval of the same slot a turn later confirms a wide or narrow slot."""
_NEAR_TICK = 0.01
"""Distance of an interval from whole nanoseconds at which its clock is finer than that [ns]."""
_COARSEST = 0.35
"""Step of the clock over the interval, up to which rounding makes no interval half as long again as its neighbours."""
_LEAST_LAG = _NEIGHBOURS + 1
"""Shortest repetition that is searched [edges]: of shorter ones, a lag's neighbours repeat as well."""
_AS_WELL = 1.5
"""Scatter at a part of a lag over that at the lag up to which the part repeats as well."""
_MOST_TURNS = 5
"""Stated turns over which a repetition is searched."""
_ROUNDING_STEPS = 3.0
"""Scatter in steps of the clock up to which it may be rounding."""
_LEAST_TURNS = 2
"""Turns of the disc in none of which a worn line has an edge."""
_CLEAR = 0.35
"""Scatter at a lag over that at its neighbours below which the motion repeats."""


@dataclass(frozen=True)
class Gap:
    """A place where edges are lost."""

    after: Annotated[int, Key("after_edge")]
    """Index of the edge before it."""
    time: Annotated[float, Key("time_s")]
    """Instant of that edge [s]."""
    missing: Annotated[int, Key()]
    """Number of lost edges."""
    ratio: Annotated[float, Key("interval_ratio")]
    """The interval over the expected one [-]."""

    def text(self) -> str:
        """The place in words."""
        return (
            f"{self.missing} after edge {self.after} at {self.time:.6f} s (interval {self.ratio:.2f} times the usual)"
        )


def lost_edges(time: Floats, pulses: int) -> list[Gap]:
    """Gaps in the instants of edges (n,) [s] of a disc with so many pulses a turn.

    An interval that is as long one turn of the disc before or after is a wide slot, no loss; a line that is missing on
    the disc comes one edge earlier each turn, and is a gap.
    """
    ratio = interval_ratios(time)
    return [
        Gap(int(k), float(time[k]), max(1, round(float(ratio[k])) - 1), float(ratio[k]))
        for k in np.flatnonzero(ratio > _LONG)
        if not _repeats_next_turn(ratio, int(k), pulses, ratio > _WIDE)
    ]


def spurious_edges(time: Floats, pulses: int) -> list[int]:
    """Indices of the edges (n,) [s] that come far too soon after the one before, other than by a narrow slot."""
    ratio = interval_ratios(time)
    close = np.flatnonzero(ratio < _SHORT)
    return [int(k) + 1 for k in close if not _repeats_next_turn(ratio, int(k), pulses, ratio < _NARROW)]


def _repeats_next_turn(
    ratio: Floats, k: int, pulses: int, similar: "np.ndarray[tuple[int], np.dtype[np.bool_]]"
) -> bool:
    return any(0 <= i < len(ratio) and bool(similar[i]) for i in (k - pulses, k + pulses))


def interval_ratios(time: Floats) -> Floats:
    """Each interval between edges (n,) [s] over the expected one, (n - 1,) [-].

    Expected is the geometric mean of the medians before and after, so that a steadily changing speed is regular. The
    first and last intervals have one side only: their ratio is 1 where that side is uneven (a start from standstill).
    """
    log = np.log(np.diff(time))
    count = len(log)
    padded = np.concatenate([np.full(_NEIGHBOURS, np.nan), log, np.full(_NEIGHBOURS, np.nan)])
    before = np.stack([padded[k : k + count] for k in range(_NEIGHBOURS)])
    after = np.stack([padded[_NEIGHBOURS + 1 + k : _NEIGHBOURS + 1 + k + count] for k in range(_NEIGHBOURS)])
    earlier, later = _median(before), _median(after)
    expected = np.where(np.isnan(earlier), later, np.where(np.isnan(later), earlier, 0.5 * (earlier + later)))
    one_sided = np.isnan(earlier) | np.isnan(later)
    side = np.where(np.isnan(earlier), _spread(after), _spread(before))
    ratio = np.exp(log - expected)
    return np.where(one_sided & (side > np.log(1.3)), 1.0, ratio)


def _median(rows: Floats) -> Floats:
    """Median of each column without NaN; NaN where a column has nothing else."""
    order = np.sort(rows, axis=0)
    have = np.isfinite(rows).sum(axis=0)
    columns = np.arange(rows.shape[1])
    low, high = order[np.maximum(have - 1, 0) // 2, columns], order[np.maximum(have, 1) // 2 * (have > 1), columns]
    return np.where(have > 0, 0.5 * (low + np.where(have % 2 == 0, high, low)), np.nan)


def _spread(rows: Floats) -> Floats:
    """Largest less smallest value of each column without NaN."""
    return np.where(np.isnan(rows), -np.inf, rows).max(axis=0) - np.where(np.isnan(rows), np.inf, rows).min(axis=0)


class LostEdges(RecordingError):
    """A log with lost edges, or of a disc with worn lines; the message names each place."""

    def __init__(self, name: str, gaps: list[Gap], worn: tuple[int, ...] = ()) -> None:
        places = "; ".join(gap.text() for gap in gaps[:8]) + ("; ..." if len(gaps) > 8 else "")
        count = sum(gap.missing for gap in gaps)
        odd = [f"{count} edge{'s' * (count > 1)} lost: {places}"] * bool(gaps) + [worn_text(worn)] * bool(worn)
        super().__init__(
            f"{name}: {'; '.join(odd)}. Through a gap the speed would be wrong, and the angle of every later edge; "
            "--bridge counts what is missing and goes on, also to --calibrate the lines that there are"
        )
        self.gaps, self.worn = gaps, worn


def worn_text(worn: tuple[int, ...]) -> str:
    """Lines that lack in each turn, in words."""
    named, several = ", ".join(str(k) for k in worn[:20]) + ", ..." * (len(worn) > 20), len(worn) > 1
    return (
        f"line{'s' * several} {named} of the disc {'are' if several else 'is'} missing in each turn (the first edge is "
        "line 0): worn, dirty, or left out for reference"
    )


@dataclass(frozen=True)
class Disc:
    """An encoder disc and how its shaft turns."""

    pulses: int
    """Edges per turn of the encoder's shaft."""
    ratio: float = 1.0
    """Turns of the encoder's shaft per turn of the crank."""

    @property
    def per_turn(self) -> float:
        """Edges per turn of the crank."""
        return self.pulses * self.ratio

    @property
    def whole_per_turn(self) -> int | None:
        """Edges per turn of the crank if that is a whole number, so that every turn has edges at the same angles."""
        count = round(self.per_turn)
        return count if abs(self.per_turn - count) < 1e-9 * self.per_turn else None

    @property
    def pitch_is_separable(self) -> bool:
        """Whether errors of the disc have another period than the crank, so that both can be estimated."""
        return abs(self.ratio - round(self.ratio)) > 0.02


@dataclass(frozen=True)
class Edges:
    """Instants of edges, each with the number of its pulse."""

    name: str
    disc: Disc
    time: Floats
    """Instants, (n,) [s]."""
    pulse: Indices
    """Pulses since the first edge, lost ones counted, (n,) [-]."""
    gaps: tuple[Gap, ...] = ()
    """Where edges are lost."""
    offset: Floats | None = None
    """Angle by which each slot of the disc is ahead of its even place, (pulses,) [rad of the encoder's shaft]."""
    worn: tuple[int, ...] = ()
    """Slots of the disc that have no edge in any turn, from that of the first edge [-]."""

    @cached_property
    def angle(self) -> Floats:
        """Angle of the crank at each edge, from the first one, corrected for the disc's known errors, (n,) [rad]."""
        even = 2.0 * np.pi * self.pulse / self.disc.per_turn
        if self.offset is None:
            return even
        ahead = self.offset[self.pulse % self.disc.pulses] / self.disc.ratio
        return even + ahead - ahead[0]

    @cached_property
    def clock_step(self) -> float | None:
        """Largest step of time of which all intervals are multiples, such as 4 us; None below a nanosecond [s]."""
        return _clock_step(self.time)

    def part(self, where: Indices) -> "Edges":
        """The edges with indices ``where`` (k,) [-], pulses still counted from the same first edge."""
        return replace(self, time=self.time[where], pulse=self.pulse[where])


def number_edges(name: str, time: Floats, disc: Disc, bridge: bool = False, offset: Floats | None = None) -> Edges:
    """Number the edges (n,) [s] of a log; ``offset`` (pulses,) [rad of the encoder's shaft] corrects the disc's errors.

    Raises RecordingError for too few edges, time that does not increase or spurious edges, LostEdges for lost ones
    unless ``bridge`` allows to count them.
    """
    if len(time) < 8:
        raise RecordingError(f"{name}: {len(time)} edges; expected at least 8 for a speed: take a longer log")
    _require_increasing(name, time)
    _require_fine_clock(name, time)
    if extra := spurious_edges(time, disc.pulses):
        places = ", ".join(f"edge {k} at {time[k]:.6f} s" for k in extra[:8])
        raise RecordingError(
            f"{name}: {len(extra)} edge{'s' * (len(extra) > 1)} too many, far closer than their neighbours: {places}; "
            "from noise on the signal, or both flanks counted: remove them from the log"
        )
    gaps = lost_edges(time, disc.pulses)
    step = np.ones(len(time) - 1, dtype=np.intp)
    for gap in gaps:
        step[gap.after] += gap.missing
    pulse = np.concatenate([[0], np.cumsum(step)])
    worn = np.bincount(pulse % disc.pulses, minlength=disc.pulses) == 0
    worn &= pulse[-1] + 1 >= _LEAST_TURNS * disc.pulses
    gaps = [
        replace(gap, missing=lost)
        for gap in gaps
        if (lost := gap.missing - int(worn[(pulse[gap.after] + 1 + np.arange(gap.missing)) % disc.pulses].sum()))
    ]
    slots = tuple(np.flatnonzero(worn).tolist())
    if (gaps or slots) and not bridge:
        raise LostEdges(name, gaps, slots)
    return Edges(name, disc, time, pulse, tuple(gaps), offset, slots)


def read_edge_times(path: Path) -> Floats:
    """Instants of the edges of a log or a stored run: its only column, (n,) [s].

    Raises RecordingError where the file has other channels too, no unit of time, or rows that cannot be trusted.
    """
    if path.suffix.lower() in HDF5:
        from ..store import open_run

        run = open_run(path)
        _require_one_channel(path, len(run.group().channels))
        return run.time()
    from ..readers.registry import open_recording
    from ..recording import Finding, TimeColumn, refusing_findings

    recording = open_recording(path)
    group, found = recording.groups[0], list[Finding](recording.findings)
    _require_one_channel(path, len(group.channels))
    blocks = [block.columns[0] for block in recording.blocks(found.append)]
    if bad := refusing_findings(found):
        raise RecordingError(f"{path.name}: {bad[0].where or ''} {bad[0].message}".replace("  ", " "))
    name = group.channels[0].name
    if not isinstance(group.clock, TimeColumn) or group.clock.seconds_per_unit is None or group.clock.assumed:
        raise RecordingError(
            f"{path.name}: column {name!r} has no unit of time: expected a header such as t_us or t (s)"
        )
    ticks = np.concatenate(blocks) if blocks else np.empty(0)
    if not np.isfinite(ticks).all():
        row = int(np.flatnonzero(~np.isfinite(ticks))[0])
        raise RecordingError(f"{path.name}: row {row + 1} of {name!r} is no number: remove the row from the log")
    return ticks * group.clock.seconds_per_unit


def log_origin(path: Path) -> str:
    """Origin of a log or stored run: measured, simulated or unstated."""
    if path.suffix.lower() in HDF5:
        from ..store import open_run

        return open_run(path).origin
    from ..readers.registry import open_recording

    return open_recording(path).origin


def _require_one_channel(path: Path, channels: int) -> None:
    if channels != 1:
        raise RecordingError(
            f"{path.name}: {channels} channels; expected one column, the instants of the encoder's edges, such as t_us"
        )


def _clock_step(time: Floats) -> float | None:
    ticks = np.rint(np.diff(time) * 1e9).astype(np.int64)
    if np.abs(np.diff(time) * 1e9 - ticks).max(initial=0.0) > _NEAR_TICK:
        return None
    step = int(np.gcd.reduce(ticks))
    return step * 1e-9 if step > 1 else None


def _require_fine_clock(name: str, time: Floats) -> None:
    """Raise RecordingError where intervals of two or three clock steps would imitate and hide lost edges."""
    step, interval = _clock_step(time), float(np.median(np.diff(time)))
    if step is None or step <= _COARSEST * interval:
        return
    if np.diff(time).min() < 1.5 * step:  # at an even speed an interval itself is the largest step of all
        return
    raise RecordingError(
        f"{name}: the clock's step of {step * 1e6:g} us is {100 * step / interval:.0f} % of an interval between edges: "
        f"above {100 * _COARSEST:g} % lost edges cannot be distinguished from rounding; log with a finer clock"
    )


def _require_increasing(name: str, time: Floats) -> None:
    step = np.diff(time)
    if (step > 0.0).all():
        return
    k = int(np.flatnonzero(~(step > 0.0))[0])
    hint = " (a counter that overflowed)" if step[k] < -1.0 else ""
    raise RecordingError(
        f"{name}: time goes from {time[k]:.6f} to {time[k + 1]:.6f} s at edge {k + 1}{hint}; expected increasing"
    )


def require_stated_turn(edges: Edges) -> None:
    """Raise RecordingError where the motion in the later half clearly repeats, but not after the stated turn."""
    if edges.disc.pitch_is_separable:
        return
    stated = round(edges.disc.per_turn)
    lags, scatter = _lag_scatter(edges)
    found = _repetition_lags(edges, lags, scatter)
    at_stated = dict(zip(lags.tolist(), scatter.tolist(), strict=True)).get(stated)
    if at_stated is None:  # the log is too short to compare a stated turn with the next
        other = found[:1] if found and stated % found[0] else []
    else:
        other = [lag for lag in found if scatter[lag - lags[0]] < _CLEAR * at_stated]
    if other:
        raise RecordingError(
            f"{edges.name}: the motion repeats every {other[0]} edges, not every {stated}: correct the edges per turn "
            "of the disc (--pulses) or its turns per turn of the crank (--ratio)"
        )


def repetition(edges: Edges) -> int | None:
    """Edges after which the motion of the later half repeats, a turn or a whole part of one; None if it does not."""
    per_turn = edges.disc.per_turn
    parts = [lag for lag in _repetition_lags(edges, *_lag_scatter(edges)) if _divides(lag, per_turn)]
    return min(parts, default=None)


def _divides(lag: int, per_turn: float) -> bool:
    """Whether a lag [edges] is a turn or a whole part of one, to the nearest edge."""
    times = round(per_turn / lag)
    return times >= 1 and abs(per_turn / times - lag) <= 0.5


def _lag_scatter(edges: Edges) -> tuple[Indices, Floats]:
    """Lags (k,) [edges], and the scatter of the time for each along the later half of the log (k,) [s]."""
    stated = round(edges.disc.per_turn)
    time = np.full(edges.pulse[-1] + 1, np.nan)
    time[edges.pulse] = edges.time
    time = time[len(time) // 2 :][-4 * _MOST_TURNS * stated :]
    most = min(_MOST_TURNS * stated + 2 * _NEIGHBOURS, 3 * len(time) // 4)
    if most < _LEAST_LAG + _NEIGHBOURS:
        return np.arange(0), np.empty(0)
    lags = np.arange(_LEAST_LAG - _NEIGHBOURS, most)
    return lags, np.array([np.nanstd(time[lag:] - time[:-lag]) for lag in lags]) + 1e-12


def _repetition_lags(edges: Edges, lags: Indices, scatter: Floats) -> list[int]:
    """Lags [edges] after which the motion clearly repeats; a scatter of a few clock steps may be rounding."""
    found, least = [], _ROUNDING_STEPS * (edges.clock_step or 0.0)
    for k in range(_NEIGHBOURS, len(lags) - _NEIGHBOURS):
        nearby = np.r_[scatter[k - _NEIGHBOURS : k], scatter[k + 1 : k + 1 + _NEIGHBOURS]]
        shorter = [scatter[part - lags[0]] for part in range(2, _LEAST_LAG) if lags[k] % part == 0]
        as_well = min(shorter, default=np.inf) < _AS_WELL * scatter[k]
        if np.median(nearby) > max(least, scatter[k] / _CLEAR) and scatter[k] < nearby.min() and not as_well:
            found.append(int(lags[k]))
    return found
