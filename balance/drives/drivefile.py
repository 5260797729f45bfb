"""Drive files (``datasets/drives``): which machine, motor, gearbox, inertias and loads, with units."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import datasets
from ..errors import CounterpoiseError, DataError
from ..loading.loading import load_mechanism
from . import fields, loadfile, motorfile
from .loads import Load
from .machine import READINGS, Inertia, Machine
from .motors import Motor
from .reduced import reduce

if TYPE_CHECKING:
    from ..mechanism import Mechanism

_KEYS = {
    "mechanism", "crank", "direction", "start_angle", "speeds", "motor", "gearbox", "inertia", "load", "printed",
}  # fmt: skip
SIDES = ("crank", "motor")


@dataclass(frozen=True)
class Printed:
    """What a source prints for one nominal speed; None where it prints nothing."""

    speed: float
    """Nominal speed of the motor [rad/s]."""
    fluctuation: float | None
    fastest: float | None
    """Of the crank [rad/s]."""
    slowest: float | None
    """Of the crank [rad/s]."""


@dataclass(frozen=True)
class DriveFile:
    """A drive as its file describes it; ``machine`` puts it together."""

    name: str
    mechanism: str
    """Name or path of the mechanism's file."""
    crank: str | None
    direction: int
    start_angle: float
    """Crank angle of start-up [rad]."""
    speeds: tuple[float, ...]
    """Nominal speeds of the motor [rad/s]."""
    motor: Motor
    ratio: float
    reading: str | None
    """How the gearbox's torque is read; None where the file leaves it open."""
    inertias: tuple[Inertia, ...]
    loads: tuple[Mapping[str, Any], ...] = ()
    """As in the file: their joints are known once the mechanism is loaded."""
    printed: tuple[Printed, ...] = field(default=())

    @classmethod
    def load(cls, name: str | Path) -> "DriveFile":
        """Load a shipped drive by name, or a TOML file. Raises DataError, naming the key that is wrong."""
        path = datasets.find(name, "drives", ".toml")
        try:
            return _read(tomllib.loads(path.read_text(encoding="utf-8")), path)
        except (tomllib.TOMLDecodeError, UnicodeDecodeError, CounterpoiseError) as error:
            raise DataError(f"{path.name}: {error}") from error

    @property
    def readings(self) -> tuple[str, ...]:
        """The reading that the file asks for, or all of them; without a gearbox they are one."""

        if self.reading is None and self.ratio != 1.0:
            return tuple(READINGS)
        return (self.reading or next(iter(READINGS)),)

    def load_mechanism(self) -> "Mechanism":
        """The mechanism of the drive."""
        return load_mechanism(self.mechanism)

    def machines(self, mechanism: "Mechanism") -> list[Machine]:
        """The machine at each nominal speed, in each reading of the gearbox that the file leaves open."""
        reduced = reduce(mechanism, self.crank, self.direction)
        try:
            loads: tuple[Load, ...] = tuple(loadfile.read(table, mechanism, reduced.crank) for table in self.loads)
        except CounterpoiseError as error:
            raise DataError(f"{self.name}: {error}") from error
        return [
            Machine(reduced, self.motor, self.ratio, reading, speed, self.inertias, loads)
            for speed in self.speeds
            for reading in self.readings
        ]

    def printed_at(self, speed: float) -> Printed | None:
        """What the source prints for a nominal speed [rad/s]."""
        return next((p for p in self.printed if abs(p.speed - speed) < 1e-9 * speed), None)


def _read(table: Mapping[str, Any], path: Path) -> DriveFile:
    fields.refuse_unknown(table, _KEYS)
    gearbox = fields.table(table, "gearbox", {"ratio", "reading"}) if "gearbox" in table else {}
    speeds = tuple(fields.speed(text, "speeds") for text in fields.texts(table, "speeds"))
    if not all(speed > 0.0 for speed in speeds):
        raise DataError("speeds: expected positive ones; direction = -1 turns the crank the other way")
    if any(abs(a - b) < 1e-9 * a for i, a in enumerate(speeds) for b in speeds[:i]):
        raise DataError(f"speeds is {table['speeds']!r}: holds one speed twice")
    return DriveFile(
        name=path.name,
        mechanism=_mechanism(fields.text(table, "mechanism"), path.parent),
        crank=fields.text(table, "crank") if "crank" in table else None,
        direction=fields.one_of(table.get("direction", 1), (1, -1), "direction"),
        start_angle=fields.quantity(table, "start_angle", "angle") if "start_angle" in table else 0.0,
        speeds=speeds,
        motor=motorfile.read(fields.table(table, "motor", None)),
        ratio=fields.positive(gearbox, "ratio") if "ratio" in gearbox else 1.0,
        reading=fields.one_of(gearbox["reading"], tuple(READINGS), "gearbox.reading") if "reading" in gearbox else None,
        inertias=tuple(_inertia(entry) for entry in fields.tables(table, "inertia")),
        loads=tuple(_placed(entry, path.parent) for entry in fields.tables(table, "load")),
        printed=tuple(_printed(entry) for entry in fields.tables(table, "printed")),
    )


def _mechanism(name: str, folder: Path) -> str:
    """A file beside the drive's own file, or else a name."""
    beside = folder / name
    return str(beside) if beside.is_file() else name


def _placed(load: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
    """A load whose file, if it names one, is looked for beside the drive's own."""
    return {**load, "file": str(folder / load["file"])} if isinstance(load.get("file"), str) else load


def _inertia(table: Mapping[str, Any]) -> Inertia:
    fields.refuse_unknown(table, {"name", "inertia", "side"})
    side = fields.one_of(fields.text(table, "side"), SIDES, "inertia.side")
    value = fields.quantity(table, "inertia", "inertia")
    if not value >= 0.0:
        raise DataError(f"inertia is {table['inertia']!r}: expected zero or more")
    return Inertia(str(table.get("name", "inertia")), value, side)


def _printed(table: Mapping[str, Any]) -> Printed:
    fields.refuse_unknown(table, {"speed", "fluctuation", "fastest", "slowest"})
    fluctuation = fields.positive(table, "fluctuation") if "fluctuation" in table else None
    fastest, slowest = (
        fields.speed(fields.text(table, key), key) if key in table else None for key in ("fastest", "slowest")
    )
    return Printed(fields.speed(fields.text(table, "speed"), "speed"), fluctuation, fastest, slowest)
