"""Motions of the platform or of joints (``datasets/motions``): moves of limited jerk, polygons, samples of a file."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from . import datasets
from .arrays import Floats
from .drive import AXES, Drive, JointDrive, PointDrive
from .errors import DataError, UnitError
from .mechanism import Mechanism
from .quantities import parse

_KEYS = {
    "driven", "point", "axes", "joints", "start", "peak_acceleration", "ramp", "rest", "moves", "samples",
}  # fmt: skip
_SAMPLES_IN_RAMP = 2.0
_MAX_SAMPLES = 50_000_000
DEFAULT_RATE_HZ = 10_000.0
"""Sampling of a motion where none is asked for [Hz]: 15 samples in the shortest ramp of the test motions."""


@dataclass(frozen=True)
class Samples:
    """A motion of the driven coordinates at instants."""

    time: Floats
    """Time, (n,) [s]."""
    position: Floats
    """Driven coordinates, (n, d) [m or rad]."""
    velocity: Floats
    """Their rates, (n, d) [m/s or rad/s]."""
    acceleration: Floats
    """Their second rates, (n, d) [m/s2 or rad/s2]."""
    joints: tuple[str, ...] = ()
    """Driven joints; empty where a point is driven."""
    point: str | None = None
    """Driven body (its own centre of mass) or site; None for the mechanism's payload body, or its only ``platform``."""
    axes: tuple[str, ...] = ("x", "y")
    """Axes of the base along which the point is driven."""
    sliding: bool | None = None
    """Whether driven joints are given in lengths, not angles; None where it is not said."""

    def check(self) -> None:
        """Raise DataError for a motion without samples, of unequal shapes, or with values that are not finite."""
        count = len(self.time)
        if not count:
            raise DataError("the motion holds no sample")
        for name in ("position", "velocity", "acceleration"):
            values = getattr(self, name)
            if values.ndim != 2 or len(values) != count:
                raise DataError(f"{name} of the motion has the shape {values.shape}: expected {count} rows, as time")
            if not np.isfinite(values).all():
                at = int(np.argmax(~np.isfinite(values).all(axis=1)))
                raise DataError(f"{name} of the motion is not finite at t = {self.time[at]:.6g} s")

    def drive(self, mechanism: Mechanism) -> Drive:
        """The driven coordinates as functions of a mechanism's joints. Raises ModelError for an unknown name."""
        if self.joints:
            return JointDrive.of(mechanism, self.joints, self.sliding)
        return PointDrive.of(mechanism, self.point or _platform(mechanism), self.axes)


def _platform(mechanism: Mechanism) -> str:
    return mechanism.payload_bodies[0] if mechanism.payload_bodies else "platform"


@dataclass(frozen=True)
class Motion:
    """A motion from rest to rest through way-points on straight lines, or samples of a file.

    Each leg is one pulse of acceleration and one of deceleration, both trapezoids whose ramps take the share ``ramp``
    of the pulse each: jerk is limited. A leg of length d and peak acceleration a takes two pulses of
    T = sqrt(d / (a (1 - ramp))).
    """

    waypoints: Floats
    """Start and ends of the legs, (k, d) [m or rad]."""
    peak_acceleration: float
    """Along each leg [m/s2 or rad/s2]."""
    ramp: float
    """Share of each acceleration pulse spent in each of its two ramps, 0 to 0.5."""
    rest: float
    """Rest before the first leg and after each [s]."""
    joints: tuple[str, ...] = ()
    point: str | None = None
    axes: tuple[str, ...] = ("x", "y")
    recorded: Samples | None = None
    """Samples of a file, in place of legs."""
    sliding: bool | None = None
    """Whether driven joints are given in lengths, not angles."""

    @classmethod
    def load(cls, name: str | Path) -> "Motion":
        """Load a shipped motion by name, or a TOML file. Raises DataError, naming the key that is wrong."""
        path = datasets.find(name, "motions", ".toml")
        try:
            return cls.from_table(tomllib.loads(path.read_text(encoding="utf-8")), path.parent)
        except (tomllib.TOMLDecodeError, UnicodeDecodeError, UnitError, DataError) as error:
            raise DataError(f"{path.name}: {error}") from error

    @classmethod
    def from_table(cls, table: Mapping[str, object], folder: Path = Path()) -> "Motion":
        """Build a motion from the keys of a motion file; ``folder`` is where a file of samples is looked for."""
        _refuse_unknown(table, _KEYS)
        joints = tuple(_texts(table, "joints")) if table.get("driven", "platform") == "joints" else ()
        if table.get("driven", "platform") not in {"platform", "joints"}:
            raise DataError(f"driven is {table['driven']!r}: expected 'platform' or 'joints'")
        axes = tuple(_texts(table, "axes")) if "axes" in table else ("x", "y")
        if unknown := [axis for axis in axes if axis not in AXES]:
            raise DataError(f"axes has {unknown[0]!r}: expected x, y or z")
        names = joints or axes
        if len(set(names)) < len(names):
            raise DataError(f"{'joints' if joints else 'axes'} is {list(names)}: expected each once")
        point = table.get("point")
        if point is not None and not isinstance(point, str):
            raise DataError(f"point is {point!r}: expected the name of a body or a site")
        _refuse_idle(
            table, {"point", "axes"} if joints else {"joints"}, f"driven = '{'joints' if joints else 'platform'}'"
        )
        if "samples" in table:
            _refuse_idle(table, {"start", "peak_acceleration", "ramp", "rest", "moves"}, "samples")
            recorded = read_samples(folder / str(table["samples"]), joints, point, axes)
            return cls(recorded.position[:1], 0.0, 0.25, 0.0, joints, point, axes, recorded, recorded.sliding)
        kind = _kind(_texts(table, "start")) if joints else "length"
        start = np.array([parse(text, kind) for text in _texts(table, "start")])
        if len(start) != len(names):
            raise DataError(f"start has {len(start)} values: expected one for each of {', '.join(names)}")
        turning = "angular " if kind == "angle" else ""
        acceleration = parse(str(_required(table, "peak_acceleration")), f"{turning}acceleration")
        if not acceleration > 0:
            raise DataError(f"peak_acceleration is {table['peak_acceleration']!r}: expected a positive one")
        ramp, rest = table.get("ramp", 0.25), parse(str(table.get("rest", "0 s")), "time")
        if not isinstance(ramp, int | float) or not 0.0 <= ramp <= 0.5:
            raise DataError(f"ramp is {ramp!r}: expected a share of the pulse from 0 to 0.5")
        if not rest >= 0:
            raise DataError(f"rest is {table['rest']!r}: expected zero or more")
        points = _waypoints(start, _required(table, "moves"), names, "joint" if joints else "axis", kind)
        sliding = kind == "length" if joints else None
        return cls(points, acceleration, float(ramp), rest, joints, point, axes, sliding=sliding)

    def with_peak_acceleration(self, acceleration: float) -> "Motion":
        """The same path with another peak acceleration [m/s2 or rad/s2]."""
        if self.recorded is not None:
            raise DataError("a motion of recorded samples has the acceleration that it has: it cannot be set")
        if not acceleration > 0:
            raise DataError(f"peak acceleration is {acceleration:g}: expected a positive one")
        return replace(self, peak_acceleration=acceleration)

    @property
    def duration(self) -> float:
        """From the first to the last instant [s]."""
        if self.recorded is not None:
            return float(self.recorded.time[-1] - self.recorded.time[0])
        return float(self._phases()[0][-1])

    def sample(self, rate_hz: float) -> Samples:
        """Sample the motion at a uniform rate; samples of a file come as they are, whatever the rate."""
        if self.recorded is not None:
            return self.recorded
        if not 0 < rate_hz * self.duration < _MAX_SAMPLES:
            raise DataError(f"{rate_hz:g} Hz for {self.duration:g} s: expected fewer than {_MAX_SAMPLES} samples")
        self._refuse_coarse(rate_hz)
        time = np.arange(int(np.ceil(self.duration * rate_hz)) + 1) / rate_hz
        return Samples(time, *self._at(time), self.joints, self.point, self.axes, self.sliding)

    def _refuse_coarse(self, rate_hz: float) -> None:
        """Raise DataError where samples would step over the ramps, or the pulses, of the acceleration."""
        legs = np.linalg.norm(np.diff(self.waypoints, axis=0), axis=1)
        pulse = float(np.sqrt(legs.min() / (self.peak_acceleration * (1.0 - self.ramp))))
        shortest = pulse * (self.ramp or 1.0)
        if rate_hz * shortest < _SAMPLES_IN_RAMP:
            raise DataError(
                f"{rate_hz:g} Hz is too slow for this motion, whose acceleration changes within {shortest:.3g} s: "
                f"expected at least {_SAMPLES_IN_RAMP / shortest:.3g} Hz"
            )

    def _at(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Position, velocity, acceleration: p = p0 + v0 t + a0 t2/2 + j t3/6 within each phase of constant jerk."""
        ends, p0, v0, a0, jerk = self._phases()
        phase = np.searchsorted(ends[:-1], time, side="right") - 1
        t = (np.minimum(time, ends[-1]) - ends[phase])[:, None]
        p, v, a, j = p0[phase], v0[phase], a0[phase], jerk[phase]
        return p + t * (v + t * (a / 2 + t * j / 6)), v + t * (a + t * j / 2), a + t * j

    def _phases(self) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Bounds of the phases of constant jerk (k + 1,) and the state at the start of each, (k, d)."""
        duration, jerk = [self.rest], [np.zeros(self.waypoints.shape[1])]
        for start, end in zip(self.waypoints, self.waypoints[1:], strict=False):
            for seconds, share in self._leg(float(np.linalg.norm(end - start))):
                duration.append(seconds)
                jerk.append(share * (end - start) / np.linalg.norm(end - start))
            duration.append(self.rest)
            jerk.append(np.zeros_like(start))
        ends = np.concatenate([[0.0], np.cumsum(duration)])
        p, v, a = [self.waypoints[0]], [np.zeros_like(jerk[0])], [np.zeros_like(jerk[0])]
        for t, j in zip(duration, jerk, strict=True):
            p.append(p[-1] + t * (v[-1] + t * (a[-1] / 2 + t * j / 6)))
            v.append(v[-1] + t * (a[-1] + t * j / 2))
            a.append(a[-1] + t * j)
        return ends, np.array(p[:-1]), np.array(v[:-1]), np.array(a[:-1]), np.array(jerk)

    def _leg(self, length: float) -> list[tuple[float, float]]:
        """Durations [s] and jerks of a leg of ``length``, the acceleration being a step where ``ramp`` is zero."""
        pulse = np.sqrt(length / (self.peak_acceleration * (1.0 - self.ramp)))
        ramp, flat = max(self.ramp, 1e-9) * pulse, (1.0 - 2.0 * max(self.ramp, 1e-9)) * pulse
        jerk = self.peak_acceleration / ramp
        return [(ramp, jerk), (flat, 0.0), (ramp, -jerk), (ramp, -jerk), (flat, 0.0), (ramp, jerk)]


def read_samples(path: Path, joints: tuple[str, ...], point: str | None, axes: tuple[str, ...]) -> Samples:
    """Read a motion from a CSV with the columns ``time (s)`` and ``x (m)``, ``y (m)``, or ``A0 (rad)``, ``slide (m)``.

    Velocity and acceleration are those of the quintic spline through the samples.
    """
    import pandas
    from scipy.interpolate import make_interp_spline

    columns = ["time (s)", *(f"{name} ({'rad' if joints else 'm'})" for name in joints or axes)]
    try:
        table = pandas.read_csv(path)
        sliding = bool(joints) and f"{joints[0]} (m)" in table
        if sliding:
            columns = ["time (s)", *(f"{name} (m)" for name in joints)]
        values = table[columns].to_numpy(dtype=float)
    except FileNotFoundError as error:
        raise DataError(f"samples: no such file {path.name!r}") from error
    except (KeyError, ValueError) as error:
        raise DataError(f"samples: {path.name} must hold the columns {', '.join(columns)} of numbers") from error
    time = values[:, 0]
    if len(time) < 6 or not np.isfinite(values).all() or not (np.diff(time) > 0).all():
        raise DataError(f"samples: {path.name} must hold at least 6 finite rows with increasing time")
    spline = make_interp_spline(time, values[:, 1:], k=5)
    return Samples(
        time, values[:, 1:], spline(time, 1), spline(time, 2), joints, point, axes, sliding if joints else None
    )


def _kind(texts: list[str]) -> str:
    """``angle`` or ``length``, by the unit of the first quantity: joints that one motion drives are of one kind."""
    try:
        parse(texts[0], "length")
    except UnitError:
        return "angle"
    return "length"


def _waypoints(start: Floats, moves: object, names: tuple[str, ...], key: str, kind: str) -> Floats:
    points = [start]
    if not isinstance(moves, list) or not moves or not all(isinstance(move, dict) for move in moves):
        raise DataError("moves: expected a list of tables such as { axis = 'x', to = ['+40 mm', '0 mm'] }")
    for i, move in enumerate(moves):
        try:
            points.extend(start + step for step in _steps(move, names, key, kind))
        except (UnitError, DataError) as error:
            raise DataError(f"moves[{i}]: {error}") from error
    kept = [points[0], *(b for a, b in zip(points, points[1:], strict=False) if not np.array_equal(a, b))]
    if len(kept) < 2:
        raise DataError("moves: nothing moves")
    return np.array(kept)


def _steps(move: Mapping[str, object], names: tuple[str, ...], key: str, kind: str) -> list[Floats]:
    """Way-points of one move, from the start of the motion; ``key`` names what moves, ``kind`` its quantity."""
    if "polygon" in move:
        _refuse_unknown(move, {"polygon", "width", "height"})
        return _polygon(move, names, kind)
    _refuse_unknown(move, {key, "to"})
    name = _required(move, key)
    if name not in names:
        raise DataError(f"{key} is {name!r}: expected one of {', '.join(names)}")
    unit = np.eye(len(names))[names.index(str(name))]
    return [parse(text, kind) * unit for text in _texts(move, "to")]


def _polygon(move: Mapping[str, object], names: tuple[str, ...], kind: str) -> list[Floats]:
    """Corners in turn, closed, and back to the start; a triangle is isosceles, its box centred on the start."""
    if len(names) != 2:
        raise DataError(f"polygon: a corner has two coordinates, but the motion drives {', '.join(names)}")
    corners = move["polygon"]
    if corners == "triangle":
        width, height = (parse(str(_required(move, key)), kind) for key in ("width", "height"))
        at = [np.array([x, y]) for x, y in ((-width / 2, -height / 2), (width / 2, -height / 2), (0.0, height / 2))]
    elif isinstance(corners, list) and len(corners) > 2 and all(isinstance(c, list) and len(c) == 2 for c in corners):
        at = [np.array([parse(str(text), kind) for text in corner]) for corner in corners]
    else:
        raise DataError(f"polygon is {corners!r}: expected 'triangle' with width and height, or a list of [x, y]")
    return [*at, at[0], np.zeros(2)]


def _required(table: Mapping[str, object], key: str) -> object:
    if key not in table:
        raise DataError(f"{key} is missing")
    return table[key]


def _texts(table: Mapping[str, object], key: str) -> list[str]:
    values = _required(table, key)
    if not isinstance(values, list) or not values or not all(isinstance(value, str) for value in values):
        raise DataError(f"{key} is {values!r}: expected a list of texts, each with its unit where it is a quantity")
    return [str(value) for value in values]


def _refuse_idle(table: Mapping[str, object], keys: set[str], beside: str) -> None:
    if idle := sorted(keys & table.keys()):
        raise DataError(f"{idle[0]} means nothing beside {beside}: take one of them out")


def _refuse_unknown(table: Mapping[str, object], known: set[str]) -> None:
    if unknown := [key for key in table if key not in known]:
        raise DataError(f"unknown key {unknown[0]!r}: expected {', '.join(sorted(known))}")
