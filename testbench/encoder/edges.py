"""Encoder edges: their instants, the pulse that each is, and the clock they were timed with."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from balance.arrays import Floats, Indices

from ..errors import RecordingError
from .gaps import Gap, lost, spurious

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
    if extra := spurious(time, disc.pulses):
        places = ", ".join(f"edge {k} at {time[k]:.6f} s" for k in extra[:8])
        raise RecordingError(
            f"{name}: {len(extra)} edge{'s' * (len(extra) > 1)} too many, far closer than their neighbours: {places}; "
            "noise on the signal or both flanks counted: remove them from the log"
        )
    gaps = lost(time, disc.pulses)
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
    from ..findings import Finding, refused
    from ..readers.registry import open_recording
    from ..recording import TimeColumn

    recording = open_recording(path)
    group, found = recording.groups[0], list[Finding](recording.findings)
    _only_times(path, len(group.channels))
    blocks = [block.columns[0] for block in recording.blocks(found.append)]
    if bad := refused(found):
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
