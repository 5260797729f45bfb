"""A linkage, balanced or not, as a MJCF text that the core, Pinocchio and MuJoCo read alike.

Bodies lie in x-y; a body's frame has the axes of its described frame at angle zero and its origin at its tree joint.
Counter-gears are bodies of their own; that they are geared stands beside the text, in ``coupling``.
"""

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ..arrays import Floats
from .assembly import Assembly, assemble, turned
from .coupling import Couplings
from .description import GROUND, Joint
from .lumps import Lump, lumps, merged
from .method import Balance
from .moment import GearResult
from .skeleton import Skeleton, skeleton
from .turning import translating

Z_AXIS = np.array([0.0, 0.0, 1.0])
STILL = 1e-6
"""Square of the radius of gyration of what never turns: any will do [m2]."""
POINT = 1e-14
"""And of a point mass that turns: too little to matter, as engines refuse none [m2]."""
MUJOCO_LEAST = 1e-15
"""Inertia below which MuJoCo refuses a file (its mjMINVAL) [kg m2]."""
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
        writer.couple(root, equality)
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

    def couple(self, root: Element, equality: Element) -> None:
        """Counter-gears geared to the linkage: q* - sum(rate q) stays as at the start.

        A joint equality where that is one joint; a fixed tendon over all of them, kept at its length, elsewhere.
        """
        tendons = None
        for gear, rates in Couplings.of(self.result).rates.items():
            offset = -sum(rate * self._start_of(joint) for joint, rate in rates.items())
            if len(rates) == 1:
                ((joint, rate),) = rates.items()
                polynomial = _text(offset, rate, 0, 0, 0)
                SubElement(equality, "joint", joint1=gear, joint2=joint, polycoef=polynomial)
                continue
            tendons = SubElement(root, "tendon") if tendons is None else tendons
            tendon = SubElement(tendons, "fixed", name=gear)
            for joint, rate in {gear: -1.0, **rates}.items():
                SubElement(tendon, "joint", joint=joint, coef=_text(-rate))
            SubElement(equality, "tendon", tendon1=gear, polycoef=_text(offset, 0, 0, 0, 0))

    def _start_of(self, name: str) -> float:
        return next(self._position(body, joint) for body, joint in self.tree.parent.items() if joint.name == name)

    def _body(self, element: Element, parent: str, name: str, joint: Joint) -> None:
        turn = self._turn(name, parent, joint)
        body = SubElement(element, "body", name=name, pos=_text(*self._own(parent, joint), 0.0))
        if turn:
            body.set("quat", _text(np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)))
        for label, axis in _axes(joint, name):
            kind = "hinge" if joint.revolute else "slide"
            SubElement(body, "joint", name=label, type=kind, axis=_text(*axis))
            self.positions.append(self._position(name, joint, axis))
        least = STILL if name in translating(self.linkage) else POINT
        self._inertial(body, merged(self.lumps[name]), self._origin(name), least)
        self.children(body, name)

    def _counter_gear(self, element: Element, gear: GearResult) -> None:
        """A disc that turns about its pivot on its carrier."""
        at = self._pivot(gear)
        body = SubElement(element, "body", name=f"{gear.gear.name}*", pos=_text(*at, 0.0))
        SubElement(body, "joint", name=f"{gear.gear.name}*", type="hinge", axis="0 0 1")
        self.positions.append(0.0)
        mass = STANDING if gear.counter_mass is None else gear.counter_mass
        self._inertial(body, Lump(mass, gear.inertia, np.zeros(2)), np.zeros(2), POINT)

    def _pivot(self, gear: GearResult) -> Floats:
        """In the carrier's frame; a fixed pair without a described one at the joint of its gear."""
        name = gear.joint if gear.carrier == GROUND else self.result.tree[gear.carrier]
        point = gear.gear.pivot or self.linkage.joints[name].end(gear.carrier).point
        assert point is not None
        return point.at(self.result.values) - self._origin(gear.carrier)

    def _inertial(self, element: Element, lump: Lump, origin: Floats, least: float) -> None:
        """A flat body: its inertia about z is the sum of the other two, ``least`` [m2] times its mass or more."""
        inertia = max(lump.inertia, least * lump.mass, 4 * MUJOCO_LEAST)
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
        """Fixed angle of a body's frame in its parent's [rad]; a pin starts aligned.

        A line of sliding has no sense: bodies stand along it as they were assembled, or the other way round.
        """
        stands = self.start.angle[body] - self.start.angle[parent]
        if joint.both:
            return stands
        if joint.revolute:
            return 0.0
        along = joint.end(parent).along - joint.end(body).along
        return along + np.pi * float(np.rint((stands - along) / np.pi))

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
