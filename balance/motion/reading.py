"""Motion files: TOML with way-points, or with a CSV of samples."""

import csv
import tomllib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .. import datasets
from ..arrays import Floats
from ..drive import AXES
from ..errors import DataError, UnitError
from ..quantities import parse
from .motion import Motion, Samples

_KEYS = {
    "driven", "point", "axes", "joints", "start", "peak_acceleration", "ramp", "rest", "moves", "samples",
}  # fmt: skip


def load_motion(name: str | Path) -> Motion:
    """Load a shipped motion by name, or a TOML file. Raises DataError, naming the key that is wrong."""
    path = datasets.find(name, "motions", ".toml")
    try:
        return motion_from_table(tomllib.loads(path.read_text(encoding="utf-8-sig")), path.parent)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, UnitError, DataError) as error:
        raise DataError(f"{path.name}: {error}") from error


def motion_from_table(table: Mapping[str, object], folder: Path = Path()) -> Motion:
    """Build a motion from the keys of a motion file; ``folder`` is where a file of samples is looked for."""
    _refuse_unknown(table, _KEYS)
    joints, point, axes = _driven(table)
    if "samples" in table:
        _refuse_idle(table, {"start", "peak_acceleration", "ramp", "rest", "moves"}, "samples")
        recorded = read_samples(folder / str(table["samples"]), joints, point, axes)
        return Motion(recorded.position[:1], 0.0, 0.25, 0.0, joints, point, axes, recorded, recorded.sliding)
    names, kind = joints or axes, _kind(_texts(table, "start")) if joints else "length"
    start = np.array([parse(text, kind) for text in _texts(table, "start")])
    if len(start) != len(names):
        raise DataError(f"start has {len(start)} values: expected one for each of {', '.join(names)}")
    points = _waypoints(start, _required(table, "moves"), names, "joint" if joints else "axis", kind)
    sliding = kind == "length" if joints else None
    return Motion(points, *_pace(table, kind), joints, point, axes, sliding=sliding)


def _driven(table: Mapping[str, object]) -> tuple[tuple[str, ...], str | None, tuple[str, ...]]:
    """Driven joints, or the driven point and the axes along which it moves."""
    driven, point = table.get("driven", "platform"), table.get("point")
    if driven not in {"platform", "joints"}:
        raise DataError(f"driven is {driven!r}: expected 'platform' or 'joints'")
    joints = tuple(_texts(table, "joints")) if driven == "joints" else ()
    axes = tuple(_texts(table, "axes")) if "axes" in table else ("x", "y")
    if unknown := [axis for axis in axes if axis not in AXES]:
        raise DataError(f"axes has {unknown[0]!r}: expected x, y or z")
    names = joints or axes
    if len(set(names)) < len(names):
        raise DataError(f"{'joints' if joints else 'axes'} is {list(names)}: expected each once")
    if point is not None and not isinstance(point, str):
        raise DataError(f"point is {point!r}: expected the name of a body or a site")
    _refuse_idle(table, {"point", "axes"} if joints else {"joints"}, f"driven = {driven!r}")
    return joints, point, axes


def _pace(table: Mapping[str, object], kind: str) -> tuple[float, float, float]:
    """Peak acceleration [m/s2 or rad/s2], share of a ramp, and rest [s]."""
    turning = "angular " if kind == "angle" else ""
    acceleration = parse(str(_required(table, "peak_acceleration")), f"{turning}acceleration")
    if not acceleration > 0:
        raise DataError(f"peak_acceleration is {table['peak_acceleration']!r}: expected a positive one")
    ramp, rest = table.get("ramp", 0.25), parse(str(table.get("rest", "0 s")), "time")
    if not isinstance(ramp, int | float) or not 0.0 <= ramp <= 0.5:
        raise DataError(f"ramp is {ramp!r}: expected a share of the pulse from 0 to 0.5")
    if not rest >= 0:
        raise DataError(f"rest is {table['rest']!r}: expected zero or more")
    return acceleration, float(ramp), rest


def read_samples(path: Path, joints: tuple[str, ...], point: str | None, axes: tuple[str, ...]) -> Samples:
    """Read a motion from a CSV with the columns ``time (s)`` and ``x (m)``, ``y (m)``, or ``A0 (rad)``, ``slide (m)``.

    Velocity and acceleration are those of the quintic spline through the samples.
    """
    from scipy.interpolate import make_interp_spline

    columns = ["time (s)", *(f"{name} ({'rad' if joints else 'm'})" for name in joints or axes)]
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            names, *rows = (row for row in csv.reader(stream) if row)
        sliding = bool(joints) and f"{joints[0]} (m)" in names
        if sliding:
            columns = ["time (s)", *(f"{name} (m)" for name in joints)]
        places = [names.index(name) for name in columns]
        values = np.array([[float(row[i]) for i in places] for row in rows]).reshape(-1, len(columns))
    except FileNotFoundError as error:
        raise DataError(f"samples: no such file {path.name!r}") from error
    except (IndexError, ValueError) as error:
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
