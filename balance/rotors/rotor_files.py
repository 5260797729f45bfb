"""Rotor files (``datasets/rotors``): a TOML file, or the table of unbalances alone as CSV."""

import cmath
from pathlib import Path
from typing import Annotated

from pydantic import Discriminator, Field, Tag

from .. import datasets
from ..errors import DataError
from ..input_files import Distinct, Quantity, Table, Text, Vector, csv_rows, in_file, model_from_table, read_toml
from .rotor import Plane, Rotor, Unbalance

_MODELS = {".xml", ".mjcf", ".urdf", ".sdf"}
Length = Annotated[float, Quantity("length")]
PositiveLength = Annotated[float, Quantity("length", above=0.0)]
PositiveMass = Annotated[float, Quantity("mass", above=0.0)]


class MassTable(Table):
    """A mass out of the axis: mass and radius, or their product; its angle and place are required."""

    name: Text | None = None
    """Name of it."""
    mass: Annotated[float, Quantity("mass")] | None = None
    """Mass; negative for a hole [kg]."""
    radius: Annotated[float, Quantity("length", at_least=0.0)] | None = None
    """Distance of the mass from the axis; turn the angle by 180 degrees instead of a negative one [m]."""
    unbalance: Annotated[float, Quantity("first moment", at_least=0.0)] | None = None
    """In place of mass and radius their product [kg m]."""
    angle: Annotated[float, Quantity("angle")]
    """Angle from the rotor's mark [rad]."""
    at: Length
    """Place along the axis [m]."""

    def _check(self) -> None:
        given = [key for key in ("mass", "radius", "unbalance") if getattr(self, key) is not None]
        if given not in (["mass", "radius"], ["unbalance"]):
            raise DataError(f"gives {' and '.join(given) or 'no mass'}: expected mass and radius, or unbalance")

    def as_unbalance(self, number: int) -> Unbalance:
        """Mass times radius at its angle."""
        product = self.unbalance if self.unbalance is not None else (self.mass or 0.0) * (self.radius or 0.0)
        return Unbalance(self.name or f"mass {number}", product * cmath.rect(1.0, self.angle), self.at)


class PlaneTable(Table):
    """A plane in which correction masses may be mounted."""

    name: Text
    """Name of it."""
    at: Length
    """Place along the axis [m]."""
    radius: PositiveLength | None = None
    """Radius of the correction mass, where it is given: the mass follows [m]."""
    mass: PositiveMass | None = None
    """Correction mass, where it is given: its radius follows [kg]."""

    def _check(self) -> None:
        if self.radius is not None and self.mass is not None:
            raise DataError("gives both radius and mass: m_b r_b is fixed, choose one of them")


class RotorTable(Table):
    """A rigid rotor: its unbalances, its correction planes, its bearings."""

    name: Text | None = None
    """Name of the rotor."""
    source: str = ""
    """Where it is from."""
    masses: Annotated[
        Annotated[Annotated[list[MassTable], Field(min_length=1), Distinct], Tag("tables")]
        | Annotated[Text, Tag("file")],
        Discriminator(lambda value: "file" if isinstance(value, str) else "tables"),
    ]
    """Masses out of the axis, or the CSV file in the same folder that lists them."""
    planes: Annotated[list[PlaneTable], Distinct] = Field(default_factory=list)
    """Planes for correction masses."""
    bearings: list[Length] = Field(default_factory=list)
    """Places of the two bearings along the axis [m]."""
    speed: Annotated[float, Quantity("angular velocity", above=0.0)] | None = None
    """Speed of rotation [rad/s]."""
    mass: PositiveMass | None = None
    """Mass of the whole rotor [kg]."""
    centre: Length | None = None
    """Place of its centre of mass along the axis [m]."""
    published: dict[str, Annotated[complex, Vector("first moment")]] = Field(default_factory=dict)
    """Corrections by plane that the source publishes, for comparison [kg m]."""

    def _check(self) -> None:
        if self.bearings and (len(self.bearings) != 2 or self.bearings[0] == self.bearings[1]):
            raise DataError(f"bearings: {self.bearings} m: expected two, in two places")
        if unknown := set(self.published) - {plane.name for plane in self.planes}:
            raise DataError(f"published: {min(unknown)!r} is no plane of this rotor")


def load_rotor(name: str | Path) -> Rotor:
    """Load a shipped rotor by name, a TOML file, or a CSV table of unbalances.

    Raises DataError, naming the mass and the key, for what is missing or wrong, and for a mechanism.
    """
    linkages = datasets.dataset_names("mechanisms", ".xml")
    if Path(name).suffix.lower() in _MODELS or (not Path(name).is_file() and str(name) in linkages):
        raise DataError(
            f"{name} is a mechanism: correction planes and the grades of ISO 21940-11 are for rigid rotors only, a "
            "linkage's shaking force does not turn with a shaft; use 'balance size' or 'balance linkage'"
        )
    path = datasets.find_dataset(name, "rotors", ".toml", ".csv")
    if path.suffix.lower() == ".csv":
        return Rotor(path.stem, load_unbalances(path))
    content = read_toml(path)
    if {"runs", "coefficients"} & content.keys():
        raise DataError(f"{path.name} is a run table of trial runs: use 'balance rotor influence'")
    table = model_from_table(RotorTable, content, path.name)
    if isinstance(table.masses, str):
        with in_file(path.name, "masses"):
            unbalances = load_unbalances(path.parent / table.masses)
    else:
        unbalances = tuple(mass.as_unbalance(i) for i, mass in enumerate(table.masses, 1))
    planes = tuple(Plane(plane.name, plane.at, plane.radius, plane.mass) for plane in table.planes)
    stated = tuple(table.bearings), table.speed, table.mass, table.centre, table.published, table.source
    return Rotor(table.name or path.stem, unbalances, planes, *stated)


def load_unbalances(path: Path) -> tuple[Unbalance, ...]:
    """Read unbalances from a CSV with the columns ``name, mass (kg), radius (mm), angle (deg), at (mm)``.

    Units stand in the header; ``unbalance (kg mm)`` may stand for mass and radius.
    """
    tables = csv_rows(MassTable, path)
    if not tables:
        raise DataError(f"{path.name}: holds no masses")
    return tuple(mass.as_unbalance(i) for i, mass in enumerate(tables, 1))
