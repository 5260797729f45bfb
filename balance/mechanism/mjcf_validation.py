"""What is refused in a MJCF or URDF file: what would change the motion unseen, and inertias of no rigid body.

Pinocchio 4.1 skips a second body of the same name, takes a text that is no number for zero, and reads beyond its arrays
for a site that does not exist, all of it without an error. So the file is checked before Pinocchio reads it.
"""

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ..arrays import Floats
from ..errors import ModelError

_ELEMENTS = {
    "equality/joint": "a coupling between joints (gears)",
    "equality/tendon": "a coupling between tendons",
    "equality/flex": "a flexible body",
    "equality/distance": "a fixed distance",
    "tendon/fixed": "a tendon",
    "tendon/spatial": "a tendon",
    "deformable/flex": "a flexible body",
    "deformable/skin": "a skin",
}
_TAGS = {"include", "replicate", "attach", "frame", "composite", "flexcomp"}
_SETTINGS = {
    "compiler": {"settotalmass": "-1", "balanceinertia": "false", "boundmass": "0", "boundinertia": "0",
                 "coordinate": "local", "inertiagrouprange": "0 5"},
    "body": {"gravcomp": "0", "mocap": "false"},
    "flag": {"gravity": "enable"},
}  # fmt: skip
"""Settings that Pinocchio does not read, each with the value that changes nothing."""
_NUMBERS = {
    "body": {"pos": 3, "quat": 4, "euler": 3, "axisangle": 4, "xyaxes": 6, "zaxis": 3},
    "site": {"pos": 3, "quat": 4, "euler": 3, "axisangle": 4, "xyaxes": 6, "zaxis": 3},
    "joint": {"pos": 3, "axis": 3, "damping": 1, "armature": 1, "frictionloss": 1, "stiffness": 1, "ref": 1},
    "inertial": {"pos": 3, "quat": 4, "euler": 3, "mass": 1, "diaginertia": 3, "fullinertia": 6},
    "connect": {"anchor": 3},
    "weld": {"anchor": 3, "relpose": 7},
}
"""Attributes that hold numbers, and how many."""


def refuse_unsupported(root: Element, name: str) -> None:
    """Raise ModelError, naming the file and the element, for the first thing that is refused."""
    _refuse_elements(root, name)
    _refuse_numbers(root, name)
    _refuse_names(root, name)
    _refuse_settings(root, name)
    for loop in root.iterfind("equality/*"):
        _refuse_loop(root, loop, name)


def refuse_mimic_joints(path: Path) -> None:
    """Raise ModelError for a URDF joint that follows another one: Pinocchio would take it for free."""
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise ModelError(f"{path.name}: not well-formed XML: {error}") from error
    for joint in root.iterfind("joint[mimic]"):
        master = joint.find("mimic[@joint]")
        whom = "another" if master is None else repr(master.get("joint"))
        raise ModelError(
            f"{path.name}: joint {joint.get('name')!r} mimics {whom}: a gear, which is not understood here"
        )


def element_label(element: Element) -> str:
    """An element as written in the file, cut at 120 characters."""
    return f"<{' '.join([element.tag, *(f'{k}={v!r}' for k, v in element.attrib.items())])[:120]}>"


def _refuse_elements(root: Element, name: str) -> None:
    trees = root.findall("worldbody/body")
    if len(trees) != 1:
        raise ModelError(
            f"{name}: expected one <body name='base'> under <worldbody> that holds the whole mechanism, "
            f"found {len(trees)}: {', '.join(b.get('name', '?') for b in trees) or 'none'}"
        )
    for where, what in _ELEMENTS.items():
        for element in root.iterfind(where):
            raise ModelError(
                f"{name}: <{where.split('/')[0]}> {element_label(element)} is {what}, which is not understood here and "
                "would change the motion; understood are <connect> and <weld>"
            )
    for element in root.iter():
        if element.tag in _TAGS:
            raise ModelError(f"{name}: <{element.tag}> is not read; write the mechanism out in one file")


def _refuse_numbers(root: Element, name: str) -> None:
    for element in root.iter():
        for key, count in _NUMBERS.get(element.tag, {}).items():
            if key in element.attrib and len(parse_numbers(element.get(key, ""))) != count:
                raise ModelError(
                    f"{name}: {element_label(element)}: expected {count} finite number{'s' * (count > 1)} in {key}"
                )
        if element.tag == "joint" and any(parse_numbers(element.get("stiffness", "0"))):
            raise ModelError(f"{name}: joint {element.get('name')!r} has a spring (stiffness), not modelled yet")
        if element.tag == "joint" and "axis" in element.attrib and not any(parse_numbers(element.get("axis", ""))):
            raise ModelError(f"{name}: {element_label(element)}: expected an axis of some length")
        if (
            "axisangle" in element.attrib
            and abs(math.hypot(*parse_numbers(element.get("axisangle", ""))[:3]) - 1.0) > 1e-6
        ):
            raise ModelError(f"{name}: {element_label(element)}: expected an axis of length 1 in axisangle")
        if element.tag == "inertial" and not parse_numbers(element.get("mass", "0"))[0] >= 0.0:
            raise ModelError(f"{name}: {element_label(element)}: expected a mass of zero or more")


def parse_numbers(text: str) -> list[float]:
    """The finite numbers of a text; none if any word is no finite number."""
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return []
    return values if all(math.isfinite(value) for value in values) else []


def _refuse_names(root: Element, name: str) -> None:
    """Bodies and joints without a name, and names that occur twice."""
    for tag in ("body", "joint", "site"):
        found = [e for e in root.iterfind(f"worldbody//{tag}") if not (tag == "site" and e.get("name") is None)]
        seen: set[str] = set()
        for element in found:
            own = element.get("name", "")
            if not own:
                raise ModelError(f"{name}: {element_label(element)}: give every {tag} a name")
            if own in seen:
                raise ModelError(f"{name}: two of <{tag}> have the name {own!r}; names must differ")
            seen.add(own)


def _refuse_settings(root: Element, name: str) -> None:
    for tag, settings in _SETTINGS.items():
        for element, (key, harmless) in product(root.iter(tag), settings.items()):
            if element.get(key, harmless) != harmless:
                raise ModelError(
                    f"{name}: {element_label(element)}: {key} is not read and would change the motion; remove it"
                )
    for compiler in root.iter("compiler"):
        if (order := compiler.get("eulerseq", "xyz")) != order.lower():
            raise ModelError(f"{name}: {element_label(compiler)}: turns about fixed axes are not read; use quat")
    base = root.find("worldbody/body")
    if base is not None and base.find("joint") is None and set(base.attrib) - {"name", "childclass"}:
        raise ModelError(
            f"{name}: {element_label(base)} has a pose: forces and moments are in its frame, which must be that of the "
            "world; move the pose to the bodies in it"
        )


def _refuse_loop(root: Element, loop: Element, name: str) -> None:
    """Ends that do not exist or are not a pair, and what is switched off."""
    for element in (loop, *root.iterfind("default//equality")):
        if element.get("active", "true") != "true":
            raise ModelError(f"{name}: {element_label(element)} is not active; remove it from the file")
    ends = {kind: [loop.get(f"{kind}{k}") for k in "12"] for kind in ("site", "body")}
    given = [kind for kind, pair in ends.items() if any(pair)]
    if given not in (["site"], ["body"]) or not ends[given[0]][0] or (given == ["site"] and not ends["site"][1]):
        raise ModelError(
            f"{name}: {element_label(loop)}: expected site1 and site2, or body1, and body2 where it is not the world"
        )
    if "relpose" in loop.attrib and "anchor" in loop.attrib:
        raise ModelError(f"{name}: {element_label(loop)}: anchor together with relpose is not read; use two sites")
    for end in filter(None, ends[given[0]]):
        known = {e.get("name") for e in root.iterfind(f"worldbody//{given[0]}")} | ({"world"} - {given[0]})
        if end not in known:
            raise ModelError(f"{name}: {element_label(loop)}: there is no {given[0]} {end!r}")
    if len(set(ends[given[0]])) < 2:
        raise ModelError(f"{name}: {element_label(loop)} ties a {given[0]} to itself")


ROUNDING = 1e-6
"""Of inertias in a file: what they may miss the triangle inequality by, relative to those about the joint."""


def refuse_impossible_inertias(name: str, bodies: Sequence[str], parameters: Floats) -> None:
    """Raise ModelError, naming the file and the body, if ``parameters`` (bodies, 10) [SI] are of no rigid body.

    A body that only moves in a plane could have any inertias about the other axes, but no file states that: they are
    refused too, as MuJoCo does. With the inertia tensor I_c about the centre of mass, the condition
    is a positive definite Sigma = tr(I_c)/2 1 - I_c (Wensing, Kim, Slotine 2018).
    """
    if not np.any(parameters[:, 0] > 0.0):
        raise ModelError(f"{name}: no moving body has mass; give each an <inertial>, or geometry with a density")
    for body, row in zip(bodies, parameters, strict=True):
        low, middle, high = principal_inertias(row)
        if row[0] < 0.0 or low + middle < high - ROUNDING * abs(row[[4, 6, 9]]).sum():
            raise ModelError(
                f"{name}: body {body!r} (with what is fixed to it) has mass {row[0]:.6g} kg and principal inertias "
                f"{low:.6g}, {middle:.6g}, {high:.6g} kg m2 about its centre of mass: no body has one larger than the "
                "sum of the other two; is the inertia about another point than the centre of mass?"
            )


def principal_inertias(row: Floats) -> Floats:
    """Principal inertias about the centre of mass, rising, (3,) [kg m2], of a body's PARAMETERS ``row`` (10,)."""
    mass, first = row[0], row[1:4]
    xx, xy, yy, xz, yz, zz = row[4:]
    about_origin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if mass > 0.0:
        about_origin = about_origin - (first @ first * np.eye(3) - np.outer(first, first)) / mass
    return np.linalg.eigvalsh(about_origin)
