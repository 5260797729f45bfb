"""Encoder edges: their instants, the pulse that each is, and the clock they were timed with.

Edges that are lost or too many, told from the intervals beside them.

After how many edges the motion repeats: once a turn, where the edges per turn are as stated.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from balance.arrays import Floats, Indices

from ..errors import RecordingError

_NEIGHBOURS = 3
"""Intervals looked at on each side."""
_LONG, _SHORT = 1.5, 0.4
"""Shares of the expected interval above which an edge counts as lost, below which as one too many.

Discs with slots 10 % out of place make intervals of 0.6 to 1.4, and more now and then.
"""
_WIDE, _NARROW = 1.3, 0.7
"""Shares above and below which an interval counts as alike when the same slot comes again."""


@dataclass(frozen=True)
class Gap:
    """A place where edges are lost."""

    after: int
    """The edge before it, counted from 0."""
    time: float
    """Its instant [s]."""
    missing: int
    """How many edges are lost."""
    ratio: float
    """The interval over the one to expect."""

    def text(self) -> str:
        """The place for people."""
        return (
            f"{self.missing} after edge {self.after} at {self.time:.6f} s (interval {self.ratio:.2f} times the usual)"
        )


def lost_edges(time: Floats, pulses: int) -> list[Gap]:
    """Gaps in the instants of edges (n,) [s] of a disc with so many pulses a turn.

    An interval as long one turn of the disc before or after is a wide slot, not a loss; a slot that is missing from
    the disc comes again one edge earlier each turn, and is a loss.
    """
    ratio = interval_ratios(time)
    return [
        Gap(int(k), float(time[k]), max(1, round(float(ratio[k])) - 1), float(ratio[k]))
        for k in np.flatnonzero(ratio > _LONG)
        if not _comes_again(ratio, int(k), pulses, ratio > _WIDE)
    ]


def spurious_edges(time: Floats, pulses: int) -> list[int]:
    """Edges that come far too early after the one before, counted from 0; not those of a narrow slot."""
    ratio = interval_ratios(time)
    close = np.flatnonzero(ratio < _SHORT)
    return [int(k) + 1 for k in close if not _comes_again(ratio, int(k), pulses, ratio < _NARROW)]


def _comes_again(ratio: Floats, k: int, pulses: int, alike: "np.ndarray[tuple[int], np.dtype[np.bool_]]") -> bool:
    return any(0 <= i < len(ratio) and bool(alike[i]) for i in (k - pulses, k + pulses))


def interval_ratios(time: Floats) -> Floats:
    """Each interval over the one to expect: geometric mean of the medians of those before and after, (n - 1,).

    So a steady gain of speed counts as regular. The first and last intervals have one side only: they are judged where
    that side is even, and count as 1 elsewhere (a start from standstill).
    """
    log = np.log(np.diff(time))
    count = len(log)
    padded = np.concatenate([np.full(_NEIGHBOURS, np.nan), log, np.full(_NEIGHBOURS, np.nan)])
    before = np.stack([padded[k : k + count] for k in range(_NEIGHBOURS)])
    after = np.stack([padded[_NEIGHBOURS + 1 + k : _NEIGHBOURS + 1 + k + count] for k in range(_NEIGHBOURS)])
    left, right = _median(before), _median(after)
    expected = np.where(np.isnan(left), right, np.where(np.isnan(right), left, 0.5 * (left + right)))
    one_sided = np.isnan(left) | np.isnan(right)
    side = np.where(np.isnan(left), _spread(after), _spread(before))
    ratio = np.exp(log - expected)
    return np.where(one_sided & (side > np.log(1.3)), 1.0, ratio)


def _median(rows: Floats) -> Floats:
    """Median down the columns, NaN left out; NaN where a column holds nothing else."""
    order = np.sort(rows, axis=0)
    have = np.isfinite(rows).sum(axis=0)
    columns = np.arange(rows.shape[1])
    low, high = order[np.maximum(have - 1, 0) // 2, columns], order[np.maximum(have, 1) // 2 * (have > 1), columns]
    return np.where(have > 0, 0.5 * (low + np.where(have % 2 == 0, high, low)), np.nan)


def _spread(rows: Floats) -> Floats:
    """Largest less smallest down the columns, NaN left out."""
    return np.where(np.isnan(rows), -np.inf, rows).max(axis=0) - np.where(np.isnan(rows), np.inf, rows).min(axis=0)


_NEAR_TICK = 0.01
"""Distance of an interval from whole nanoseconds, at which its clock is finer than that [ns]."""
_COARSEST = 0.35
"""Step of the clock, of an interval, up to which rounding makes none half as long again as its neighbours."""
HDF5 = {".h5", ".hdf5", ".nxs"}


class LostEdges(RecordingError):
    """A log that misses edges, each place named."""

    def __init__(self, name: str, gaps: list[Gap]) -> None:
        places = "; ".join(gap.text() for gap in gaps[:8]) + ("; ..." if len(gaps) > 8 else "")
        count = sum(gap.missing for gap in gaps)
        super().__init__(
            f"{name}: {count} edge{'s' * (count > 1)} lost: {places}. A speed computed through a gap would be wrong "
            "there, and every later edge at the wrong angle; --bridge counts the lost edges and goes on"
        )
        self.gaps = gaps


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
    def whole(self) -> int | None:
        """Edges per turn of the crank where that is a whole number: then every turn meets the same angles."""
        count = round(self.per_turn)
        return count if abs(self.per_turn - count) < 1e-9 * self.per_turn else None

    @property
    def pitch_is_apart(self) -> bool:
        """Whether errors of the disc repeat with another period than the crank, so that they can be told apart."""
        return abs(self.ratio - round(self.ratio)) > 0.02


@dataclass(frozen=True)
class Edges:
    """Edges in time, each with the number of its pulse."""

    name: str
    disc: Disc
    time: Floats
    """Instants, (n,) [s]."""
    pulse: Indices
    """Pulses since the first edge, lost ones counted, (n,)."""
    gaps: tuple[Gap, ...] = ()
    """Where edges are lost."""
    offset: Floats | None = None
    """Angle by which each slot of the disc is ahead of its even place, (pulses,) [rad of the encoder's shaft]."""

    @cached_property
    def angle(self) -> Floats:
        """Angle of the crank at each edge, from the first one, the disc's known errors put right, (n,) [rad]."""
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
        """Some of the edges, pulses still counted from the same first edge."""
        return Edges(self.name, self.disc, self.time[where], self.pulse[where], self.gaps, self.offset)


def edges_of(name: str, time: Floats, disc: Disc, bridge: bool = False, offset: Floats | None = None) -> Edges:
    """Number the edges of a log; ``offset`` (pulses,) [rad] puts the disc's known errors right.

    Raises RecordingError for too few edges, time that does not increase or spurious edges, LostEdges for lost ones
    unless ``bridge`` asks to count them.
    """
    if len(time) < 8:
        raise RecordingError(f"{name}: {len(time)} edges; expected at least 8 to tell a speed")
    _refuse_disorder(name, time)
    _refuse_coarse_clock(name, time)
    if extra := spurious_edges(time, disc.pulses):
        places = ", ".join(f"edge {k} at {time[k]:.6f} s" for k in extra[:8])
        raise RecordingError(
            f"{name}: {len(extra)} edge{'s' * (len(extra) > 1)} too many, far closer than their neighbours: {places}; "
            "noise on the signal or both flanks counted: remove them from the log"
        )
    gaps = lost_edges(time, disc.pulses)
    if gaps and not bridge:
        raise LostEdges(name, gaps)
    step = np.ones(len(time) - 1, dtype=np.intp)
    for gap in gaps:
        step[gap.after] += gap.missing
    return Edges(name, disc, time, np.concatenate([[0], np.cumsum(step)]), tuple(gaps), offset)


def read_times(path: Path) -> Floats:
    """Instants of edges of a log or a stored run: its time column, (n,) [s].

    Raises RecordingError where the file has other channels too, no unit of time, or rows that cannot be trusted.
    """
    if path.suffix.lower() in HDF5:
        from ..store import open_run

        run = open_run(path)
        _only_times(path, len(run.group().channels))
        return run.time()
    return _logged(path)


def origin_of(path: Path) -> str:
    """Whether a log or stored run is measured, simulated, or does not say."""
    if path.suffix.lower() in HDF5:
        from ..store import open_run

        return open_run(path).origin
    from ..readers.registry import open_recording

    return open_recording(path).origin


def _logged(path: Path) -> Floats:
    from ..readers.registry import open_recording
    from ..recording import Finding, TimeColumn, refusing_findings

    recording = open_recording(path)
    group, found = recording.groups[0], list[Finding](recording.findings)
    _only_times(path, len(group.channels))
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
        raise RecordingError(f"{path.name}: row {row + 1} of {name!r} is no number: an edge without an instant")
    return ticks * group.clock.seconds_per_unit


def _only_times(path: Path, channels: int) -> None:
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


def _refuse_coarse_clock(name: str, time: Floats) -> None:
    """Intervals of two or three steps look like lost edges where none is, and hide those that are."""
    step, interval = _clock_step(time), float(np.median(np.diff(time)))
    if step is None or step <= _COARSEST * interval:
        return
    if np.diff(time).min() < 1.5 * step:  # at an even speed an interval itself is the largest step of all
        return
    raise RecordingError(
        f"{name}: the clock's step of {step * 1e6:g} us is {100 * step / interval:.0f} % of an interval between edges: "
        f"lost edges cannot be told from rounding above {100 * _COARSEST:g} %; log with a finer clock"
    )


def _refuse_disorder(name: str, time: Floats) -> None:
    step = np.diff(time)
    if (step > 0.0).all():
        return
    k = int(np.flatnonzero(~(step > 0.0))[0])
    hint = ": a counter that ran over" if step[k] < -1.0 else ""
    raise RecordingError(
        f"{name}: time goes from {time[k]:.6f} to {time[k + 1]:.6f} s at edge {k + 1}{hint}; expected increasing"
    )


_LEAST = 8
"""Shortest repetition that is looked for, in edges."""
_FARTHEST = 5
"""Stated turns over which a repetition is looked for."""
_NEIGHBOURS_IN_TURN = 3
_STEPS = 3.0
"""Steps of the clock, above which scatter is no rounding."""
_CLEAR = 0.35
"""Scatter of the time for a number of edges, of that for a few more or less, below which the motion repeats."""


def refuse_other_turn(edges: Edges) -> None:
    """Raise RecordingError where the motion in the later half plainly repeats, but not after the stated turn."""
    if edges.disc.pitch_is_apart:
        return
    stated = round(edges.disc.per_turn)
    lags, scatter = _scatter(edges)
    found = _repetitions(edges, lags, scatter)
    at_stated = dict(zip(lags.tolist(), scatter.tolist(), strict=True)).get(stated)
    if at_stated is None:  # too short a log to hold a stated turn against the next
        other = found[:1] if found and stated % found[0] else []
    else:
        other = [lag for lag in found if scatter[lag - lags[0]] < _CLEAR * at_stated]
    if other:
        raise RecordingError(
            f"{edges.name}: the motion repeats every {other[0]} edges, not every {stated}: state the edges per turn of "
            "the disc (--pulses) and its turns per turn of the crank (--ratio) as they are"
        )


def repetition(edges: Edges) -> int | None:
    """Edges after which the motion of the later half repeats, a turn or a whole part of one; None: nothing shows it."""
    per_turn = edges.disc.per_turn
    parts = [lag for lag in _repetitions(edges, *_scatter(edges)) if _divides(lag, per_turn)]
    return min(parts, default=None)


def _divides(lag: int, per_turn: float) -> bool:
    """Whether so many edges are a turn or a whole part of one, to the next edge."""
    times = round(per_turn / lag)
    return times >= 1 and abs(per_turn / times - lag) <= 0.5


def _scatter(edges: Edges) -> tuple[Indices, Floats]:
    """Numbers of edges, and how the time for each scatters along the later half of the log [s]; lost ones left out."""
    stated = round(edges.disc.per_turn)
    time = np.full(edges.pulse[-1] + 1, np.nan)
    time[edges.pulse] = edges.time
    time = time[len(time) // 2 :][-4 * _FARTHEST * stated :]
    most = min(_FARTHEST * stated + 2 * _NEIGHBOURS_IN_TURN, 3 * len(time) // 4)
    if most < _LEAST + _NEIGHBOURS_IN_TURN:
        return np.arange(0), np.empty(0)
    lags = np.arange(_LEAST - _NEIGHBOURS_IN_TURN, most)
    return lags, np.array([np.nanstd(time[lag:] - time[:-lag]) for lag in lags]) + 1e-12


def _repetitions(edges: Edges, lags: Indices, scatter: Floats) -> list[int]:
    """Numbers of edges after which the motion plainly repeats; scatter of a few clock steps is rounding that beats."""
    found, least = [], _STEPS * (edges.clock_step or 0.0)
    for k in range(_NEIGHBOURS_IN_TURN, len(lags) - _NEIGHBOURS_IN_TURN):
        beside = np.r_[scatter[k - _NEIGHBOURS_IN_TURN : k], scatter[k + 1 : k + 1 + _NEIGHBOURS_IN_TURN]]
        if np.median(beside) > max(least, scatter[k] / _CLEAR) and scatter[k] < beside.min():
            found.append(int(lags[k]))
    return found
