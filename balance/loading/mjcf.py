"""What a MJCF file says beyond the tree that Pinocchio reads: loops, motors, names; and what must be refused."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import ModelError
from .refusals import numbers, refuse


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
    keyframe: str | None = None
    """The keyframe to start from: ``home``, or else the first that has a configuration."""
    prepared: str = ""
    """The file as Pinocchio is to read it."""


def read_extras(path: Path) -> Extras:
    """Read what Pinocchio leaves out, and refuse by name what would change the motion and is not understood."""
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise ModelError(f"{path.name}: not well-formed XML: {error}") from error
    if root.tag != "mujoco":
        raise ModelError(f"{path.name}: expected a MJCF file with root <mujoco>, found <{root.tag}>")
    refuse(root, path.name)
    options = root.findall("option[@gravity]")
    gravity = _numbers(options[-1].get("gravity", ""), 3, path, "gravity") if options else (0.0, 0.0, -9.81)
    return Extras(
        gravity=(gravity[0], gravity[1], gravity[2]),
        loops=[_loop_name(e) for kind in ("connect", "weld") for e in root.iterfind(f"equality/{kind}")],
        driven=tuple(dict.fromkeys(e.get("joint", "") for e in root.iterfind("actuator/*") if e.get("joint"))),
        payload_bodies=_payload_bodies(root),
        radius_of_gyration=_radii(root, path),
        joints=_joints_by_body(root),
        keyframe=_keyframe(root, path),
        prepared=_prepared(root),  # last: it changes the tree
    )


def _loop_name(element: ElementTree.Element) -> str:
    ends = [element.get(k) or "" for k in ("site1", "site2", "body1", "body2") if element.get(k)]
    return element.get("name") or f"{element.tag} {'-'.join(ends)}"


def _payload_bodies(root: ElementTree.Element) -> tuple[str, ...]:
    text = root.find("custom/text[@name='payload']")
    return () if text is None else tuple(text.get("data", "").split())


def _radii(root: ElementTree.Element, path: Path) -> dict[str, float]:
    ending, radii = ".radius_of_gyration", {}
    for element in root.iterfind("custom/numeric"):
        if (name := element.get("name", "")).endswith(ending):
            (radius,) = _numbers(element.get("data", ""), 1, path, name)
            if radius < 0.0:
                raise ModelError(f"{path.name}: {name} is {radius:g}: expected zero or more")
            radii[name.removesuffix(ending)] = radius
    return radii


def _joints_by_body(root: ElementTree.Element) -> dict[str, tuple[str, ...]]:
    return {
        body.get("name", ""): tuple(joint.get("name", "") for joint in body.findall("joint"))
        for body in root.iter("body")
    }


def _keyframe(root: ElementTree.Element, path: Path) -> str | None:
    keys = [key for key in root.iterfind("keyframe/key") if "qpos" in key.attrib]
    for key in keys:
        if not key.get("name") or not numbers(key.get("qpos", "")):
            raise ModelError(f"{path.name}: <key name={key.get('name')!r}>: expected a name, and numbers in qpos")
    names = [key.get("name") for key in keys]
    return "home" if "home" in names else next(iter(names), None)


def _prepared(root: ElementTree.Element) -> str:
    """The file with two bodies round the world's, for Pinocchio leaves out the pose and the sites of the outermost.

    Loops get names that sort in the order of the file: Pinocchio returns them by name.
    """
    world = root.find("worldbody")
    assert world is not None  # refuse() has seen the tree in it
    held = list(world)
    for child in held:
        world.remove(child)
    inner = ElementTree.SubElement(
        ElementTree.SubElement(world, "body", name="world_frame"), "body", name="world_sites"
    )
    inner.extend(held)
    for number, loop in enumerate(root.iterfind("equality/*")):
        loop.set("name", f"{number:06d}")
    return ElementTree.tostring(root, encoding="unicode")


def _numbers(text: str, count: int, path: Path, name: str) -> list[float]:
    values = numbers(text)
    if len(values) != count:
        raise ModelError(f"{path.name}: {name} is {text!r}: expected {count} number{'s' * (count > 1)}")
    return values
