"""An engine as a mechanism file (MJCF), so that its forces are held against the dynamics of any mechanism."""

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from balance.engines.engine import Engine

_SMALL = 1e-9
"""Inertia given to a body that has none, which the mechanism file does not allow [kg m2]."""


def mjcf(engine: Engine) -> str:
    """The engine as MJCF text: crankshaft about z, rods on its pins, pistons in their cylinders, loops by <connect>.

    The crankshaft must have mass, as the format asks of every body that moves. The file starts with the crankshaft's
    mark along x and every rod towards its cylinder, the way an engine is put together.
    """
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
    points = []
    for cylinder in engine.cylinders:
        at = cylinder.crank.crank_centre * np.exp(1j * cylinder.throw)
        points.append((cylinder.crank.crank_mass, at.real, at.imag, cylinder.at))
    radius = engine.cylinders[0].crank.radius
    for weight in engine.counterweights:
        mass = abs(weight.vector) / radius
        at = weight.vector / mass if mass else 0j
        points.append((mass, at.real, at.imag, weight.at))
    masses, places = np.array(points)[:, 0], np.array(points)[:, 1:]
    mass = float(masses.sum())
    centre = masses @ places / mass
    inertia = np.eye(3) * sum(cylinder.crank.crank_inertia for cylinder in engine.cylinders)
    for m, place in zip(masses, places - centre, strict=True):
        inertia += m * (place @ place * np.eye(3) - np.outer(place, place))
    if np.linalg.eigvalsh(inertia)[0] < _SMALL:
        inertia += _SMALL * np.eye(3)
    full = _vector(*inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
    SubElement(shaft, "inertial", pos=_vector(*centre), mass=_vector(mass), fullinertia=full)
