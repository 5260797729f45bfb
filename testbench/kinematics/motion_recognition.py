"""Which motions a record holds, when, and how often: x, y, triangle; what is none of them is called unknown.

A motion is what happens between leaving a place at rest and coming back to it: legs, each from rest to rest. Legs come
from the commanded acceleration, from the encoders through the mechanism's loops, or from an accelerometer on what
moves: an acceleration is integrated leg by leg, and its drift taken out by the rest at both ends.

Legs of a motion, each from rest to rest: from the path of a point, or from its acceleration.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from balance.arrays import Floats
from balance.errors import CounterpoiseError
from balance.mechanism import forward_kinematics
from balance.mechanism.sparse_components import dense

from ..errors import AnalysisError
from ..rig.sensors import Accelerometer, Target
from ..signal.filters import Band
from .gaps import wide_steps
from .smoothing_and_derivatives import grid_of, on_grid

if TYPE_CHECKING:
    from ..runs.aligned_run import AlignedRun
    from ..runs.si_run import SIRun

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


def legs_of_path(time: Floats, place: Floats, speed: Floats, still: float) -> list[Leg]:
    """Legs of a path (n, 3) [m], where its speed (n,) [m/s] leaves ``still`` of the largest."""
    return [_leg(time[part], place[part] - place[part.start]) for part in _spans(speed, still, time)]


def legs_of_acceleration(time: Floats, acceleration: Floats, still: float) -> list[Leg]:
    """Legs of an acceleration (n, 3) [m/s2], integrated twice; speeds are zero at the ends of each."""
    step = float(time[-1] - time[0]) / (len(time) - 1)
    size = np.linalg.norm(acceleration, axis=1)
    legs = []
    for part in _spans(size, still, time):
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
    beside = np.linalg.norm(place - np.outer(place @ along, along), axis=1)
    return Leg(float(time[0]), float(time[-1]), chord, float(beside.max()) / length if length else np.inf)


def _spans(size: Floats, still: float, time: Floats) -> Iterator[slice]:
    """Where something moves; what rests for less than REST_S between is no rest. A margin of one sample."""
    moving = np.flatnonzero(size > still * float(size.max(initial=0.0)))
    if not moving.size or not size.max() > 0.0:
        return
    gaps = np.flatnonzero(np.diff(time[moving]) > REST_S)
    for first, last in zip([0, *(gaps + 1)], [*gaps, len(moving) - 1], strict=True):
        yield slice(max(int(moving[first]) - 1, 0), min(int(moving[last]) + 2, len(time)))


Source = Literal["command", "encoders", "acceleration"]
BANDWIDTH_HZ = 80.0
"""Of what motions are found in [Hz]."""
LARGEST_SHARE = 0.3
"""Of the encoders' rate, where that is less."""
NO_GAP: Floats = np.zeros((0, 2))
STILL = {"command": 1e-3, "encoders": 0.02, "acceleration": 0.15}
"""Share of the largest speed, or of the largest acceleration, below which something rests."""
ALONG = np.cos(np.radians(10.0))
"""Cosine of the largest angle between a leg and the axis that it is said to be along."""
BENT = {"command": 0.05, "encoders": 0.05, "acceleration": 0.15}
"""How far a straight leg may leave its chord, as a share of its length."""
BACK = {"command": 0.05, "encoders": 0.05, "acceleration": 0.2}
"""How near two places must be to be the same, as a share of the longest leg."""


@dataclass(frozen=True)
class RecognizedMotion:
    """One motion, on the clock of a group."""

    name: str
    """``x``, ``y``, ``z``, ``triangle``, or ``unknown``."""
    source: Source
    group: str
    start: float
    """[s]"""
    end: float
    repeat: int
    """Which one of its name, from 1."""
    legs: int
    extent: float | None
    """Largest distance from where it began [m]; None where a gap hides it."""
    reason: str
    """Why it is called so."""

    def as_dict(self) -> dict[str, Any]:
        """The motion as it is printed."""
        return {
            "motion": self.name,
            "by": self.source,
            "group": self.group,
            "start_s": self.start,
            "end_s": self.end,
            "repeat": self.repeat,
            "legs": self.legs,
            "extent_m": self.extent,
            "reason": self.reason,
        }


def recognized_motions(
    run: "SIRun", aligned: "Callable[[], AlignedRun]"
) -> tuple[dict[Source, list[RecognizedMotion]], dict[Source, str]]:
    """The motions of a run by each source that its rig has, and why a source tells nothing."""
    ways: dict[Source, Callable[[], tuple[str, list[Leg], Floats]]] = {
        "command": lambda: _commanded(run),
        "encoders": lambda: _encoded(aligned()),
        "acceleration": lambda: _felt(run),
    }
    motions: dict[Source, list[RecognizedMotion]] = {}
    reasons: dict[Source, str] = {}
    for source, way in ways.items():
        try:
            group, legs, gaps = way()
            motions[source] = motion_name(legs, source, group, gaps)
        except CounterpoiseError as error:
            reasons[source] = str(error)
    return motions, reasons


def motion_name(legs: Sequence[Leg], source: Source, group: str, gaps: Floats = NO_GAP) -> list[RecognizedMotion]:
    """Legs as motions, each with its name, or ``unknown``, and why; one that ``gaps`` (g, 2) [s] touch is unknown."""
    done: list[RecognizedMotion] = []
    for some in _cycles(legs, BACK[source]):
        name, reason = _touched(some, gaps) or _name(some, source)
        places = np.cumsum([leg.chord for leg in some], axis=0)
        far = [float(size) for size in np.linalg.norm(places, axis=1) if np.isfinite(size)]
        extent = max(far) if len(far) == len(places) else None
        repeat = 1 + sum(one.name == name for one in done)
        done.append(
            RecognizedMotion(name, source, group, some[0].start, some[-1].end, repeat, len(some), extent, reason)
        )
    return done


def _cycles(legs: Sequence[Leg], back: float) -> Iterator[list[Leg]]:
    """Legs until they are back where they began; what never comes back is one."""
    longest = max((float(np.linalg.norm(leg.chord)) for leg in legs), default=0.0)
    some: list[Leg] = []
    for leg in legs:
        if not some and float(np.linalg.norm(leg.chord)) < back * longest:
            continue  # it shakes, and goes nowhere
        some.append(leg)
        if float(np.linalg.norm(np.sum([one.chord for one in some], axis=0))) < back * longest:
            yield some
            some = []
    if some:
        yield some


def _touched(legs: Sequence[Leg], gaps: Floats) -> tuple[str, str] | None:
    """Unknown, for what a motion did in a gap is known to nobody."""
    for begin, end in gaps:
        if legs[0].start - REST_S < end and begin < legs[-1].end + REST_S:
            return "unknown", f"a gap of {end - begin:.4g} s after {begin:.6g} s touches it"
    return None


def _name(legs: Sequence[Leg], source: Source) -> tuple[str, str]:
    places = np.concatenate([np.zeros((1, 3)), np.cumsum([leg.chord for leg in legs], axis=0)])
    longest = max(float(np.linalg.norm(leg.chord)) for leg in legs)
    same = BACK[source] * longest
    if np.linalg.norm(places[-1]) > same:
        return "unknown", f"it ends {1e3 * np.linalg.norm(places[-1]):.1f} mm from where it began"
    if (bend := max(leg.bend for leg in legs)) > BENT[source]:
        return "unknown", f"a leg is not straight: it leaves its chord by {100 * bend:.0f} % of its length"
    for i, axis in enumerate("xyz"):
        if all(abs(leg.chord[i]) > ALONG * np.linalg.norm(leg.chord) for leg in legs):
            return axis, f"{len(legs)} straight legs along {axis}, back to where it began"
    if corners := _triangle(places, same):
        return "triangle", f"three straight sides between {corners}"
    return "unknown", f"{len(legs)} straight legs that are neither along one axis nor round a triangle"


def _triangle(places: Floats, same: float) -> str | None:
    """Three places of which every two are joined by a leg, all other legs between them and the start; as text."""
    nodes: list[Floats] = []
    visits = []
    for place in places:
        near = [i for i, node in enumerate(nodes) if np.linalg.norm(place - node) < same]
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


def _commanded(run: "SIRun") -> tuple[str, list[Leg], Floats]:
    columns = run.rig.columns_of(Target)
    if not columns:
        raise AnalysisError("the rig has no target")
    groups = run.groups_of(columns)
    if len(groups) > 1:
        raise AnalysisError("the target is on several loggers")
    values = np.zeros((run.group(groups[0]).samples, 3))
    for column in columns:
        values[:, "xyz".index(column.component)] = run.values(column)
    time = run.instants(columns[0])
    gaps = wide_steps(time)
    if not len(gaps):
        return groups[0], legs_of_acceleration(time, values, STILL["command"]), gaps
    return groups[0], _up_to(gaps, time, values), gaps


def _up_to(gaps: Floats, time: Floats, values: Floats) -> list[Leg]:
    """Legs of a commanded acceleration (n, 3) before its first gap; what comes from there on is one, whose chord is
    known to nobody: a speed is not integrated across a gap.
    """
    begin, end = gaps[0]
    before, size = time <= begin, np.linalg.norm(values, axis=1)
    moves = time[size > STILL["command"] * size.max()]
    legs = legs_of_acceleration(time[before], values[before], STILL["command"]) if before.sum() > 1 else []
    if not moves.size or moves[-1] < begin:
        return legs
    return [*legs, Leg(float(begin), max(float(moves[-1]), float(end)), np.full(3, np.nan), np.nan)]


def _encoded(run: "AlignedRun") -> tuple[str, list[Leg], Floats]:
    rate, mechanism = run.run.group(run.reference).rate_hz, run.unloaded
    bandwidth = min(BANDWIDTH_HZ, LARGEST_SHARE * rate if rate else BANDWIDTH_HZ)
    path, gaps = run.trajectory(bandwidth), list(run.gaps().spans.values())
    body, position = _driven(run)
    at = forward_kinematics.pose(mechanism.tree, np.ascontiguousarray(path.q.T))
    place = dense(at.point(mechanism.tree.bodies[mechanism.body_index(body)], position), at.count).T
    speed = np.linalg.norm(np.gradient(place, run.grid.step, axis=0), axis=1)
    return run.reference, legs_of_path(run.grid.time, place, speed, STILL["encoders"]), gaps[0] if gaps else NO_GAP


def _driven(run: "AlignedRun") -> tuple[str, Floats]:
    """The point whose path is the motion: of the accelerometer on what moves, else of the payload."""
    mechanism = run.unloaded
    for sensor in run.run.rig.of_kind(Accelerometer).values():
        if sensor.attached_to != "base":
            return sensor.attached_to, np.array(sensor.position)
    if len(mechanism.payload_bodies) != 1:
        raise AnalysisError(f"{mechanism.name} has {len(mechanism.payload_bodies)} payload bodies: expected one")
    body = mechanism.payload_bodies[0]
    return body, np.array(mechanism.centre(body))


def _felt(run: "SIRun") -> tuple[str, list[Leg], Floats]:
    """By an accelerometer on a body; its axes are taken for the base's, so what turns is not told by it."""
    for name, sensor in run.rig.of_kind(Accelerometer).items():
        columns = list(sensor.columns(name)) if sensor.attached_to != "base" else []
        if not columns:
            continue
        time = run.instants(columns[0])
        grid = grid_of(time, f"{run.name}: {name}")
        values = np.zeros((grid.count, 3))
        for column in columns:
            even = on_grid(time, run.values(column)[:, None], grid)[:, 0]
            rest = np.median(even[: max(len(even) // 20, 1)])
            values[:, "xyz".index(column.component)] = Band(0.0, BANDWIDTH_HZ).filtered(even - rest, grid.rate)
        return run.group_of(columns[0]), legs_of_acceleration(grid.time, values, STILL["acceleration"]), NO_GAP
    raise AnalysisError("the rig has no accelerometer on a body that moves")
