"""Motion files (``datasets/motions``): TOML with way-points, or with a CSV of samples."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag

from .. import datasets
from ..arrays import Floats
from ..errors import DataError
from ..input_files import Measured, Quantity, Table, Text, csv_columns, in_file, model_from_table, read_toml
from .motion import Motion, Samples

Acceleration = Annotated[Measured[float], Quantity("acceleration", "angular acceleration", above=0.0)]
Place = Annotated[Measured[float], Quantity("length", "angle")]
_LEAST_SAMPLES = 6
"""Of a quintic spline."""


class MoveTable(Table):
    """A move along one driven coordinate, leg by leg."""

    axis: Text | None = None
    """Axis along which the driven point moves."""
    joint: Text | None = None
    """Driven joint that moves."""
    to: Annotated[list[Place], Field(min_length=1)]
    """Ends of the legs, from the start of the motion [m or rad]."""


class TriangleTable(Table):
    """An isosceles triangle, its box centred on the start."""

    polygon: Literal["triangle"]
    """``triangle``, or a list of corners."""
    width: Place
    """Width of its box [m or rad]."""
    height: Place
    """Height of its box [m or rad]."""

    @property
    def corners(self) -> list[tuple[Measured[float], Measured[float]]]:
        """Corners in turn."""
        x, y, kind = self.width.value / 2, self.height.value / 2, self.width.dimension
        return [(Measured(u, kind), Measured(v, self.height.dimension)) for u, v in ((-x, -y), (x, -y), (0.0, y))]


class PolygonTable(Table):
    """Corners in turn about the start."""

    polygon: Annotated[list[tuple[Place, Place]], Field(min_length=3)]
    """Corners [x, y], from the start of the motion; closed, and back to the start [m or rad]."""

    @property
    def corners(self) -> list[tuple[Measured[float], Measured[float]]]:
        """Corners in turn."""
        return self.polygon


def _kind_of_move(value: object) -> str:
    if not isinstance(value, dict) or "polygon" not in value:
        return "leg"
    return "triangle" if isinstance(value["polygon"], str) else "polygon"


class MotionTable(Table):
    """A motion from rest to rest, of a point of the mechanism or of its driven joints."""

    driven: Literal["platform", "joints"] = "platform"
    """What is driven: a point of the mechanism, or joints."""
    point: Text | None = None
    """Driven body or site; by default the payload's body."""
    axes: Annotated[list[Literal["x", "y", "z"]], Field(min_length=1)] | None = None
    """Axes of the base along which the point moves; by default x and y."""
    joints: Annotated[list[Text], Field(min_length=1)] | None = None
    """Driven joints."""
    start: list[Place] | None = None
    """Start of each driven coordinate [m or rad]."""
    peak_acceleration: Acceleration | None = None
    """Along each leg [m/s2 or rad/s2]."""
    ramp: Annotated[float, Field(strict=True, ge=0.0, le=0.5)] | None = None
    """Share of each acceleration pulse spent in each of its two ramps; by default 0.25."""
    rest: Annotated[float, Quantity("time", at_least=0.0)] | None = None
    """Rest before the first leg and after each [s]."""
    moves: (
        Annotated[
            list[
                Annotated[
                    Annotated[MoveTable, Tag("leg")]
                    | Annotated[TriangleTable, Tag("triangle")]
                    | Annotated[PolygonTable, Tag("polygon")],
                    Discriminator(_kind_of_move),
                ]
            ],
            Field(min_length=1),
        ]
        | None
    ) = None
    """Moves in turn."""
    samples: Text | None = None
    """Instead of start and moves: a CSV in this folder, ``time (s)`` and ``x (m)``, ``A0 (rad)`` or ``slide (m)``."""

    @property
    def names(self) -> tuple[str, ...]:
        """Driven joints, or axes along which the point moves."""
        return tuple(self.joints or self.axes or ("x", "y"))

    def _check(self) -> None:
        _refuse_unused(self, ("point", "axes") if self.driven == "joints" else ("joints",), f"driven = {self.driven!r}")
        if self.driven == "joints" and self.joints is None:
            raise DataError("joints: missing: expected the names of the driven joints")
        if len(set(self.names)) < len(self.names):
            raise DataError(f"{'joints' if self.joints else 'axes'}: {list(self.names)}: expected each once")
        if self.samples is not None:
            _refuse_unused(self, ("start", "peak_acceleration", "ramp", "rest", "moves"), "samples")
            return
        for key in ("start", "peak_acceleration", "moves"):
            if getattr(self, key) is None:
                raise DataError(f"{key}: missing, or give samples")
        if len(self.start or ()) != len(self.names):
            raise DataError(
                f"start: has {len(self.start or ())} values: expected one for each of {', '.join(self.names)}"
            )


def load_motion(name: str | Path) -> Motion:
    """Load a shipped motion by name, or a TOML file. Raises DataError, naming the key that is wrong."""
    path = datasets.find_dataset(name, "motions", ".toml")
    return motion_from_table(read_toml(path), path.parent, path.name)


def motion_from_table(content: Mapping[str, Any], folder: Path = Path(), source: str = "motion") -> Motion:
    """Build a motion from the keys of a motion file; ``folder`` is where a file of samples is looked for.

    Raises DataError, naming the key that is wrong.
    """
    table = model_from_table(MotionTable, content, source)
    joints = tuple(table.joints or ())
    axes = ("x", "y") if joints else table.names
    with in_file(source):
        if table.samples is not None:
            with in_file("samples"):
                recorded = _samples(folder / table.samples, joints, table.point, axes)
            return Motion(recorded.position[:1], 0.0, 0.25, 0.0, joints, table.point, axes, recorded, recorded.sliding)
        assert table.start is not None
        assert table.peak_acceleration is not None
        kind = table.start[0].dimension if joints else "length"
        wanted = "acceleration" if kind == "length" else "angular acceleration"
        peak = _value_of(table.peak_acceleration, wanted, "peak_acceleration")
        points = _waypoints(table, kind)
    sliding = kind == "length" if joints else None
    ramp = 0.25 if table.ramp is None else table.ramp
    return Motion(points, peak, ramp, table.rest or 0.0, joints, table.point, axes, sliding=sliding)


def _samples(path: Path, joints: tuple[str, ...], point: str | None, axes: tuple[str, ...]) -> Samples:
    """A motion from a CSV; velocity and acceleration are those of the quintic spline through the samples."""
    from scipy.interpolate import make_interp_spline

    possible = ("angle", "length") if joints else ("length",)
    columns = csv_columns(path, {"time": ("time",)} | dict.fromkeys(joints or axes, possible))
    time, *coordinates = (np.array(column.value) for column in columns.values())
    if len(time) < _LEAST_SAMPLES or not (np.diff(time) > 0).all():
        raise DataError(f"{path.name}: expected at least {_LEAST_SAMPLES} rows with increasing time")
    kinds = {columns[name].dimension for name in joints}
    if len(kinds) > 1:
        raise DataError(f"{path.name}: gives angles and lengths: expected one kind for all joints of a motion")
    position = np.column_stack(coordinates)
    spline = make_interp_spline(time, position, k=5)
    sliding = kinds == {"length"} if joints else None
    return Samples(time, position, spline(time, 1), spline(time, 2), joints, point, axes, sliding)


def _waypoints(table: MotionTable, kind: str) -> Floats:
    """Start and ends of the legs, (k, d) [m or rad]."""
    start = np.array([_value_of(place, kind, f"start[{i}]") for i, place in enumerate(table.start or ())])
    points = [start]
    for i, move in enumerate(table.moves or ()):
        with in_file(f"moves[{i}]"):
            steps = _leg(move, table, kind) if isinstance(move, MoveTable) else _polygon(move, table.names, kind)
        points.extend(start + step for step in steps)
    distinct = [points[0], *(b for a, b in zip(points, points[1:], strict=False) if not np.array_equal(a, b))]
    if len(distinct) < 2:
        raise DataError("moves: nothing moves: expected an end that differs from the start")
    return np.array(distinct)


def _leg(move: MoveTable, table: MotionTable, kind: str) -> list[Floats]:
    """Way-points of one move along a coordinate, from the start of the motion."""
    key, other = ("joint", "axis") if table.joints else ("axis", "joint")
    if getattr(move, other) is not None:
        raise DataError(f"{other}: the motion drives {', '.join(table.names)}: expected {key}")
    if (name := getattr(move, key)) not in table.names:
        raise DataError(f"{key}: {name!r}: expected one of {', '.join(table.names)}")
    unit = np.eye(len(table.names))[table.names.index(name)]
    return [_value_of(place, kind, f"to[{i}]") * unit for i, place in enumerate(move.to)]


def _polygon(move: TriangleTable | PolygonTable, names: tuple[str, ...], kind: str) -> list[Floats]:
    """Corners in turn, closed, and back to the start."""
    if len(names) != 2:
        raise DataError(f"polygon: a corner has two coordinates, but the motion drives {', '.join(names)}")
    at = [np.array([_value_of(place, kind, "polygon") for place in corner]) for corner in move.corners]
    return [*at, at[0], np.zeros(2)]


def _value_of(measured: Measured[float], dimension: str, key: str) -> float:
    """A value of the one dimension of the motion. Raises DataError for another."""
    if measured.dimension != dimension:
        raise DataError(f"{key}: is {measured.dimension}: expected {dimension}, as in start")
    return measured.value


def _refuse_unused(table: MotionTable, keys: tuple[str, ...], other: str) -> None:
    if idle := [key for key in keys if getattr(table, key) is not None]:
        raise DataError(f"{idle[0]}: has no effect with {other}: remove one of them")
