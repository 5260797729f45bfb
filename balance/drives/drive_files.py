"""Drive files (``datasets/drives``): which machine, motor, gearbox, inertias and loads, with units."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from .. import datasets
from ..arrays import Floats
from ..errors import CounterpoiseError, DataError
from ..input_files import (
    Distinct,
    Measured,
    Positive,
    Quantity,
    Table,
    Text,
    csv_columns,
    in_file,
    load_model,
    read_text,
)
from ..mechanism.mjcf_parser import load_mechanism
from .equivalent_inertia import reduced_to_crank
from .machine import READINGS, Inertia, Load, Machine, Moment, Motor, PositiveSpeed, Speed

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

    from ..mechanism.mechanism import Mechanism

Angle = Annotated[float, Quantity("angle")]
Force = Annotated[float, Quantity("force")]


class _LoadTable(Table):
    name: Text | None = None
    """Name of the load; its kind where it is left out."""
    joint: Text | None = None
    """Joint that it acts on; the crank where it is left out."""

    @abstractmethod
    def load(self, index: int, turns: bool, folder: Path) -> Load:
        """The load at a coordinate. Raises DataError for a torque where the joint slides, a force where it turns."""

    def _given(self, turns: bool) -> tuple[str, str]:
        """Key and dimension of the load of a joint that turns or slides. Raises DataError where it is not given."""
        key, other = ("torque", "force") if turns else ("force", "torque")
        if getattr(self, other, None) is not None:
            raise DataError(f"unknown key {other!r}: its joint {'turns' if turns else 'slides'}: expected {key}")
        if getattr(self, key) is None and getattr(self, "file", None) is None:
            raise DataError(f"{key} is missing")
        return key, "moment" if turns else "force"


class FrictionTable(_LoadTable):
    """A load of constant size: dry, against the joint's motion, or constant, with the sign of a load over the angle."""

    kind: Literal["constant", "dry"]
    """Kind of load."""
    torque: Moment | None = None
    """Of a joint that turns [N m]."""
    force: Force | None = None
    """Of a joint that slides [N]."""

    def _check(self) -> None:
        if self.kind == "dry" and min(self.torque or 0.0, self.force or 0.0) < 0.0:
            raise DataError("torque or force: expected zero or more, the load opposes the motion")

    def load(self, index: int, turns: bool, folder: Path) -> Load:
        """The load at a coordinate."""
        return Load(self.name or self.kind, self.kind, index, getattr(self, self._given(turns)[0]))


class DragTable(_LoadTable):
    """A load in proportion to the joint's speed or to its square, against it."""

    kind: Literal["viscous", "quadratic"]
    """Kind of load."""
    torque: Annotated[float, Quantity("moment", at_least=0.0)] | None = None
    """Of a joint that turns, at the speed named [N m]."""
    force: Annotated[float, Quantity("force", at_least=0.0)] | None = None
    """Of a joint that slides, at the speed named [N]."""
    at_speed: Annotated[Measured[float], Quantity("angular velocity", "velocity", above=0.0)]
    """Speed at which it is as large as that [rad/s or m/s]."""

    def load(self, index: int, turns: bool, folder: Path) -> Load:
        """The load at a coordinate."""
        value = getattr(self, self._given(turns)[0])
        if (self.at_speed.dimension == "angular velocity") != turns:
            raise DataError(f"at_speed: its joint {'turns' if turns else 'slides'}: expected a speed of that")
        power = 1 if self.kind == "viscous" else 2
        return Load(self.name or self.kind, self.kind, index, value / self.at_speed.value**power)


class CurveTable(_LoadTable):
    """A load over the crank's angle, one turn; between the points a monotone cubic (PCHIP).

    A positive value pushes the joint towards smaller coordinates, whichever way it moves: weight of 50 N on a ram that
    slides along +y upwards is ``force = "50 N"``, gas that pushes the ram upwards is negative.
    """

    kind: Literal["table"]
    """Kind of load."""
    angle: list[Angle] | None = None
    """Angles of the crank, increasing, from 0 deg to less than 360 deg, or to 360 deg with the value of 0 deg [rad]."""
    torque: list[Moment] | None = None
    """At these angles, of a joint that turns [N m]."""
    force: list[Force] | None = None
    """At these angles, of a joint that slides [N]."""
    file: Text | None = None
    """In place of the lists a CSV in the folder of the drive file, its header such as ``angle (deg),force (N)``."""

    def _check(self) -> None:
        given = [key for key in ("angle", "torque", "force") if getattr(self, key) is not None]
        if self.file is not None and given:
            raise DataError(f"gives both file and {given[0]}: keep one of them")
        if self.file is None and self.angle is None:
            raise DataError("angle is missing: expected angle and torque or force, or file")

    def load(self, index: int, turns: bool, folder: Path) -> Load:
        """The load at a coordinate."""
        key, dimension = self._given(turns)
        if self.file is None:
            angles, values = self.angle, getattr(self, key)
        else:
            with in_file("file"):
                path = folder / self.file
                columns = csv_columns(read_text(path), path.name, {"angle": ("angle",), key: (dimension,)})
            angles, values = columns["angle"].value, columns[key].value
        return Load(self.name or self.kind, self.kind, index, 0.0, _periodic(np.array(angles), np.array(values), key))


class InertiaTable(Table):
    """An inertia that turns with a shaft."""

    name: Text | None = None
    """Name of it."""
    inertia: Annotated[float, Quantity("inertia", at_least=0.0)]
    """About its own shaft [kg m2]."""
    side: Literal["crank", "motor"]
    """Shaft that it turns with."""


class GearboxTable(Table):
    """The gearbox between motor and crank."""

    ratio: Positive = 1.0
    """Turns of the motor per turn of the crank."""
    reading: Literal["geared", "ungeared"] | None = None
    """Whether the torque is multiplied by the ratio; both are computed where it is left out."""


class PublishedSpeeds(Table):
    """What a source publishes for one nominal speed, for comparison and never in place of the solution."""

    speed: Speed
    """Nominal speed of the motor [rad/s]."""
    fluctuation: Positive | None = None
    """Coefficient of speed fluctuation."""
    fastest: Speed | None = None
    """Fastest speed of the crank [rad/s]."""
    slowest: Speed | None = None
    """Slowest speed of the crank [rad/s]."""


class DriveTable(Table):
    """A machine of one degree of freedom and its motor."""

    mechanism: Text
    """A shipped mechanism by name, or a file in the same folder."""
    crank: Text | None = None
    """Joint that turns; the one with the motor where it is left out."""
    direction: Literal[1, -1] = 1
    """Sense in which the crank turns."""
    start_angle: Angle = 0.0
    """Crank angle from which it starts up [rad]."""
    speeds: Annotated[list[PositiveSpeed], Field(min_length=1)]
    """Nominal speeds of the motor; ``direction`` turns the crank the other way [rad/s]."""
    motor: Annotated[Motor, Field(discriminator="kind")]
    """The motor."""
    gearbox: GearboxTable = GearboxTable()
    """The gearbox."""
    inertia: Annotated[list[InertiaTable], Distinct] = Field(default_factory=list)
    """Inertias on the shafts."""
    load: Annotated[list[Annotated[FrictionTable | DragTable | CurveTable, Field(discriminator="kind")]], Distinct] = (
        Field(default_factory=list)
    )
    """Loads on the joints."""
    printed: list[PublishedSpeeds] = Field(default_factory=list)
    """What a source publishes."""

    def _check(self) -> None:
        if any(abs(a - b) < 1e-9 * a for i, a in enumerate(self.speeds) for b in self.speeds[:i]):
            raise DataError("speeds: holds one speed twice")


@dataclass(frozen=True)
class Drive:
    """A drive as its file describes it; ``machines`` puts it together."""

    name: str
    table: DriveTable
    folder: Path
    """Folder of the files that it names."""

    def load_mechanism(self) -> "Mechanism":
        """The mechanism of the drive."""
        path = self.folder / self.table.mechanism
        return load_mechanism(path if path.is_file() else self.table.mechanism)

    def machines(
        self, mechanism: "Mechanism", speeds: Sequence[float] = (), reading: str | None = None
    ) -> list[Machine]:
        """The machine at each of ``speeds`` of its motor [rad/s], else at those of the file.

        The gearbox's torque is read as ``reading`` says, else the file; where neither does, once in each way, unless
        the ratio is one.
        """
        table = self.table
        reduced = reduced_to_crank(mechanism, table.crank, table.direction)
        loads = tuple(self._load(load, mechanism, reduced.crank) for load in table.load)
        inertias = tuple(Inertia(each.name or "inertia", each.inertia, each.side) for each in table.inertia)
        ratio, stated = table.gearbox.ratio, reading or table.gearbox.reading
        readings = [stated] if stated else list(READINGS)[: 2 if ratio != 1.0 else 1]
        return [
            Machine(reduced, table.motor, ratio, each, speed, inertias, loads)
            for speed in speeds or table.speeds
            for each in readings
        ]

    def _load(self, table: FrictionTable | DragTable | CurveTable, mechanism: "Mechanism", crank: str) -> Load:
        try:
            joint = mechanism.coordinate_index(table.joint or crank)
            return table.load(joint, mechanism.tree.joints[joint].revolute, self.folder)
        except CounterpoiseError as error:
            raise DataError(f"{self.name}: load {table.name or table.kind!r}: {error}") from error

    def published_at(self, speed: float) -> PublishedSpeeds | None:
        """What the source publishes for a nominal speed [rad/s]."""
        return next((p for p in self.table.printed if abs(p.speed - speed) < 1e-9 * speed), None)


def load_drive(name: str | Path) -> Drive:
    """Load a shipped drive by name, or a TOML file. Raises DataError, naming the key that is wrong."""
    path = datasets.find_dataset(name, "drives", ".toml")
    return Drive(path.name, load_model(DriveTable, path), path.parent)


def _periodic(angles: Floats, values: Floats, key: str) -> "PchipInterpolator":
    """Values over the crank's angle, periodic, a monotone cubic between the points."""
    from scipy.interpolate import PchipInterpolator

    turn = 2.0 * np.pi
    is_whole = len(angles) == len(values) > 1 and angles[0] == 0.0 and abs(angles[-1] - turn) < 1e-9
    if is_whole and values[-1] == values[0]:
        angles, values = angles[:-1], values[:-1]
    if len(angles) != len(values) or len(angles) < 3 or not (np.diff(angles) > 0.0).all():
        raise DataError(f"angle has {len(angles)}, {key} {len(values)} values: expected as many, angles increasing")
    if not (angles[0] >= 0.0 and angles[-1] < turn - 1e-9):
        span = f"{np.degrees(angles[0]):.6g} to {np.degrees(angles[-1]):.6g} deg"
        raise DataError(
            f"angle goes from {span}: expected one turn, from 0 deg to less than 360 deg, or to 360 deg with the value "
            "of 0 deg"
        )
    ends = slice(-2, None), slice(0, 2)
    return PchipInterpolator(
        np.r_[angles[ends[0]] - turn, angles, angles[ends[1]] + turn], np.r_[values[ends[0]], values, values[ends[1]]]
    )
