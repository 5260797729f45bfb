"""The rig file: which logger records which channel of which sensor, where the sensor is mounted, in which unit.

The mechanism's file is read only for the names of its bodies, joints and sites, without the library that models it, so
that a rig with a wrong name is refused at once.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar
from xml.etree.ElementTree import Element

from pydantic import Field
from pydantic.json_schema import SkipJsonSchema

from balance import datasets
from balance.errors import DataError, suggestion
from balance.input_files import Table, in_file, model_from_table, read_text, toml_tables, xml_root

from ..calibration.evaluation import Column
from ..errors import RigError
from . import sensors as kinds
from .bench import Bench, Logger
from .sensor_channels import LoggedSensor

NONE = "none"
"""The mechanism of a rig that has none, such as a force plate alone."""
MECHANISM_ON_BASE = ("mechanism", "base")
"""What a force sensor is between that tells what the mechanism shakes with."""
_BODIES, _JOINTS = {"body", "link"}, {"joint", "freejoint"}
_SUFFIXES = (".xml", ".mjcf", ".urdf", ".sdf")


@dataclass(frozen=True)
class MechanismNames:
    """Names of a mechanism's bodies, joints and sites."""

    mechanism: str
    bodies: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    sites: tuple[str, ...] = ()

    def unknown(self, kind: str, name: str) -> str | None:
        """Why a name of a ``body``, ``joint``, ``site`` or ``body or site`` is wrong; None if the mechanism has it."""
        of_kind = {"body": self.bodies, "joint": self.joints, "site": self.sites}
        known = of_kind.get(kind, (*self.bodies, *self.sites))
        if name in known:
            return None
        listed = ", ".join(known) or "none"
        return f"{self.mechanism} has no {kind} {name!r}: expected {listed}{suggestion(name, known)}"


def mechanism_names(name: str, folder: Path | None) -> MechanismNames | None:
    """The names in a shipped mechanism, or in a file in the rig's folder; None where the rig is for none.

    Raises RigError, listing what is shipped, if there is neither, and for a file that is no XML.
    """
    if name == NONE:
        return None
    path = mechanism_file(name, folder)
    if path is None:
        shipped = datasets.dataset_names("mechanisms", ".xml")
        place = "" if folder is None else f", and no file of that name in the rig's folder {folder}"
        raise RigError(
            f"mechanism: no shipped mechanism {name!r}{suggestion(name, shipped)}{place} "
            f"(there are: {', '.join(shipped)}; '{NONE}' for a bench without one)"
        )
    with in_file("mechanism"):
        root = xml_root(read_text(path, RigError), path.name, RigError)
        elements = list(root.iter())
        if any(element.tag in {"include", "attach", "replicate"} for element in elements):
            return None  # others are included, whose names are not known here
        masses = ((link, link.find("inertial/mass")) for link in root.iter("link"))  # without one a link is a site too
        massless = [
            link for link, mass in masses if mass is None or mass.get("value", mass.text or "").strip() in {"0", "0.0"}
        ]
        return MechanismNames(
            name,
            _names_of_tags(elements, _BODIES),
            _names_of_tags(elements, _JOINTS),
            _names_of_tags([e for part in root.iter("worldbody") for e in part.iter()], {"site"})
            + _names_of_tags(massless, {"link"}),
        )


def mechanism_file(name: str, folder: Path | None) -> Path | None:
    """The file of a mechanism in the rig's folder, else of the shipped one; None where there is neither."""
    shipped = datasets.ROOT / "mechanisms" / f"{name}.xml"
    own = [] if folder is None else [folder / name, *(folder / f"{name}{suffix}" for suffix in _SUFFIXES)]
    plain = Path(name).name == name and name not in {"", ".", ".."}
    return next((p for p in [*own, *([shipped] if plain else [])] if p.is_file()), None)


def _names_of_tags(elements: Iterable[Element], tags: set[str]) -> tuple[str, ...]:
    found = (element.get("name") for element in elements if element.tag in tags)
    return tuple(dict.fromkeys(name for name in found if name))


S = TypeVar("S", bound=Table)


class Rig(Table):
    """A test bench: its loggers, its sensors and, for simulated logs, the base; places are in the base frame.

    >>> import testbench
    >>> list(testbench.load_rig("parallelogram-6bar").base_accelerometers)
    ['base_acc']
    """

    name: str = ""
    """Name of the bench."""
    mechanism: str
    """A shipped mechanism by name, or a file in the rig's folder; ``none``: the bench stands without one."""
    loggers: dict[str, Logger] = Field(min_length=1)
    """Loggers by name."""
    sensors: dict[str, kinds.Sensor] = Field(min_length=1)
    """Sensors by name."""
    bench: Bench = Bench()
    """The bench on its mounts, for a simulation. Measured vibration is held against it only where it states `mass` and
    `mounts`: leave them out for a base that is bolted to a stiff floor."""
    text: SkipJsonSchema[str] = Field(default="", exclude=True)
    """The file as written."""
    source: SkipJsonSchema[str] = Field(default="rig", exclude=True)
    """What messages call the file."""
    names: SkipJsonSchema[MechanismNames | None] = Field(default=None, exclude=True)
    """Of the mechanism's parts, where its file was looked for."""
    folder: SkipJsonSchema[Path | None] = Field(default=None, exclude=True)
    """Where the rig's file lies, and that of its mechanism; None for a rig from its text."""

    def _check(self) -> None:
        """Loggers that exist, one sensor a channel; sensors then know the delay of their logger's filter."""
        seen: dict[str, str] = {}
        for name, sensor in self.sensors.items():
            if sensor.logger not in self.loggers:
                raise DataError(
                    f"sensors.{name}.logger: no logger {sensor.logger!r}: expected {', '.join(self.loggers)}"
                    f"{suggestion(sensor.logger, self.loggers)}"
                )
            sensor.set_delay(self.loggers[sensor.logger].delay)
            for channel in sensor.components.values():
                if channel in seen:
                    raise DataError(
                        f"sensors.{name}: channel {channel!r} is also that of sensors.{seen[channel]}: "
                        f"expected one sensor a channel{self._renamed(sensor.logger, seen[channel], channel)}"
                    )
                seen[channel] = name

    def _renamed(self, logger: str, other: str, channel: str) -> str:
        """What to do where two loggers call a channel alike."""
        if logger == self.sensors[other].logger:
            return ""
        return (
            "; where the logs of both loggers call one so, give each logger an import description (read_as) and rename "
            f"it in that of {logger}: channels = {{ {channel!r} = '{channel} {logger}' }}, which the sensor then names"
        )

    def columns(self, logger: str | None = None) -> Iterator[Column]:
        """The channels of one logger, or of all, in the order of the file."""
        for name, sensor in self.sensors.items():
            if logger in {None, sensor.logger}:
                yield from sensor.columns(name)

    def of_kind(self, kind: type[S]) -> dict[str, S]:
        """The sensors of a kind, by name."""
        return {name: sensor for name, sensor in self.sensors.items() if isinstance(sensor, kind)}

    def columns_of(self, kind: type[LoggedSensor]) -> list[Column]:
        """The channels of all sensors of a kind, in the order of the file."""
        return [column for name, sensor in self.of_kind(kind).items() for column in sensor.columns(name)]

    @property
    def base_columns(self) -> list[Column]:
        """The channels of the accelerometers on the base."""
        return [column for name, sensor in self.base_accelerometers.items() for column in sensor.columns(name)]

    @property
    def supports(self) -> dict[str, kinds.Support]:
        """The sensors through which the mechanism stands on the base."""
        return self.of_kind(kinds.Wrench) | self.of_kind(kinds.ForceSensor)

    @property
    def under_base(self) -> str:
        """Which force sensors carry the base as well, that they tell nothing of the mechanism, what to do; or empty."""
        others = {n: s.between for n, s in self.supports.items() if s.between != MECHANISM_ON_BASE}
        below = {n: f"between {' and '.join(between)}" for n, between in others.items()}
        if not below and self.bench.rider is not None:
            below = dict.fromkeys(self.supports, "under a part of the base (bench.rider)")
        if not below:
            return ""
        return (
            f"sensors {', '.join(below)}: force sensors {next(iter(below.values()))} carry what accelerates the base "
            "as well and are not used for what the mechanism shakes with: put them between mechanism and base "
            '(between = ["mechanism", "base"]), or tell it by the vibration of the base (trim --from vibration, trials)'
        )

    @property
    def base_accelerometers(self) -> dict[str, kinds.Accelerometer]:
        """The accelerometers on the base."""
        return {n: s for n, s in self.of_kind(kinds.Accelerometer).items() if s.attached_to == "base"}


def load_rig(path_or_text: str | Path) -> Rig:
    """Load a rig: a file, a shipped one by name, or the text of one. Raises RigError, naming the key that is wrong.

    Its mechanism must be there, and have the joints and bodies that the rig names.
    """
    if isinstance(path_or_text, str) and "\n" in path_or_text:
        return rig_from_text(path_or_text)
    try:
        path = datasets.find_dataset(path_or_text, "rigs", ".toml")
    except DataError as error:
        raise RigError(str(error)) from error
    rig = rig_from_text(read_text(path, RigError), path.name)
    try:
        names = mechanism_names(rig.mechanism, path.parent)
    except RigError as error:
        raise RigError(f"{path.name}: {error}") from error
    for sensor, described in rig.sensors.items():
        for key, kind in (("joint", "joint"), ("attached_to", "body")):
            named = getattr(described, key, None)
            if names is not None and named not in {None, "base"} and (wrong := names.unknown(kind, str(named))):
                raise RigError(f"{path.name}: sensors.{sensor}.{key}: {wrong}")
    return rig.model_copy(update={"names": names, "folder": path.parent})


def rig_from_text(text: str, source: str = "rig") -> Rig:
    """Read a rig from its text; ``source`` names it in messages."""
    table = toml_tables(text, source, RigError)
    if own := {"text", "source", "names", "folder"} & table.keys():
        raise RigError(f"{source}: {min(own)}: unknown key")
    return model_from_table(Rig, table | {"text": text, "source": source}, source, RigError)
