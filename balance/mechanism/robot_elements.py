"""Elements of URDF and SDF files with their numbers; messages name the file and the element."""

import math
import re
import xml.etree.ElementTree as ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from ..arrays import Floats
from ..errors import ModelError
from .mjcf_compiler import refuse_tags, tags

BOUNDED = {"revolute", "prismatic"}
"""Types of joints that may have limits."""
ENDS = ("parent", "child")
_TYPES = {"fixed", "continuous", "ball", "spherical", "universal"} | BOUNDED
_LOOPS = {"ball_constraint", "weld_constraint", "distance_constraint", "tendon_constraint", "linear_bushing_rpy",
          "mimicJoint", "loop_joint"}  # fmt: skip
"""What simulators add to the formats to hold bodies together."""
_MASSES = {"deformable_properties", "fluid_added_mass"}
"""What they add to a body's mass."""


def parsed(text: str, file: str) -> Element:
    """The root, names of elements and attributes without their namespaces, which need not be declared.

    Raises ModelError for what is not well-formed, and for what would hold or load the mechanism and is not read.
    """
    # plugins are a simulator's, in both formats: none of them is run
    refuse_tags(text, file, "plugin" if next((tag["tag"] for tag in tags(text)), "") in ("robot", "sdf") else "")
    parts, done = [], 0
    while (at := text.find("<!--", done)) >= 0 and (end := text.find("-->", at)) >= 0:
        parts.append(text[done:at])
        done = end + 3
    text = "".join([*parts, text[done:]]).strip()
    undeclared = {
        prefix
        for prefix in re.findall(r"[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_]", text)
        if not prefix.lower().startswith("xml") and f"xmlns:{prefix}" not in text
    }
    declared = "".join(f' xmlns:{prefix}="{prefix}"' for prefix in sorted(undeclared))
    try:
        root = ElementTree.fromstring(re.sub(r"<(robot|sdf)\b", rf"<\1{declared}", text, count=1))
    except (ElementTree.ParseError, ValueError) as error:
        raise ModelError(f"{file}: not well-formed XML: {error}") from error
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
        if element.tag in _LOOPS:
            raise refused_loop(element, file)
        if element.tag in _MASSES:
            raise ModelError(f"{file}: <{element.tag}> is not computed here; write out mass and inertia without it")
    return root


def refused_loop(element: Element, file: str) -> ModelError:
    """What is said of an element that holds bodies together and is not read."""
    return ModelError(
        f"{file}: <{element.tag}> {element.get('name') or (element.text or '').strip()!r} is a loop or coupling of a "
        "simulator's: state it as a <joint> of SDF, in a YAML file of this name beside a URDF, or as <mimic>, and "
        "remove the element"
    )


class Reader:
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

    def armature(self, gear: Element | None, rotor: Element | None, where: str) -> float:
        """Inertia of a motor's rotor reflected to its joint, as Drake's elements state it [kg m2, kg]."""
        ratio, inertia = (
            default if element is None else self.number(element, "value", None, where)
            for element, default in ((gear, 1.0), (rotor, 0.0))
        )
        return ratio**2 * inertia

    def inertia(self, element: Element | None, where: str, moment: float | None, product: float | None) -> Floats:
        """Inertia tensor, (3, 3) [kg m2]."""
        xx, yy, zz = (self.number(element, key, moment, where) for key in ("ixx", "iyy", "izz"))
        xy, xz, yz = (self.number(element, key, product, where) for key in ("ixy", "ixz", "iyz"))
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def rotation_of(roll: float, pitch: float, yaw: float) -> Floats:
    """Turns about the fixed axes x, y, z in this order, (3, 3)."""
    turned = np.eye(3)
    for angle, (i, j) in zip((roll, pitch, yaw), ((1, 2), (2, 0), (0, 1)), strict=True):
        one = np.eye(3)
        one[[i, j], [i, j]] = math.cos(angle)
        one[j, i] = math.sin(angle)
        one[i, j] = -one[j, i]
        turned = one @ turned
    return turned
