"""URDF and SDF files as a Robot, with the loops that an SDF, or a YAML file beside a URDF, states.

Geometry is left out: in both formats it carries no mass.
"""

import json
import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from pydantic import Field

from ..arrays import Floats
from ..errors import ModelError
from ..input_files import Table, json_document, model_from_table
from .mjcf_compiler import located_file, read_text, refuse_tags, tags
from .robot import Link, Placement, Robot, RobotJoint

_LOOPS_COMMENT = re.compile(r"<!-- counterpoise loops: (.*?) -->", re.S)
"""Where a mechanism's text keeps, as JSON, what the YAML file beside it said."""
_BOUNDED = {"revolute", "prismatic"}
_TYPES = {"fixed", "continuous", "ball", "spherical", "universal"} | _BOUNDED
_INFINITE = 1e15
"""A limit from here on is none, as SDF writes it; nor are two equal ones, as URDF has them [rad, m]."""


class RobotLoops(Table):
    """Loops and motors of a URDF, in a YAML file of its name beside it, as Gepetto/example-parallel-robots has them."""

    closed_loop: list[list[str]] = Field(default_factory=list)
    """Pairs of names of links, or of joints, which stand for their child links."""
    type: list[str] = Field(default_factory=list)
    """Of each loop: 3d, the points coincide; 6d, the default: the axes too."""
    joint_name: list[str] = Field(default_factory=list)
    """Joints of another type than in the URDF; those that it does not have are passed over."""
    joint_type: list[str] = Field(default_factory=list)
    """Of each of them: SPHERICAL, FIXED, or UJOINT_ZY with two axes."""
    name_mot: list[str] = Field(default_factory=list)
    """Joints with a motor."""


_SIDECAR_KEYS = tuple(RobotLoops.model_fields)


def read_robot(text: str, file: str, path: Path | None) -> tuple[Robot, str]:
    """A robot from the text of a URDF or SDF file, ``path`` where it is one, and the text with its loops in it.

    The YAML beside a URDF has its name and the form of Gepetto/example-parallel-robots: ``closed_loop``, pairs of names
    of links or joints; ``type`` of each, 3d or else 6d; ``joint_name`` and ``joint_type`` of joints that are SPHERICAL,
    FIXED or UJOINT_ZY (two letters); ``name_mot``, the motors. Joints that are absent are passed over, as there.
    """
    root = _parsed(text, file)
    if root.tag == "sdf" and _put_included(root, file, None if path is None else path.parent):
        text = ElementTree.tostring(root, encoding="unicode")
    robot = _sdf(root, file) if root.tag == "sdf" else _urdf(root, file)
    if not robot.links:
        raise ModelError(f"{file}: has no <link>; expected links and joints")
    stored = _LOOPS_COMMENT.search(text)
    told = json_document(stored[1], file, ModelError) if stored else {} if path is None else _sidecar(path)
    loops = model_from_table(RobotLoops, told, file, ModelError).model_dump(exclude_unset=True)
    if loops and not stored:
        text = f"{text.rstrip()}\n<!-- counterpoise loops: {json.dumps(loops).replace('>', chr(92) + 'u003e')} -->\n"
    return _with_loops(robot, loops), text


def _parsed(text: str, file: str) -> Element:
    """The root, names of elements without their namespaces."""
    is_urdf = next((tag["tag"] for tag in tags(text)), "") == "robot"
    refuse_tags(text, file, "plugin" if is_urdf else "")  # those of a URDF are a simulator's
    try:
        root = ElementTree.fromstring(_without_comments(text).strip())
    except (ElementTree.ParseError, ValueError) as error:
        raise ModelError(f"{file}: not well-formed XML: {error}") from error
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    return root


def _put_included(root: Element, file: str, folder: Path | None) -> bool:
    """Put the models of <include> in its place, or with ``merge`` what is in them; whether there was one.

    A <uri> is a file, or a folder with a model.sdf, in ``folder``, after model:// or not.
    """
    found = False
    for parent in list(root.iter()):
        for element in parent.findall("include"):
            place, found = list(parent).index(element), True
            uri = element.findtext("uri", "").strip().removeprefix("model://").removeprefix("file://")
            is_folder = folder is not None and (folder / uri).is_dir()
            other = located_file(f"{uri}/model.sdf" if is_folder else uri, "", folder, file)
            models = _parsed(read_text(other), other.name).findall("model")
            merged, pose = element.get("merge") in ("true", "1"), element.find("pose")
            if len(models) != 1 or models[0].find(".//include") is not None:
                raise ModelError(f"{file}: <include> of {uri!r}: expected one <model>, without <include>")
            if element.find("placement_frame") is not None or (merged and pose is not None):
                raise ModelError(f"{file}: <include> of {uri!r}: its place is not read; write the model out")
            model = models[0]
            if pose is not None:
                for own in model.findall("pose"):
                    model.remove(own)
                model.append(pose)
            parent.remove(element)
            for k, one in enumerate([one for one in model if one.tag != "pose"] if merged else [model]):
                parent.insert(place + k, one)
    return found


def _without_comments(text: str) -> str:
    """Comments of people's files hold two hyphens, which XML does not allow."""
    parts, done = [], 0
    while (at := text.find("<!--", done)) >= 0 and (end := text.find("-->", at)) >= 0:
        parts.append(text[done:at])
        done = end + 3
    return "".join([*parts, text[done:]])


def _sidecar(path: Path) -> dict[str, Any]:
    """What the YAML beside a URDF says; nothing where there is none. Raises ModelError for loops of another name."""
    import yaml

    found: dict[str, Any] = {}
    for other in sorted({*path.parent.glob("*.yaml"), *path.parent.glob("*.yml")})[:100]:
        own = other.stem == path.stem
        if not other.resolve().is_relative_to(path.parent.resolve()):
            continue
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
        found = {key: data[key] for key in _SIDECAR_KEYS if key in data} if own else found
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
    return replace(robot, joints=joints, loops=loops, motors=motors)


class _Reader:
    """Elements of a file with their numbers; messages name the file and the element."""

    def __init__(self, file: str) -> None:
        self.file = file

    def named(self, parent: Element, tag: str) -> dict[str, Element]:
        """Child elements by name. Raises ModelError for a name that is missing or occurs twice."""
        found: dict[str, Element] = {}
        for element in parent.iterfind(tag):
            name = element.get("name", "")
            if not name or name in found:
                raise ModelError(f"{self.file}: <{tag} name={name!r}>: expected a name that no other {tag} has")
            found[name] = element
        return found

    def numbers(self, text: str | None, count: int, where: str) -> Floats:
        """Finite numbers, (count,)."""
        try:
            values = np.array([float(word) for word in (text or "").split()])
        except ValueError:
            values = np.empty(0)
        if len(values) != count or not np.isfinite(values).all():
            raise ModelError(f"{self.file}: {where} is {text!r}: expected {count} finite number{'s' * (count > 1)}")
        return values

    def number(self, element: Element | None, key: str, default: float | None, where: str) -> float:
        """A number of an attribute ``key``, or of a child element of that name; without a default it must be there."""
        text = None if element is None else element.get(key, element.findtext(key))
        if text is None and default is not None:
            return default
        return float(self.numbers(text, 1, f"{key} of {where}")[0])

    def joint_type(self, element: Element, name: str) -> str:
        """Raises ModelError for a joint of a kind that is not understood."""
        kind = element.get("type", "")
        if kind not in _TYPES:
            cure = (
                "; fix the link to the base, or give it slides and a ball joint" if kind in ("floating", "free") else ""
            )
            raise ModelError(
                f"{self.file}: joint {name!r} is of type {kind!r}: expected {', '.join(sorted(_TYPES))}{cure}"
            )
        return kind

    def axis(self, text: str | None, name: str) -> Floats:
        """A unit vector (3,)."""
        axis = self.numbers(text, 3, f"axis of joint {name!r}")
        if not np.linalg.norm(axis) > 0.0:
            raise ModelError(f"{self.file}: axis of joint {name!r} is {text!r}: expected some length")
        return axis / np.linalg.norm(axis)

    def inertia(self, element: Element | None, where: str, moment: float | None, product: float | None) -> Floats:
        """Inertia tensor, (3, 3) [kg m2]."""
        xx, yy, zz = (self.number(element, key, moment, where) for key in ("ixx", "iyy", "izz"))
        xy, xz, yz = (self.number(element, key, product, where) for key in ("ixy", "ixz", "iyz"))
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _rotation(roll: float, pitch: float, yaw: float) -> Floats:
    """Turns about the fixed axes x, y, z in this order, (3, 3)."""
    turned = np.eye(3)
    for angle, (i, j) in zip((roll, pitch, yaw), ((1, 2), (2, 0), (0, 1)), strict=True):
        one = np.eye(3)
        one[[i, j], [i, j]] = math.cos(angle)
        one[j, i] = math.sin(angle)
        one[i, j] = -one[j, i]
        turned = one @ turned
    return turned


def _urdf(root: Element, file: str) -> Robot:
    if root.tag != "robot":
        raise ModelError(f"{file}: expected a URDF file with root <robot>, found <{root.tag}>")
    read = _Reader(file)
    for element in [*root.iterfind("gazebo/joint"), *root.iterfind("gazebo//mimicJoint"), *root.iter("loop_joint")]:
        raise ModelError(
            f"{file}: <{element.tag}> {element.get('name') or (element.text or '').strip()!r} is a loop or coupling of "
            "a simulator's: state it in a YAML file of this name, or as <mimic>, and remove the element"
        )

    def origin(element: Element | None, where: str) -> Placement:
        found = None if element is None else element.find("origin")
        values = [
            read.numbers("0 0 0" if found is None else found.get(key, "0 0 0"), 3, f"{key} of {where}")
            for key in ("xyz", "rpy")
        ]
        return Placement(values[0], _rotation(*values[1]))

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
        parent, child = (getattr(element.find(end), "attrib", {}).get("link", "") for end in _ENDS)
        limit, losses, mimic, axis = (element.find(tag) for tag in ("limit", "dynamics", "mimic", "axis"))
        joint = RobotJoint(kind, parent, child, origin(element, where))
        if kind in _BOUNDED and limit is not None:
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
        )
    return Robot(file, links, joints)


_ENDS = ("parent", "child")


def _sdf(root: Element, file: str) -> Robot:
    """The one model of an SDF file. Frames are resolved at zero, as SDF 1.7 and later define them."""
    read = _Reader(file)
    models = root.findall(".//model")
    if len(models) != 1:
        raise ModelError(f"{file}: expected one <model> with its links, found {len(models)}; write it out as one")
    model = models[0]
    own_axes = tuple(int(part) for part in root.get("version", "1.7").split(".")[:2]) >= (1, 5)
    world, gravity = root.find("world"), np.array([0.0, 0.0, -9.81])
    if world is not None and world.find("gravity") is not None:
        gravity = read.numbers(world.findtext("gravity"), 3, "<gravity>")
    elements = {tag: read.named(model, tag) for tag in ("link", "joint", "frame")}
    stated: dict[str, tuple[str, Placement]] = {"__model__": ("", Placement()), "world": ("", Placement())}

    def pose(element: Element, where: str) -> Placement:
        found = element.find("pose")
        if found is None or not (found.text or "").split():
            return Placement()
        quaternion = found.get("rotation_format") == "quat_xyzw"
        values = read.numbers(found.text, 7 if quaternion else 6, f"<pose> of {where}")
        angles = np.radians(values[3:]) if found.get("degrees") in ("true", "1") else values[3:]
        if not quaternion:
            return Placement(values[:3], _rotation(*angles))
        x, y, z, w = values[3:] / np.linalg.norm(values[3:])
        skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return Placement(values[:3], np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew)

    for tag, named in elements.items():
        for name, element in named.items():
            found = element.find("pose")
            default = {"link": "__model__", "joint": element.findtext("child", "").strip()}.get(tag)
            default = default or element.get("attached_to") or "__model__"
            relative = (found.get("relative_to") if found is not None else "") or default
            stated[name] = relative, pose(element, f"{tag} {name!r}")

    def placed(name: str) -> Placement:
        at, seen = Placement(), set()
        while name not in ("__model__", "world"):
            if name not in stated or name in seen:
                raise ModelError(f"{file}: <pose> is relative to {name!r}, which is no frame of it or goes round")
            seen.add(name)
            name, own = stated[name]
            at = own @ at
        return base.inverse() @ at if name == "world" else at

    base, links, joints = pose(model, "model"), {}, {}
    for name, element in elements["link"].items():
        own, where = element.find("inertial"), f"the inertial of link {name!r}"
        at = Placement() if own is None else pose(own, where)
        tensor = read.inertia(None if own is None else own.find("inertia"), where, 1.0, 0.0)
        links[name] = Link(read.number(own, "mass", 1.0, where), at, tensor)
    for name, element in elements["joint"].items():
        parent, child = (element.findtext(end, "").strip() for end in _ENDS)
        at, where = placed(name), f"joint {name!r}"
        in_parent, in_child = (placed(end).inverse() @ at if end in stated else Placement() for end in (parent, child))
        joint = RobotJoint(read.joint_type(element, name), parent, child, in_parent, in_child)
        tags = {"universal": ("axis", "axis2"), "fixed": (), "ball": (), "spherical": ()}.get(joint.kind, ("axis",))
        axes: dict[str, Floats] = {}
        for tag in tags:
            axis = element.find(tag)
            xyz = None if axis is None else axis.find("xyz")
            direction = read.axis("0 0 1" if xyz is None else xyz.text, name)
            frame = "" if xyz is None else xyz.get("expressed_in", "")
            if axis is not None and (axis.findtext("use_parent_model_frame", "") in ("1", "true") or not own_axes):
                frame = "__model__"
            if frame:
                direction = at.rotation.T @ placed(frame).rotation @ direction
            axes[f"_{len(axes) + 1}" if len(tags) > 1 else ""] = direction
            mimic = None if axis is None else axis.find("mimic")
            if mimic is not None:
                leader = elements["joint"].get(mimic.get("joint", ""))
                if len(tags) > 1 or leader is None or leader.get("type") == "universal":
                    raise ModelError(f"{file}: joint {name!r}: <mimic>: expected two joints of one axis each")
                ratio, start, zero = (
                    read.number(mimic, key, default, where)
                    for key, default in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
                )
                joint = replace(joint, follows=(mimic.get("joint", ""), ratio, start - ratio * zero))
            limit, losses = (None if axis is None else axis.find(part) for part in ("limit", "dynamics"))
            bounds = [read.number(limit, key, math.inf, where) for key in ("lower", "upper")]
            if joint.kind in _BOUNDED and max(map(abs, bounds)) < _INFINITE and bounds[0] < bounds[1]:
                joint = replace(joint, limits=(bounds[0], bounds[1]))
            joint = replace(
                joint,
                damping=read.number(losses, "damping", 0.0, where),
                friction=read.number(losses, "friction", 0.0, where),
            )
        joints[name] = replace(joint, axes=axes)
    return Robot(file, links, joints, base, gravity)
