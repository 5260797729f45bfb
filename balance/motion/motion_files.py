"""Motion files (``datasets/motions``): TOML with way-points, or with a CSV of samples."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag

from .. import datasets
from ..arrays import Floats
from ..datasets import files_read
from ..errors import DataError
from ..input_files import (
    Measured,
    Quantity,
    Table,
    Text,
    csv_columns,
    in_file,
    model_from_table,
    read_text,
    toml_tables,
)
from .motion import Motion, Samples

Acceleration = Annotated[Measured[float], Quantity("acceleration", "angular acceleration", above=0.0)]
Place = Annotated[Measured[float], Quantity("length", "angle")]
_LEAST_SAMPLES = 6
"""Of a quintic spline, and at each end those whose quartic gives its third and fourth derivative there."""


class MoveTable(Table):
    """A move along one driven coordinate, leg by leg."""

    axis: Text | None = None
    """Axis along which the driven point moves."""
    joint: Text | None = None
    """Driven joint that moves."""
    to: Annotated[list[Place], Field(min_length=1)]
    """Where each leg ends, counted from the start of the motion [m or rad]."""


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
    """Corners [x, y], counted from the start; the motion goes round them and back to the start [m or rad]."""

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
    """Start of each driven coordinate, in the base's axes [m or rad]; needed unless ``samples`` are given."""
    peak_acceleration: (
        Annotated[
            Annotated[Acceleration, Tag("one")] | Annotated[list[Acceleration], Tag("each")],
            Discriminator(lambda value: "each" if isinstance(value, list) else "one"),
        ]
        | None
    ) = None
    """Peak acceleration of every leg, or a list: one for each driven coordinate [m/s2 or rad/s2]; left out: of each
    run, that of the run table or plan."""
    ramp: Annotated[float, Field(strict=True, ge=0.0, le=0.5)] | None = None
    """Share of an acceleration pulse that its rise takes, and its fall; by default 0.25."""
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
    """In place of start and moves a CSV in this folder: ``time (s)``, then columns as ``x (m)`` or ``A0 (rad)``; also
    in other units that the column names, ``time (ms)``, ``A0 (deg)``. An angle goes on counting beyond half a turn: one
    that wraps round is refused. Instants and positions need all their digits: the acceleration is their second
    difference, and commands say what few digits, noise, gaps or a clock make of it (`coarse_samples`)."""

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
        for key in ("start", "moves"):
            if getattr(self, key) is None:
                raise DataError(f"{key}: missing, or give samples")
        if len(self.start or ()) != len(self.names):
            raise DataError(
                f"start: has {len(self.start or ())} values: expected one for each of {', '.join(self.names)}"
            )


def load_motion(name: str | Path) -> Motion:
    """Load a shipped motion by name, or a TOML file. Raises DataError, naming the key that is wrong."""
    path = datasets.find_dataset(name, "motions", ".toml")
    with files_read() as files:
        found = motion_from_texts(path.name, *motion_texts(path))
    return replace(found, files=tuple(files))


def motion_texts(path: Path) -> tuple[str, ...]:
    """The text of a motion file, and that of its samples where it has some: all that the motion is made of.

    Raises DataError for a file that cannot be read, and for samples outside the motion's folder.
    """
    text = read_text(path)
    samples = toml_tables(text, path.name).get("samples")
    if not isinstance(samples, str):
        return (text,)
    with in_file(path.name, "samples"):
        if Path(samples).is_absolute() or ".." in Path(samples).parts:
            raise DataError(f"{samples!r}: expected a file in the motion's folder")
        return text, read_text(path.parent / samples)


def motion_from_texts(source: str, text: str, samples: str | None = None) -> Motion:
    """A motion from the texts of its files, as :func:`motion_texts` gives them; ``source`` is what messages call it."""
    return motion_from_table(toml_tables(text, source), source, samples)


def motion_from_table(content: Mapping[str, Any], source: str = "motion", samples: str | None = None) -> Motion:
    """Build a motion from the keys of a motion file; ``samples`` is the text of its CSV, where it has one.

    Raises DataError, naming the key that is wrong.
    """
    table = model_from_table(MotionTable, content, source)
    joints = tuple(table.joints or ())
    axes = ("x", "y") if joints else table.names
    with in_file(source):
        if table.samples is not None:
            with in_file("samples"):
                recorded = _samples(samples or "", table.samples, joints, table.point, axes)
            position, sliding = recorded.position[:1], recorded.sliding
            return Motion(position, np.empty(0), 0.25, 0.0, joints, table.point, axes, recorded, sliding, source)
        points, peak = _waypoints(table)
    sliding = tuple(place.dimension == "length" for place in table.start or ()) if joints else ()
    ramp = 0.25 if table.ramp is None else table.ramp
    return Motion(points, peak, ramp, table.rest or 0.0, joints, table.point, axes, sliding=sliding, source=source)


def _samples(text: str, source: str, joints: tuple[str, ...], point: str | None, axes: tuple[str, ...]) -> Samples:
    """A motion from the text of a CSV; velocity and acceleration by the quintic spline through the samples."""
    from scipy.interpolate import make_interp_spline

    possible = ("angle", "length") if joints else ("length",)
    columns = csv_columns(text, source, {"time": ("time",)} | dict.fromkeys(joints or axes, possible))
    time, *coordinates = (np.array(column.value) for column in columns.values())
    if len(time) < _LEAST_SAMPLES:
        raise DataError(f"{source}: {len(time)} rows: expected at least {_LEAST_SAMPLES} rows with increasing time")
    if not (np.diff(time) > 0).all():
        at = int(np.argmin(np.diff(time) > 0))
        goes = f"time goes from {time[at]:.9g} s to {time[at + 1]:.9g} s"
        raise DataError(f"{source}, line {at + 3}: {goes}: expected increasing time")
    position = np.column_stack(coordinates)
    for name, values in zip(joints, position.T, strict=False):
        at = int(np.argmax(np.abs(np.diff(values))))
        if columns[name].dimension == "angle" and abs(values[at + 1] - values[at]) > np.pi:
            goes = f"{name} goes from {values[at]:.4g} rad to {values[at + 1]:.4g} rad"
            raise DataError(
                f"{source}, line {at + 3}: {goes}: expected at most half a turn a sample; an angle that wraps round "
                "must go on counting (numpy.unwrap)"
            )
    ends: Any = _end(time, position), _end(time[::-1], position[::-1])
    spline = make_interp_spline(time, position, k=5, bc_type=ends)
    sliding = tuple(columns[name].dimension == "length" for name in joints)
    return Samples(time, position, spline(time, 1), spline(time, 2), joints, point, axes, sliding)


def _end(time: Floats, position: Floats) -> list[tuple[int, Floats]]:
    """Order and value (d,) of derivatives at the first of the samples (n,), (n, d), by least squares of the nearest: by
    the spline's own the acceleration there has ten times the noise of the others.
    """
    span = time[_LEAST_SAMPLES - 1] - time[0]
    near = (time[:_LEAST_SAMPLES] - time[0]) / span
    of = np.polynomial.polynomial.polyfit(near, position[:_LEAST_SAMPLES], 4)
    return [(3, 6.0 * of[3] / span**3), (4, 24.0 * of[4] / span**4)]


def _waypoints(table: MotionTable) -> tuple[Floats, Floats]:
    """Start and ends of the legs, (k, d) [m or rad], and the peak acceleration of each leg, (k - 1,)."""
    kinds = [place.dimension if table.joints else "length" for place in table.start or ()]
    start = np.array([_value_of(place, kinds[i], f"start[{i}]") for i, place in enumerate(table.start or ())])
    peaks = _peak_accelerations(table, kinds)
    points, legs = [start], list[float]()
    for i, move in enumerate(table.moves or ()):
        with in_file(f"moves[{i}]"):
            along, steps = _leg(move, table, kinds) if isinstance(move, MoveTable) else _polygon(move, table, kinds)
            if len({peaks[k] for k in along}) > 1:
                raise DataError("polygon: its two coordinates have different peak accelerations: expected one")
        for step in steps:
            if not np.array_equal(start + step, points[-1]):
                points.append(start + step)
                legs.append(peaks[along[0]])
    if not legs:
        raise DataError("moves: nothing moves: expected an end that differs from the start")
    return np.array(points), np.array(legs)


def _peak_accelerations(table: MotionTable, kinds: list[str]) -> list[float]:
    """Of each driven coordinate [m/s2 or rad/s2]."""
    given = table.peak_acceleration
    if given is None:
        return [math.nan] * len(kinds)
    listed = given if isinstance(given, list) else [given] * len(kinds)
    if len(listed) != len(kinds):
        raise DataError(f"peak_acceleration: has {len(listed)} values: expected one, or one for each coordinate")
    if not isinstance(given, list) and len(set(kinds)) > 1:
        raise DataError(
            f"peak_acceleration: some joints turn and some slide: expected a list, one for each of {table.names}"
        )
    wanted = ["acceleration" if kind == "length" else "angular acceleration" for kind in kinds]
    return [_value_of(m, kind, "peak_acceleration") for m, kind in zip(listed, wanted, strict=True)]


def _leg(move: MoveTable, table: MotionTable, kinds: list[str]) -> tuple[list[int], list[Floats]]:
    """The coordinate that moves, and way-points along it, from the start of the motion."""
    key, other = ("joint", "axis") if table.joints else ("axis", "joint")
    if getattr(move, other) is not None:
        raise DataError(f"{other}: the motion drives {', '.join(table.names)}: expected {key}")
    if (name := getattr(move, key)) not in table.names:
        raise DataError(f"{key}: {name!r}: expected one of {', '.join(table.names)}")
    at = table.names.index(name)
    unit = np.eye(len(table.names))[at]
    return [at], [_value_of(place, kinds[at], f"to[{i}]") * unit for i, place in enumerate(move.to)]


def _polygon(
    move: TriangleTable | PolygonTable, table: MotionTable, kinds: list[str]
) -> tuple[list[int], list[Floats]]:
    """Both coordinates, and corners in turn, closed, and back to the start."""
    if len(table.names) != 2 or len(set(kinds)) > 1:
        raise DataError(f"polygon: a corner has two coordinates, but the motion drives {', '.join(table.names)}")
    at = [np.array([_value_of(place, kinds[0], "polygon") for place in corner]) for corner in move.corners]
    return [0, 1], [*at, at[0], np.zeros(2)]


def _value_of(measured: Measured[float], dimension: str, key: str) -> float:
    """A value of its coordinate's dimension. Raises DataError for another."""
    if measured.dimension != dimension:
        raise DataError(f"{key}: is {measured.dimension}: expected {dimension}, as in start")
    return measured.value


def _refuse_unused(table: MotionTable, keys: tuple[str, ...], other: str) -> None:
    if idle := [key for key in keys if getattr(table, key) is not None]:
        raise DataError(f"{idle[0]}: has no effect with {other}: remove one of them")
