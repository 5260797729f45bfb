"""URDF and SDF files as a Robot, with the loops that a YAML file beside a URDF states.

Geometry is left out: in both formats it carries no mass.
"""

import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any
from xml.etree.ElementTree import Element

import numpy as np
from pydantic import Field

from ..datasets import files_read, note_files
from ..errors import ModelError
from ..input_files import Table, json_document, model_from_table
from .mjcf_compiler import read_text
from .robot import Link, Placement, Robot, RobotJoint
from .robot_elements import BOUNDED, ENDS, Reader, parsed, refused_loop, rotation_of
from .sdf_files import SdfModel, put_included

_LOOPS_COMMENT = re.compile(r"<!-- counterpoise loops: (.*?) -->", re.S)
"""Where a mechanism's text keeps, as JSON, what the YAML file beside it said."""


class RobotLoops(Table):
    """Loops, motors and start of a URDF, in a YAML file of its name, as Gepetto/example-parallel-robots has them."""

    closed_loop: list[list[str]] = Field(default_factory=list)
    """Pairs of names of links, or of joints, which stand for their child links."""
    type: list[str] = Field(default_factory=list)
    """Of each loop: ``3d`` where its points coincide; ``6d``, the default, where the axes do too."""
    joint_name: list[str] = Field(default_factory=list)
    """Joints of another type than in the URDF; those that it does not have are passed over."""
    joint_type: list[str] = Field(default_factory=list)
    """Of each of them: SPHERICAL, FIXED, or UJOINT_ZY with two axes."""
    name_mot: list[str] = Field(default_factory=list)
    """Joints with a motor."""
    home: dict[str, Annotated[float, Field(allow_inf_nan=False)]] = Field(default_factory=dict)
    """Of joints that do not start at zero, where [rad, m]: from there loops are closed, and a motion begins."""


_SIDECAR_KEYS = tuple(RobotLoops.model_fields)


def read_robot(text: str, file: str, path: Path | None) -> tuple[Robot, str]:
    """A robot from the text of a URDF or SDF file, ``path`` where it is one, and the text with its loops in it.

    The YAML beside a URDF has its name and the form of Gepetto/example-parallel-robots: ``closed_loop``, pairs of names
    of links or joints; ``type`` of each, 3d or else 6d; ``joint_name`` and ``joint_type`` of joints that are SPHERICAL,
    FIXED or UJOINT_ZY (two letters); ``name_mot``, the motors; joints that are absent are passed over, as there. What
    joints start at, ``home``, is this project's.
    """
    root = parsed(text, file)
    if root.tag == "sdf" and put_included(root, file, None if path is None else path.parent):
        text = ElementTree.tostring(root, encoding="unicode")
    is_sdf = root.tag == "sdf"
    robot = SdfModel(root, file).robot(root.findtext("world/gravity")) if is_sdf else _urdf(root, file)
    if not robot.links:
        raise ModelError(f"{file}: has no <link>; expected links and joints")
    stored = _LOOPS_COMMENT.search(text)
    told = json_document(stored[1], file, ModelError) if stored else {} if path is None else _sidecar(path)
    loops = model_from_table(RobotLoops, told, file, ModelError).model_dump(exclude_unset=True)
    if loops and not stored:
        text = f"{text.rstrip()}\n<!-- counterpoise loops: {json.dumps(loops).replace('>', chr(92) + 'u003e')} -->\n"
    return _with_loops(robot, loops), text


def _sidecar(path: Path) -> dict[str, Any]:
    """What the YAML beside a URDF says; nothing where there is none. Raises ModelError for loops of another name."""
    import yaml

    found: dict[str, Any] = {}
    for other in sorted({*path.parent.glob("*.yaml"), *path.parent.glob("*.yml")})[:100]:
        own = other.stem == path.stem
        of_another = not own and other.with_suffix(".urdf").is_file()
        if of_another or not other.resolve().is_relative_to(path.parent.resolve()):
            continue
        with files_read() as files:
            text = read_text(other)
        if "closed_loop" not in text and not own:
            continue
        try:
            data = yaml.safe_load(text)
        except (
            yaml.YAMLError,
            ValueError,
            LookupError,
            AttributeError,
            RecursionError,
        ) as error:  # by its constructors
            raise ModelError(f"{other.name}: no YAML: {' '.join(str(error).split())}") from error
        if not isinstance(data, dict) or not any(key in data for key in _SIDECAR_KEYS):
            continue
        if not own and not path.with_suffix(".yaml").is_file():
            raise ModelError(
                f"{path.name}: the YAML file {other.name} states loops; name it {path.stem}.yaml if it is meant"
            )
        if own:
            found = {key: data[key] for key in _SIDECAR_KEYS if key in data}
            note_files(files)
    stated = {key: value for key, value in found.items() if value is not None}
    return model_from_table(RobotLoops, stated, f"{path.stem}.yaml", ModelError).model_dump(exclude_unset=True)


def _with_loops(robot: Robot, stated: Mapping[str, Any]) -> Robot:
    joints = dict(robot.joints)
    for name, kind in zip(stated.get("joint_name") or (), stated.get("joint_type") or (), strict=False):
        if name not in joints:
            continue
        letters = re.fullmatch(r"UJOINT_([XYZ])([XYZ])", kind)
        if letters:
            units = {f"_{letter}": np.eye(3)["XYZ".index(letter)] for letter in letters.groups()}
            joints[name] = replace(joints[name], kind="universal", axes=units)
        elif kind in ("SPHERICAL", "FIXED"):
            joints[name] = replace(joints[name], kind=kind.lower())
        else:
            raise ModelError(f"{robot.file}: joint_type {kind!r} of {name!r}: expected SPHERICAL, FIXED or UJOINT_XY")
    pairs, kinds = stated.get("closed_loop") or [], stated.get("type") or []
    if any(len(pair) != 2 for pair in pairs):
        raise ModelError(f"{robot.file}: closed_loop: expected pairs of names of links or joints")
    kinds = [*kinds, *["6d"] * (len(pairs) - len(kinds))]
    loops = tuple((*pair, kind.lower() != "3d") for pair, kind in zip(pairs, kinds, strict=False))
    motors = tuple(name for name in stated.get("name_mot") or () if name in joints)
    return replace(robot, joints=joints, loops=loops, motors=motors, home=stated.get("home") or {})


def _urdf(root: Element, file: str) -> Robot:
    if root.tag != "robot":
        raise ModelError(f"{file}: expected a URDF file with root <robot>, found <{root.tag}>")
    read = Reader(file)
    for element in root.iterfind("gazebo/joint"):
        raise refused_loop(element, file)
    reflected: dict[str, float] = {}
    for element in root.iterfind("transmission"):
        for motor in element.iterfind("actuator"):
            for name in (joint.get("name", "") for joint in element.iterfind("joint")):
                inertia = read.armature(motor.find("gear_ratio"), motor.find("rotor_inertia"), f"joint {name!r}")
                reflected[name] = reflected.get(name, 0.0) + inertia

    def origin(element: Element | None, where: str) -> Placement:
        found = None if element is None else element.find("origin")
        values = [
            read.numbers("0 0 0" if found is None else found.get(key, "0 0 0"), 3, f"{key} of {where}")
            for key in ("xyz", "rpy")
        ]
        return Placement(values[0], rotation_of(*values[1]))

    links, joints = {}, {}
    for name, element in read.named(root, "link").items():
        own, where = element.find("inertial"), f"the inertial of link {name!r}"
        if own is not None:
            mass = read.number(own.find("mass"), "value", None, where)
            links[name] = Link(mass, origin(own, where), read.inertia(own.find("inertia"), where, None, None))
        else:
            links[name] = Link()
    for name, element in read.named(root, "joint").items():
        kind, where = read.joint_type(element, name), f"joint {name!r}"
        parent, child = (getattr(element.find(end), "attrib", {}).get("link", "") for end in ENDS)
        limit, losses, mimic, axis = (element.find(tag) for tag in ("limit", "dynamics", "mimic", "axis"))
        joint = RobotJoint(kind, parent, child, origin(element, where))
        if kind in BOUNDED and limit is not None:
            low, high = (read.number(limit, key, 0.0, where) for key in ("lower", "upper"))
            joint = replace(joint, limits=(low, high) if low < high else joint.limits)
        if mimic is not None:
            ratio, offset = (read.number(mimic, *pair, where) for pair in (("multiplier", 1.0), ("offset", 0.0)))
            joint = replace(joint, follows=(mimic.get("joint", ""), ratio, offset))
        joints[name] = replace(
            joint,
            axes={"": read.axis("1 0 0" if axis is None else axis.get("xyz", "1 0 0"), name)}
            if kind != "fixed"
            else {},
            damping=read.number(losses, "damping", 0.0, where),
            friction=read.number(losses, "friction", 0.0, where),
            armature=reflected.get(name, 0.0),
        )
    return Robot(file, links, joints)
