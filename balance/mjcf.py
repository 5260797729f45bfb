"""What a MJCF file says beyond the tree that Pinocchio reads: loops, motors, names; and what must be refused."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path

from .errors import ModelError

_REFUSED = {
    "equality/joint": "a coupling between joints (gears)",
    "equality/tendon": "a coupling between tendons",
    "equality/flex": "a flexible body",
    "equality/distance": "a fixed distance",
    "tendon/fixed": "a tendon",
    "tendon/spatial": "a tendon",
    "deformable/flex": "a flexible body",
    "deformable/skin": "a skin",
}
_HARMLESS_JOINT_SPRING = {None, "0", "0.0"}


@dataclass(frozen=True)
class Extras:
    """What ``balance`` takes from the file itself, beside Pinocchio's model."""

    gravity: tuple[float, float, float]
    """Gravity from ``<option>``, MuJoCo's default where absent, (3,) [m/s2]."""
    loops: list[str]
    """Names of the loop constraints, in the order in which Pinocchio returns them: connects, then welds."""
    driven: tuple[str, ...]
    """Joints that an ``<actuator>`` drives."""
    payload_bodies: tuple[str, ...]
    """Bodies that ``<custom><text name="payload">`` names."""
    radius_of_gyration: dict[str, float] = field(default_factory=dict)
    """Radius of gyration of a counter-mass about its own centre, by site [m]; a point mass where absent."""
    joints: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Names of the joints of each body, in the order of the file."""


def read_extras(path: Path) -> Extras:
    """Read what Pinocchio leaves out, and refuse by name what would change the motion and is not understood."""
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise ModelError(f"{path.name}: not well-formed XML: {error}") from error
    if root.tag != "mujoco":
        raise ModelError(f"{path.name}: expected a MJCF file with root <mujoco>, found <{root.tag}>")
    _refuse_what_is_not_understood(root, path)
    option = root.find("option[@gravity]")
    gravity = (0.0, 0.0, -9.81) if option is None else _numbers(option.get("gravity", ""), 3, path, "gravity")
    return Extras(
        gravity=(gravity[0], gravity[1], gravity[2]),
        loops=[_loop_name(e) for kind in ("connect", "weld") for e in root.iterfind(f"equality/{kind}")],
        driven=tuple(dict.fromkeys(e.get("joint", "") for e in root.iterfind("actuator/*") if e.get("joint"))),
        payload_bodies=_payload_bodies(root),
        radius_of_gyration=_radii(root, path),
        joints=_joints_by_body(root),
    )


def _refuse_what_is_not_understood(root: ElementTree.Element, path: Path) -> None:
    trees = root.findall("worldbody/body")
    if len(trees) != 1:
        raise ModelError(
            f"{path.name}: expected one <body name='base'> under <worldbody> that holds the whole mechanism, "
            f"found {len(trees)}: {', '.join(b.get('name', '?') for b in trees) or 'none'}"
        )
    for where, what in _REFUSED.items():
        for element in root.iterfind(where):
            raise ModelError(
                f"{path.name}: <{where.replace('/', '><')} {_label(element)}> is {what}, which is not understood "
                f"here and would change the motion; understood are <connect> and <weld>"
            )
    for element in root.iter():
        if element.tag in {"include", "replicate", "attach", "frame", "composite", "flexcomp"}:
            raise ModelError(f"{path.name}: <{element.tag}> is not read; write the mechanism out in one file")
        if element.tag == "joint" and element.get("stiffness") not in _HARMLESS_JOINT_SPRING:
            raise ModelError(f"{path.name}: joint {element.get('name')!r} has a spring (stiffness), not modelled yet")
    for element in root.iterfind("equality/*"):
        if element.get("active", "true") != "true":
            raise ModelError(f"{path.name}: <{element.tag} {_label(element)}> is not active; remove it from the file")


def _loop_name(element: ElementTree.Element) -> str:
    ends = [element.get(k) or "" for k in ("site1", "site2", "body1", "body2") if element.get(k)]
    return element.get("name") or f"{element.tag} {'-'.join(ends)}"


def _label(element: ElementTree.Element) -> str:
    return " ".join(f'{key}="{value}"' for key, value in element.attrib.items())[:120]


def _payload_bodies(root: ElementTree.Element) -> tuple[str, ...]:
    text = root.find("custom/text[@name='payload']")
    return () if text is None else tuple(text.get("data", "").split())


def _radii(root: ElementTree.Element, path: Path) -> dict[str, float]:
    ending = ".radius_of_gyration"
    return {
        e.get("name", "").removesuffix(ending): _numbers(e.get("data", ""), 1, path, e.get("name", ""))[0]
        for e in root.iterfind("custom/numeric")
        if e.get("name", "").endswith(ending)
    }


def _joints_by_body(root: ElementTree.Element) -> dict[str, tuple[str, ...]]:
    return {
        body.get("name", ""): tuple(joint.get("name", "") for joint in body.findall("joint"))
        for body in root.iter("body")
    }


def _numbers(text: str, count: int, path: Path, name: str) -> list[float]:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count:
        raise ModelError(f"{path.name}: {name} is {text!r}: expected {count} number{'s' * (count > 1)}")
    return values
