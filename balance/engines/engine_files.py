"""Engine files (``datasets/engines``): cylinders, counterweights, firing order; and an engine as a mechanism file."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pydantic import Field

from .. import datasets
from ..errors import DataError
from ..input_files import Count, Distinct, Number, Quantity, Table, Text, Vector, load_model
from ..rotors.rotor import Unbalance
from .engine import Cylinder, Engine
from .slider_crank import SliderCrank

DEFAULT_RATIO = 0.25
"""Crank radius over rod length where a file gives no sizes."""
_SMALL = 1e-9
"""Inertia given to a body that has none, which the mechanism file does not allow [kg m2]."""
Length = Annotated[float, Quantity("length")]
PositiveLength = Annotated[float, Quantity("length", above=0.0)]
MassOrZero = Annotated[float, Quantity("mass", at_least=0.0)]
InertiaOrZero = Annotated[float, Quantity("inertia", at_least=0.0)]
Angle = Annotated[float, Quantity("angle")]


class SliderCrankTable(Table):
    """Crank, connecting rod and piston of every cylinder."""

    crank_radius: PositiveLength
    """Crank radius [m]."""
    rod_length: PositiveLength
    """Connecting rod, pin to pin [m]."""
    crank_mass: MassOrZero = 0.0
    """Mass of the crank, counterweights not included [kg]."""
    crank_centre: Length = 0.0
    """Centre of mass of the crank along its throw; negative is opposite the pin [m]."""
    crank_inertia: InertiaOrZero = 0.0
    """Of the crank about its own centre of mass [kg m2]."""
    rod_mass: MassOrZero = 0.0
    """Mass of the rod [kg]."""
    rod_centre: Length | None = None
    """Centre of mass of the rod from the crank pin [m]."""
    rod_inertia: InertiaOrZero = 0.0
    """Of the rod about its own centre of mass [kg m2]."""
    piston_mass: MassOrZero
    """Piston, pin and all that only slides [kg]."""
    offset: Length = 0.0
    """Of the cylinder's axis from the crank's, positive to the side where the pin goes from top dead centre [m]."""

    def _check(self) -> None:
        if self.rod_mass > 0.0 and self.rod_centre is None:
            raise DataError("rod_centre is missing: how far the rod's centre of mass is from the crank pin")
        self.slider_crank()

    def slider_crank(self) -> SliderCrank:
        """The slider-crank. Raises DataError for one that cannot turn right round."""
        return SliderCrank(
            self.crank_radius, self.rod_length, self.crank_mass, self.crank_centre, self.crank_inertia, self.rod_mass,
            self.rod_centre or 0.0, self.rod_inertia, self.piston_mass, self.offset,
        )  # fmt: skip


class CounterweightTable(Table):
    """A counterweight on the crankshaft."""

    name: Text
    """Name of it."""
    unbalance: Annotated[complex, Vector("first moment")]
    """Mass times radius at its angle from the crankshaft's mark [kg m]."""
    at: Number
    """Place along the crankshaft, in spacings as that of the cylinders."""


class EngineTable(Table):
    """Cylinders of any bank angle and throw along one crankshaft; without [slider_crank] a layout without sizes."""

    name: Text | None = None
    """Name of the engine."""
    source: str = ""
    """Where it is from."""
    throws: Annotated[list[Angle], Field(min_length=1)]
    """Angle of each cylinder's throw from the crankshaft's mark [rad]."""
    banks: list[Angle] | None = None
    """Angle of each cylinder's axis from upright [rad]; 0 where it is left out."""
    at: list[Number] | None = None
    """Place of each cylinder along the crankshaft, in spacings; 0, 1, 2 ... where it is left out."""
    spacing: PositiveLength | None = None
    """Of the cylinders [m]."""
    speed: Annotated[float, Quantity("angular velocity", above=0.0)] | None = None
    """Speed of the crankshaft [rad/s]."""
    strokes: Literal[2, 4] = 4
    """Strokes of a working cycle."""
    firing_order: list[Count] | None = None
    """Cylinders, counted from 1, in the order in which they fire."""
    slider_crank: SliderCrankTable | None = None
    """Sizes and masses of every cylinder."""
    counterweights: Annotated[list[CounterweightTable], Distinct] = Field(default_factory=list)
    """Counterweights on the crankshaft."""

    def _check(self) -> None:
        count = len(self.throws)
        for key in ("banks", "at"):
            if (found := getattr(self, key)) is not None and len(found) != count:
                raise DataError(f"{key}: has {len(found)} values: expected one for each of the {count} throws")
        order = self.firing_order
        if order is not None and sorted(order) != list(range(1, count + 1)):
            raise DataError(f"firing_order: {order}: expected the cylinders 1 to {count}, once each")
        if self.counterweights and self.slider_crank is None:
            raise DataError("counterweights: need [slider_crank]: a layout has no sizes to weigh them against")
        apart = any(
            place != 0.0 for place in [*(self.at or range(count)), *(weight.at for weight in self.counterweights)]
        )
        if self.slider_crank is not None and self.spacing is None and apart:
            raise DataError("spacing is missing: expected the distance of the cylinders, such as '95 mm'")


def load_engine(name: str | Path, ratio: float = DEFAULT_RATIO) -> Engine:
    """Load a shipped engine by name, or a TOML file. Raises DataError, naming the key that is wrong.

    A file without [slider_crank] is a layout: its engine has m r = 1 kg m, the spacing 1 m, and r / l = ``ratio``.
    """
    table, stem = _table(name)
    if table.slider_crank is None:
        return load_layout(name, ratio)
    spacing = table.spacing or 0.0
    weights = tuple(Unbalance(each.name, each.unbalance, spacing * each.at) for each in table.counterweights)
    return replace(_engine(table, stem, table.slider_crank.slider_crank(), spacing), counterweights=weights)


def load_layout(name: str | Path, ratio: float = DEFAULT_RATIO) -> Engine:
    """Load an engine as a layout, without its sizes, for comparing engines."""
    table, stem = _table(name)
    if not 0.0 < ratio < 1.0:
        raise DataError(f"ratio r / l is {ratio:g}: expected more than 0 and less than 1")
    engine = _engine(table, stem, SliderCrank(1.0, 1.0 / ratio, piston_mass=1.0), 1.0)
    return replace(engine, speed=None, normalised=True)


def _table(name: str | Path) -> tuple[EngineTable, str]:
    path = datasets.find_dataset(name, "engines", ".toml")
    return load_model(EngineTable, path), path.stem


def _engine(table: EngineTable, stem: str, crank: SliderCrank, spacing: float) -> Engine:
    count = len(table.throws)
    described = zip(table.at or range(count), table.throws, table.banks or [0.0] * count, strict=True)
    cylinders = tuple(Cylinder(place * spacing, throw, bank, crank) for place, throw, bank in described)
    order = tuple(table.firing_order or ())
    return Engine(table.name or stem, cylinders, (), table.strokes, order, table.speed, source=table.source)


# As a mechanism file (MJCF), for Pinocchio, MuJoCo and the other commands of ``balance``


def mjcf(engine: Engine) -> str:
    """The engine as MJCF text: crankshaft about z, rods on its pins, pistons in their cylinders, loops by <connect>.

    The crankshaft must have mass, as the format asks of every body that moves. The file starts with the crankshaft's
    mark along x and every rod towards its cylinder, the way an engine is put together.
    """
    if any(c.crank.rod_mass <= 0.0 or c.crank.piston_mass <= 0.0 for c in engine.cylinders):
        raise DataError(
            f"{engine.name}: a mechanism file needs rods and pistons with mass: give rod_mass and piston_mass"
        )
    root = Element("mujoco", model="".join(letter if letter.isalnum() else "-" for letter in engine.name))
    SubElement(root, "compiler", angle="radian")
    SubElement(root, "option", gravity="0.0 0.0 0.0")
    base = SubElement(SubElement(root, "worldbody"), "body", name="base")
    shaft = SubElement(base, "body", name="crankshaft")
    SubElement(shaft, "joint", name="crankshaft", type="hinge", axis="0 0 1")
    _crank_inertia(shaft, engine)
    equality = SubElement(root, "equality")
    rods, pistons = [], []
    for i, cylinder in enumerate(engine.cylinders, 1):
        crank, axis = cylinder.crank, np.exp(1j * cylinder.bank)
        pin, foot = crank.radius * np.exp(1j * cylinder.throw), 1j * axis * crank.offset
        rod = _body(shaft, f"rod_{i}", pin, cylinder.at, "hinge", "0 0 1")
        _inertial(rod, crank.rod_centre, crank.rod_mass, max(crank.rod_inertia, _SMALL))
        SubElement(rod, "site", name=f"rod_{i}_end", pos=_vector(crank.rod_length, 0, 0))
        piston = _body(base, f"piston_{i}", foot, cylinder.at, "slide", _vector(axis.real, axis.imag, 0))
        _inertial(piston, 0.0, crank.piston_mass, crank.piston_mass * crank.radius**2)
        SubElement(piston, "site", name=f"piston_{i}_pin", pos="0 0 0")
        SubElement(equality, "connect", name=f"pin_{i}", site1=f"rod_{i}_end", site2=f"piston_{i}_pin")
        own = cylinder.throw - cylinder.bank
        lean = -np.arcsin((crank.radius * np.sin(own) - crank.offset) / crank.rod_length)
        rods.append(cylinder.bank + lean)
        pistons.append(crank.radius * np.cos(own) + crank.rod_length * np.cos(lean))
    SubElement(SubElement(root, "actuator"), "motor", name="starter", joint="crankshaft")
    SubElement(SubElement(root, "keyframe"), "key", name="home", qpos=_vector(0.0, *rods, *pistons))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _vector(*values: float) -> str:
    return " ".join(repr(float(value)) for value in values)


def _body(parent: Element, name: str, place: complex, at: float, kind: str, axis: str) -> Element:
    """A body at x + iy and ``at`` along the crankshaft, and its joint of the same name."""
    body = SubElement(parent, "body", name=name, pos=_vector(place.real, place.imag, at))
    SubElement(body, "joint", name=name, type=kind, axis=axis)
    return body


def _inertial(body: Element, along: float, mass: float, inertia: float) -> None:
    moments = _vector(inertia, inertia, inertia)
    SubElement(body, "inertial", pos=_vector(along, 0, 0), mass=_vector(mass), diaginertia=moments)


def _crank_inertia(shaft: Element, engine: Engine) -> None:
    """Throws and counterweights as one rigid body; a counterweight is a point mass at one crank radius."""
    points = [(c.crank.crank_mass, c.crank.crank_centre * np.exp(1j * c.throw), c.at) for c in engine.cylinders]
    radius = engine.cylinders[0].crank.radius
    for weight in engine.counterweights:
        mass = abs(weight.vector) / radius
        points.append((mass, weight.vector / mass if mass else 0j, weight.at))
    masses = np.array([mass for mass, _, _ in points])
    places = np.array([(at.real, at.imag, z) for _, at, z in points])
    mass = float(masses.sum())
    if mass <= 0.0:
        raise DataError(f"{engine.name}: a mechanism file needs a crankshaft with mass: give crank_mass")
    centre = masses @ places / mass
    inertia = np.eye(3) * sum(cylinder.crank.crank_inertia for cylinder in engine.cylinders)
    for m, place in zip(masses, places - centre, strict=True):
        inertia += m * (place @ place * np.eye(3) - np.outer(place, place))
    if np.linalg.eigvalsh(inertia)[0] < _SMALL:
        inertia += _SMALL * np.eye(3)
    full = _vector(*inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
    SubElement(shaft, "inertial", pos=_vector(*centre), mass=_vector(mass), fullinertia=full)
