"""A linkage, balanced or not, as a MJCF text that the core, Pinocchio and MuJoCo read alike.

Bodies lie in x-y; a body's frame has the axes of its described frame at angle zero and its origin at its tree joint.
Counter-gears are bodies of their own; that they are geared stands beside the text, in ``coupling``.
"""

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ..arrays import Floats
from ..errors import ModelError
from .assembly import Assembly, assemble, turned
from .description import GROUND, Joint
from .lumps import Lump, lumps, merged
from .method import Balance
from .moment import GearResult
from .skeleton import Skeleton, skeleton

Z_AXIS = np.array([0.0, 0.0, 1.0])
STANDING = 1.0
"""Mass in the model of a counter-gear that stands still and has none given: it moves nothing [kg]."""


def mjcf(result: Balance, stage: str, couplings: bool = False, together: bool = True) -> str:
    """MJCF text of a stage: ``before``, ``force`` (counter-masses) or ``complete`` (and gears).

    ``couplings`` writes the gear ratios as joint equalities, for MuJoCo; the core refuses them by name.
    """
    linkage, values, tree = result.linkage, result.values, skeleton(result, together)
    start = assemble(linkage, values)
    writer = _Writer(result, stage, tree, start)
    root = Element("mujoco", model=linkage.name)
    SubElement(root, "compiler", angle="radian")
    SubElement(root, "option", gravity=_text(*linkage.gravity, 0.0))
    base = SubElement(SubElement(root, "worldbody"), "body", name="base")
    writer.children(base, GROUND)
    equality = SubElement(root, "equality")
    for joint in tree.loops:
        ends = {f"site{k}": f"{joint.name}.{end.body}" for k, end in enumerate(joint.ends, 1)}
        SubElement(equality, "connect", {"name": joint.name, **ends})
    if couplings:
        writer.couple(equality)
    motor = SubElement(root, "actuator")
    SubElement(motor, "motor", name=f"motor_{linkage.drive}", joint=str(linkage.drive))
    SubElement(SubElement(root, "keyframe"), "key", name="start", qpos=_text(*writer.positions))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


class _Writer:
    """Writes bodies depth first, and with each joint its position in the start configuration."""

    def __init__(self, result: Balance, stage: str, tree: Skeleton, start: Assembly) -> None:
        self.linkage, self.result, self.tree, self.start = result.linkage, result, tree, start
        self.lumps = lumps(result, stage)
        self.gears = list(result.moment.gears.values()) if stage == "complete" and result.moment else []
        self.positions: list[float] = []

    def children(self, element: Element, parent: str) -> None:
        """Bodies whose tree joint is on ``parent``, its sites, and the counter-gears that it carries."""
        for joint in self.tree.loops:
            if joint.joins(parent):
                at = self._own(parent, joint)
                SubElement(element, "site", name=f"{joint.name}.{parent}", pos=_text(*at, 0.0))
        for body, joint in self.tree.parent.items():
            if joint.other(body) == parent:
                self._body(element, parent, body, joint)
        for gear in self.gears:
            if gear.carrier == parent:
                self._counter_gear(element, gear)

    def couple(self, equality: Element) -> None:
        """q* = -(Z/Z*) (angle of the body relative to the carrier): one joint equality where that is one joint."""
        for gear in self.gears:
            joint = self.tree.parent[gear.gear.body]
            if joint.name == gear.joint:
                sign = -gear.gear.ratio
            elif gear.carrier != GROUND and self.tree.parent[gear.carrier].name == gear.joint:
                joint, sign = self.tree.parent[gear.carrier], gear.gear.ratio
            else:
                raise ModelError(f"gear {gear.gear.name} closes a loop at {gear.joint}: MJCF has no coupling for it")
            offset = -sign * self._position(*self._of(joint))
            SubElement(
                equality, "joint", joint1=f"{gear.gear.name}*", joint2=joint.name, polycoef=_text(offset, sign, 0, 0, 0)
            )

    def _of(self, joint: Joint) -> tuple[str, Joint]:
        return next((body, j) for body, j in self.tree.parent.items() if j.name == joint.name)

    def _body(self, element: Element, parent: str, name: str, joint: Joint) -> None:
        turn = self._turn(name, parent, joint)
        body = SubElement(element, "body", name=name, pos=_text(*self._own(parent, joint), 0.0))
        if turn:
            body.set("quat", _text(np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)))
        for label, axis in _axes(joint, name):
            kind = "hinge" if joint.revolute else "slide"
            SubElement(body, "joint", name=label, type=kind, axis=_text(*axis))
            self.positions.append(self._position(name, joint, axis))
        self._inertial(body, merged(self.lumps[name]), self._origin(name))
        self.children(body, name)

    def _counter_gear(self, element: Element, gear: GearResult) -> None:
        """A disc that turns about its pivot on its carrier."""
        at = self._pivot(gear)
        body = SubElement(element, "body", name=f"{gear.gear.name}*", pos=_text(*at, 0.0))
        SubElement(body, "joint", name=f"{gear.gear.name}*", type="hinge", axis="0 0 1")
        self.positions.append(0.0)
        mass = STANDING if gear.counter_mass is None else gear.counter_mass
        self._inertial(body, Lump(mass, gear.inertia, np.zeros(2)), np.zeros(2))

    def _pivot(self, gear: GearResult) -> Floats:
        """In the carrier's frame; a fixed pair without a described one at the joint of its gear."""
        name = gear.joint if gear.carrier == GROUND else self.result.tree[gear.carrier]
        point = gear.gear.pivot or self.linkage.joints[name].end(gear.carrier).point
        assert point is not None
        return point.at(self.result.values) - self._origin(gear.carrier)

    def _inertial(self, element: Element, lump: Lump, origin: Floats) -> None:
        """A flat body: its inertia about z is the sum of the other two; what never turns gets any inertia."""
        inertia = lump.inertia or 1e-6 * lump.mass
        diagonal = _text(inertia / 2, inertia / 2, inertia)
        SubElement(
            element, "inertial", pos=_text(*(lump.at - origin), 0.0), mass=_text(lump.mass), diaginertia=diagonal
        )

    def _origin(self, body: str) -> Floats:
        """Origin of a body's model frame in its described frame, (2,) [m]."""
        if body == GROUND:
            return np.zeros(2)
        return self._described(body, self.tree.parent[body])

    def _own(self, body: str, joint: Joint) -> Floats:
        """A joint's place in a body's model frame, (2,) [m]."""
        return self._described(body, joint) - self._origin(body)

    def _described(self, body: str, joint: Joint) -> Floats:
        point = joint.end(body).point
        assert point is not None
        return point.at(self.result.values)

    def _turn(self, body: str, parent: str, joint: Joint) -> float:
        """Fixed angle of a body's frame in its parent's [rad]; a pin starts aligned."""
        if joint.both:
            return self.start.angle[body] - self.start.angle[parent]
        return 0.0 if joint.revolute else joint.end(parent).along - joint.end(body).along

    def _position(self, body: str, joint: Joint, axis: Floats = Z_AXIS) -> float:
        """Joint coordinate in the start configuration [rad, m]; ``axis`` in the body's frame."""
        parent = joint.other(body)
        if joint.revolute:
            return self.start.angle[body] - self.start.angle[parent]
        places = (self.start.point(name, self._described(name, joint)) for name in (body, parent))
        gap = next(places) - next(places)
        return float(turned(-self.start.angle[body], gap) @ axis[:2])


def _axes(joint: Joint, body: str) -> list[tuple[str, Floats]]:
    """Names and axes, in the body's frame, of what a joint is in the model."""
    if joint.revolute:
        return [(joint.name, Z_AXIS)]
    if joint.both:
        return [(f"{joint.name}.x", _direction(0.0)), (f"{joint.name}.y", _direction(np.pi / 2).round())]
    return [(joint.name, _direction(joint.end(body).along))]


def _direction(angle: float) -> Floats:
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def _text(*values: float) -> str:
    return " ".join(f"{float(value):.17g}" for value in values)
