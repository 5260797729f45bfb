"""Which motions a record holds, when, and how often: x, y, z, triangle, else ``unknown``.

A motion leaves a place at rest and comes back to it in legs, each from rest to rest. Legs come from the commanded
acceleration, from the encoders through the mechanism's loops, or from an accelerometer on a moving body. An
acceleration is integrated leg by leg, its drift taken out by the rest at both ends.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Literal

import numpy as np

from balance.arrays import Floats
from balance.errors import CounterpoiseError
from balance.results import Key, instant_text

from ..errors import AnalysisError
from ..rig.sensors import Accelerometer, Target
from ..runs.aligned_run import AlignedRun
from ..runs.si_run import SIRun
from ..signal.filters import Band
from .encoder_motion import point_path
from .gaps import gap_spans
from .smoothing_and_derivatives import ALMOST, Grid, grid_of, on_grid

REST_S = 0.03
"""Shortest rest between two legs [s]."""


@dataclass(frozen=True)
class Leg:
    """From rest to rest."""

    start: float
    """[s]"""
    end: float
    chord: Floats
    """From the first place to the last, base axes, (3,) [m]."""
    bend: float
    """Largest distance from the chord, as a share of its length."""


def legs_of_path(time: Floats, place: Floats, speed: Floats, rest_share: float) -> list[Leg]:
    """Legs of a path (n, 3) [m] at instants (n,) [s], where its speed (n,) [m/s] exceeds a share of the largest."""
    return [_leg(time[part], place[part] - place[part.start]) for part in _spans(speed, rest_share, time)]


def legs_of_acceleration(time: Floats, acceleration: Floats, rest_share: float) -> list[Leg]:
    """Legs of an acceleration (n, 3) [m/s2] at instants (n,) [s], integrated twice; at rest at both ends of each."""
    step = float(time[-1] - time[0]) / (len(time) - 1)
    size = np.linalg.norm(acceleration, axis=1)
    legs = []
    for part in _spans(size, rest_share, time):
        speed = _integral(acceleration[part], step)
        speed -= np.linspace(0.0, 1.0, len(speed))[:, None] * speed[-1]
        legs.append(_leg(time[part], _integral(speed, step)))
    return legs


def _integral(values: Floats, step: float) -> Floats:
    return np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * step * (values[1:] + values[:-1]), axis=0)])


def _leg(time: Floats, place: Floats) -> Leg:
    chord = place[-1]
    length = float(np.linalg.norm(chord))
    along = chord / length if length > 0.0 else np.zeros(3)
    offset = np.linalg.norm(place - np.outer(place @ along, along), axis=1)
    return Leg(float(time[0]), float(time[-1]), chord, float(offset.max()) / length if length else np.inf)


def _spans(size: Floats, rest_share: float, time: Floats) -> Iterator[slice]:
    """Samples in motion, with a margin of one; a rest below REST_S does not interrupt them."""
    moving = np.flatnonzero(size > rest_share * float(size.max(initial=0.0)))
    if not moving.size or not size.max() > 0.0:
        return
    gaps = np.flatnonzero(np.diff(time[moving]) > REST_S)
    for first, last in zip([0, *(gaps + 1)], [*gaps, len(moving) - 1], strict=True):
        yield slice(max(int(moving[first]) - 1, 0), min(int(moving[last]) + 2, len(time)))


Source = Literal["command", "encoders", "acceleration"]
BANDWIDTH_HZ = 80.0
"""Bandwidth of the encoders and accelerations from which motions are recognised [Hz]."""
SAMPLES_PER_PERIOD = 25.0
"""Of that bandwidth, to which an acceleration is averaged first: its uppermost frequency loses 0.3 % of its size."""
LARGEST_SHARE = 0.3
"""Largest bandwidth as a share of the encoders' rate."""
NO_GAP: Floats = np.zeros((0, 2))
REST_SHARE = {"command": 1e-3, "encoders": 0.02, "acceleration": 0.15}
"""Share of the largest speed, or of the largest acceleration, below which something rests."""
LEAST_COSINE = np.cos(np.radians(10.0))
"""Cosine of the largest angle between a leg and the axis that names it."""
LARGEST_BEND = {"command": 0.05, "encoders": 0.05, "acceleration": 0.15}
"""Largest distance of a straight leg from its chord, as a share of its length."""
RETURN_TOLERANCE = {"command": 0.05, "encoders": 0.05, "acceleration": 0.2}
"""Largest distance between visits of one place, as a share of the longest leg."""


@dataclass(frozen=True)
class RecognizedMotion:
    """One motion, on the clock of a group."""

    name: Annotated[str, Key("motion", "motion")]
    """``x``, ``y``, ``z``, ``triangle``, or ``unknown``."""
    source: Annotated[Source, Key("by", "by")]
    group: Annotated[str, Key("", "clock of")]
    start: Annotated[float, Key("start_s", "start [s]", ".4f")]
    end: Annotated[float, Key("end_s", "end [s]", ".4f")]
    repeat: Annotated[int, Key("", "repeat")]
    """Which one of its name, from 1."""
    legs: Annotated[int, Key()]
    extent: Annotated[float | None, Key("extent_m", "extent [mm]", lambda extent: f"{1e3 * extent:.1f}")]
    """Largest distance from where it began [m]; None where a gap hides it."""
    reason: Annotated[str, Key("", "because")]
    """Why it has this name."""


def recognized_motions(
    run: SIRun,
    aligned: Callable[[], AlignedRun],
    known: "Mapping[Source, list[RecognizedMotion]]" = MappingProxyType({}),
) -> tuple[dict[Source, list[RecognizedMotion]], dict[Source, str]]:
    """The motions of a run by each source that its rig has, and why another source shows none.

    Those of the command and of the accelerometer are taken from what is ``known`` of the run.
    """
    sources: dict[Source, Callable[[], tuple[str, list[Leg], Floats]]] = {
        "command": lambda: legs_by_command(run),
        "encoders": lambda: _legs_by_encoders(aligned()),
        "acceleration": lambda: legs_by_accelerometer(run),
    }
    motions: dict[Source, list[RecognizedMotion]] = {}
    reasons: dict[Source, str] = {}
    for source, find_legs in sources.items():
        try:
            if source in known and source != "encoders":
                motions[source] = known[source]
            else:
                group, legs, gaps = find_legs()
                motions[source] = name_motions(legs, source, group, gaps)
        except CounterpoiseError as error:
            reasons[source] = str(error)
    return motions, reasons


def name_motions(legs: Sequence[Leg], source: Source, group: str, gaps: Floats = NO_GAP) -> list[RecognizedMotion]:
    """Motions that legs make up, each with its name and why; one that ``gaps`` (g, 2) [s] touch is ``unknown``."""
    motions: list[RecognizedMotion] = []
    for cycle in _cycles(legs, RETURN_TOLERANCE[source]):
        name, reason = _gap_reason(cycle, gaps) or _name(cycle, source)
        places = np.cumsum([leg.chord for leg in cycle], axis=0)
        distances = [float(size) for size in np.linalg.norm(places, axis=1) if np.isfinite(size)]
        extent = max(distances) if len(distances) == len(places) else None
        repeat = 1 + sum(one.name == name for one in motions)
        motions.append(
            RecognizedMotion(name, source, group, cycle[0].start, cycle[-1].end, repeat, len(cycle), extent, reason)
        )
    return motions


def _cycles(legs: Sequence[Leg], tolerance: float) -> Iterator[list[Leg]]:
    """Legs up to where they are back at their beginning; those that never come back are one motion."""
    longest = max((float(np.linalg.norm(leg.chord)) for leg in legs), default=0.0)
    cycle: list[Leg] = []
    for leg in legs:
        if not cycle and float(np.linalg.norm(leg.chord)) < tolerance * longest:
            continue  # vibration about one place
        cycle.append(leg)
        if float(np.linalg.norm(np.sum([one.chord for one in cycle], axis=0))) < tolerance * longest:
            yield cycle
            cycle = []
    if cycle:
        yield cycle


def _gap_reason(legs: Sequence[Leg], gaps: Floats) -> tuple[str, str] | None:
    """``unknown`` and why, where a gap touches the motion."""
    for begin, end in gaps:
        if legs[0].start - REST_S < end and begin < legs[-1].end + REST_S:
            return "unknown", f"a gap of {end - begin:.4g} s after {instant_text(begin)} s touches it"
    return None


def _name(legs: Sequence[Leg], source: Source) -> tuple[str, str]:
    places = np.concatenate([np.zeros((1, 3)), np.cumsum([leg.chord for leg in legs], axis=0)])
    longest = max(float(np.linalg.norm(leg.chord)) for leg in legs)
    tolerance = RETURN_TOLERANCE[source] * longest
    if np.linalg.norm(places[-1]) > tolerance:
        return "unknown", f"it ends {1e3 * np.linalg.norm(places[-1]):.1f} mm from where it began"
    if (bend := max(leg.bend for leg in legs)) > LARGEST_BEND[source]:
        return "unknown", f"a leg is not straight: it leaves its chord by {100 * bend:.0f} % of its length"
    for i, axis in enumerate("xyz"):
        if all(abs(leg.chord[i]) > LEAST_COSINE * np.linalg.norm(leg.chord) for leg in legs):
            return axis, f"{len(legs)} straight legs along {axis}, back to where it began"
    if corners := _triangle(places, tolerance):
        return "triangle", f"three straight sides between {corners}"
    return "unknown", f"{len(legs)} straight legs that are neither along one axis nor round a triangle"


def _triangle(places: Floats, tolerance: float) -> str | None:
    """Three places of which every two are joined by a leg, all other legs between them and the start; as text."""
    nodes: list[Floats] = []
    visits = []
    for place in places:
        near = [i for i, node in enumerate(nodes) if np.linalg.norm(place - node) < tolerance]
        visits.append(near[0] if near else len(nodes))
        if not near:
            nodes.append(place)
    sides = {frozenset(pair) for pair in zip(visits, visits[1:], strict=False)}
    corners = [i for i in range(len(nodes)) if i] if len(nodes) == 4 else list(range(len(nodes)))
    if len(corners) != 3 or not {frozenset(p) for p in ((0, 1), (1, 2), (0, 2))} <= {
        frozenset(corners.index(i) for i in side) for side in sides if side <= set(corners)
    }:
        return None
    return ", ".join("(" + ", ".join(f"{1e3 * v:.0f}" for v in nodes[i][:2]) + ") mm" for i in corners)


def legs_by_command(run: SIRun) -> tuple[str, list[Leg], Floats]:
    """Group, legs and gaps (g, 2) [s] of the commanded acceleration. Raises AnalysisError without one."""
    columns = run.rig.columns_of(Target)
    if not columns:
        raise AnalysisError("the rig has no target")
    groups = run.groups_of(columns)
    if len(groups) > 1:
        raise AnalysisError("the target is on several loggers")
    time = run.instants(columns[0])
    values = np.zeros((len(time), 3))
    for column in columns:
        values[:, "xyz".index(column.component)] = run.values(column)
    gaps = gap_spans(time)
    if not len(gaps):
        return groups[0], legs_of_acceleration(time, values, REST_SHARE["command"]), gaps
    return groups[0], _legs_before_gap(gaps, time, values), gaps


def _legs_before_gap(gaps: Floats, time: Floats, values: Floats) -> list[Leg]:
    """Legs of a commanded acceleration (n, 3) before its first gap; the rest is one leg of unknown chord (NaN), for a
    speed is not integrated across a gap.
    """
    begin, end = gaps[0]
    before, size = time <= begin, np.linalg.norm(values, axis=1)
    moves = time[size > REST_SHARE["command"] * size.max()]
    legs = legs_of_acceleration(time[before], values[before], REST_SHARE["command"]) if before.sum() > 1 else []
    if not moves.size or moves[-1] < begin:
        return legs
    return [*legs, Leg(float(begin), max(float(moves[-1]), float(end)), np.full(3, np.nan), np.nan)]


def _legs_by_encoders(run: AlignedRun) -> tuple[str, list[Leg], Floats]:
    rate, mechanism = run.run.group(run.reference).rate_hz, run.unloaded
    bandwidth = min(BANDWIDTH_HZ, LARGEST_SHARE * rate if rate else BANDWIDTH_HZ)
    path, gaps = run.trajectory(bandwidth), list(run.gaps().spans.values())
    place = point_path(mechanism, path, *_followed_point(run))
    speed = np.linalg.norm(np.gradient(place, run.grid.step, axis=0), axis=1)
    return run.reference, legs_of_path(run.grid.time, place, speed, REST_SHARE["encoders"]), gaps[0] if gaps else NO_GAP


def _followed_point(run: AlignedRun) -> tuple[int, Floats]:
    """Body's index and position of the point whose path is the motion: an accelerometer on a moving body, else the
    payload; of several that the run table states by body or site, the heaviest.
    """
    mechanism = run.unloaded
    for sensor in run.run.rig.of_kind(Accelerometer).values():
        if sensor.attached_to != "base":
            mounted = mechanism.anchor(sensor.attached_to, np.array(sensor.position))
            return mechanism.body_index(sensor.attached_to), mounted.position
    stated = {} if len(mechanism.payload_bodies) == 1 else run.run.conditions.get("payloads", {})
    carries = max(stated, key=lambda name: stated[name], default="")
    if carries in mechanism.sites and not (carries in mechanism.own_mass and mechanism.mass(carries) > 0.0):
        return mechanism.sites[carries].body, mechanism.sites[carries].position
    carries = carries or mechanism.payload_body
    return mechanism.body_index(carries), np.array(mechanism.centre(carries))


def legs_by_accelerometer(run: SIRun) -> tuple[str, list[Leg], Floats]:
    """By an accelerometer on a moving body; its axes are taken for the base's, right if it does not turn."""
    for name, sensor in run.rig.of_kind(Accelerometer).items():
        columns = list(sensor.columns(name)) if sensor.attached_to != "base" else []
        if not columns:
            continue
        time = run.instants(columns[0])
        grid = grid_of(time, f"{run.name}: {name}")
        every = max(int(grid.rate / ALMOST // (SAMPLES_PER_PERIOD * BANDWIDTH_HZ)), 1)
        coarse = Grid(grid.start + 0.5 * (every - 1) * grid.step, every * grid.step, grid.count // every)
        even = on_grid(time, run.stacked(columns), grid)[: coarse.count * every]
        even = np.einsum("nik->kn", even.reshape(coarse.count, every, -1)) / every
        even -= np.median(even[:, : max(coarse.count // 20, 1)], axis=1, keepdims=True)
        values, axes = np.zeros((coarse.count, 3)), ["xyz".index(column.component) for column in columns]
        values[:, axes] = Band(0.0, BANDWIDTH_HZ).filtered(even, coarse.rate).T
        return run.group_of(columns[0]), legs_of_acceleration(coarse.time, values, REST_SHARE["acceleration"]), NO_GAP
    raise AnalysisError("the rig has no accelerometer on a body that moves")
