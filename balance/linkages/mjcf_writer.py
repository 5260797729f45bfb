"""A linkage, balanced or not, as a MJCF text that this package, Pinocchio and MuJoCo read in one way.

Bodies lie in x-y; a body's frame has the axes of its described frame at angle zero and its origin at its tree joint. A
spanning tree of joints carries the bodies, pins close its loops, and the start position has every body placed near the
described one so that all joints close.

Counter-gears are bodies of their own, coupled to the linkage outside the text: relative to the carrier one turns
-(Z/Z*) times as far as the body does. In a plane the angle of a body is the sum of the revolute coordinates towards the
base, so the coupling is linear and holds for velocities and accelerations too.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ..arrays import Floats
from ..closure import Trajectory
from ..errors import ModelError
from ..mechanism.mechanism import Mechanism
from .equivalence_method import CompositeBody, LinkageBalance, composite_bodies, merged_body, rotated
from .expressions import ORIGIN, Point
from .linkage import GROUND, End, Joint
from .moment_balance import GearResult

Z_AXIS = np.array([0.0, 0.0, 1.0])
TRANSLATING_GYRATION = 1e-6
"""Square of the radius of gyration of a body that never turns: any will do [m2]."""
POINT_GYRATION = 1e-14
"""Likewise of a point mass that turns: negligible, but MuJoCo and Pinocchio refuse zero [m2]."""
MUJOCO_LEAST = 1e-15
"""Inertia below which MuJoCo refuses a file (its mjMINVAL) [kg m2]."""
FIXED_GEAR_MASS = 1.0
"""Mass in the model of a counter-gear on a fixed pivot that has none given: it has no effect [kg]."""


@dataclass(frozen=True)
class Skeleton:
    """The spanning tree of joints over the bodies, and the joints that close loops."""

    parent: Mapping[str, Joint]
    """Joint towards the base, by body."""
    loops: tuple[Joint, ...]

    def origin(self, body: str) -> Point:
        """Origin of a body's frame in the model, in its described frame: its joint towards the base."""
        return ORIGIN if body == GROUND else joint_place(self.parent[body], body)

    def turning(self, body: str) -> list[str]:
        """Revolute joints from a body to the ground: the sum of their coordinates is its angle."""
        names = []
        while body != GROUND:
            joint = self.parent[body]
            names += [joint.name] if joint.revolute else []
            body = joint.other(body)
        return names


def joint_place(joint: Joint, body: str) -> Point:
    """Place of a joint, which is given, in a body's described frame."""
    point = joint.end(body).point
    assert point is not None
    return point


def skeleton(result: LinkageBalance, together: bool = True) -> Skeleton:
    """The driven joint, all prismatic ones, and where possible those of gears are in the tree; pins close the loops.

    ``together`` makes use of which bodies turn together: a parallelogram is then not singular where it lies flat.
    Raises ModelError for a loop of slides, or a body that is not connected.
    """
    linkage = result.linkage
    geared = {gear.joint for gear in result.gears.values()}
    sliding = [
        Joint(f"{first}~{second}", False, (End(first, ORIGIN), End(second, ORIGIN)), both=True)
        for first, second in linkage.turns_with
        if together
    ]
    joints = [*linkage.joints.values(), *sliding]
    order = sorted(
        joints, key=lambda j: (j.name != linkage.drive, j.revolute, j.name not in geared, not j.joins(GROUND))
    )
    group = {name: name for name in (GROUND, *linkage.bodies)}
    edges: list[Joint] = []
    loops: list[Joint] = []
    for joint in order:
        first, second = (group[end.body] for end in joint.ends)
        (loops if first == second else edges).append(joint)
        group = {body: first if value == second else value for body, value in group.items()}
    for joint in loops:
        if not joint.revolute:
            raise ModelError(f"{linkage.name}: prismatic joint {joint.name} closes a loop of slides: not supported")
    if loose := [body for body in linkage.bodies if group[body] != group[GROUND]]:
        raise ModelError(f"{linkage.name}: body {loose[0]} is not connected to the ground")
    parents: dict[str, Joint] = {}
    reached = {GROUND}
    while len(parents) < len(edges):
        for joint in edges:
            first, second = (end.body for end in joint.ends)
            if (first in reached) != (second in reached):
                body = second if first in reached else first
                parents[body] = joint
                reached.add(body)
    return Skeleton(parents, tuple(loops))


def coupling_rates(result: LinkageBalance) -> dict[str, dict[str, float]]:
    """Rates of the counter-gears' joints per rate of the linkage's joints, by name [-, 1/m]."""
    tree, rates = skeleton(result), {}
    for name, gear in result.gears.items():
        relative = dict.fromkeys(tree.turning(gear.gear.body), 1.0)
        for joint in tree.turning(gear.carrier):
            relative[joint] = relative.get(joint, 0.0) - 1.0
        rates[f"{name}*"] = {joint: -gear.gear.ratio * factor for joint, factor in relative.items() if factor}
    return rates


def geared_trajectory(result: LinkageBalance, path: Trajectory, linkage: Mechanism, geared: Mechanism) -> Trajectory:
    """A trajectory of the ``linkage`` as one of the same linkage with its counter-gears."""
    rates = coupling_rates(result)
    matrix = np.zeros((len(geared.coordinates), len(linkage.coordinates)))
    for row, name in enumerate(geared.coordinates):
        for joint, factor in rates.get(name, {name: 1.0}).items():
            matrix[row, linkage.coordinate_index(joint)] = factor
    q, v, a = (np.ascontiguousarray(each @ matrix.T) for each in (path.q, path.v, path.a))
    per_drive = np.einsum("ij,njk->nik", matrix, path.per_drive)
    return replace(path, mechanism=geared.name, q=q, v=v, a=a, per_drive=per_drive)


def linkage_mjcf(result: LinkageBalance, stage: str, couplings: bool = False, together: bool = True) -> str:
    """MJCF text of a stage: ``before``, ``force`` (counter-masses) or ``complete`` (and gears).

    ``couplings`` writes the gear ratios as joint equalities.
    """
    linkage, tree = result.linkage, skeleton(result, together)
    writer = _Writer(result, stage, tree)
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

    def __init__(self, result: LinkageBalance, stage: str, tree: Skeleton) -> None:
        self.result, self.tree, self.start = result, tree, result.start
        self.pieces = composite_bodies(result, stage)
        self.gears = list(result.gears.values()) if stage == "complete" else []
        self.positions: list[float] = []

    def children(self, element: Element, parent: str) -> None:
        """Bodies whose tree joint is on ``parent``, its sites, and the counter-gears that it carries."""
        for joint in self.tree.loops:
            if joint.joins(parent):
                SubElement(element, "site", name=f"{joint.name}.{parent}", pos=self._pos(joint, parent))
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
        start = {joint.name: self._position(body, joint) for body, joint in self.tree.parent.items()}
        for gear, rates in coupling_rates(self.result).items():
            offset = -sum(rate * start[joint] for joint, rate in rates.items())
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

    def _body(self, element: Element, parent: str, name: str, joint: Joint) -> None:
        # Fixed angle of a body's frame in its parent's [rad]; a pin starts aligned. A line of sliding has no
        # sense: bodies are along it as they were assembled, or the other way round.
        angle = self.start.angle[name] - self.start.angle[parent]
        if joint.both:
            turn = angle
        elif joint.revolute:
            turn = 0.0
        else:
            along = joint.end(parent).along - joint.end(name).along
            turn = along + np.pi * float(np.rint((angle - along) / np.pi))
        body = SubElement(element, "body", name=name, pos=self._pos(joint, parent))
        if turn:
            body.set("quat", _text(np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)))
        for label, axis in _axes(joint, name):
            kind = "hinge" if joint.revolute else "slide"
            SubElement(body, "joint", name=label, type=kind, axis=_text(*axis))
            self.positions.append(self._position(name, joint, axis))
        least = TRANSLATING_GYRATION if name in self.result.linkage.translating else POINT_GYRATION
        self._inertial(body, merged_body(self.pieces[name]), self._at(self.tree.origin(name)), least)
        self.children(body, name)

    def _counter_gear(self, element: Element, gear: GearResult) -> None:
        """A disc that turns about its pivot on its carrier."""
        at = gear.centres(self.result)[0] - self._at(self.tree.origin(gear.carrier))
        body = SubElement(element, "body", name=f"{gear.gear.name}*", pos=_text(*at, 0.0))
        SubElement(body, "joint", name=f"{gear.gear.name}*", type="hinge", axis="0 0 1")
        self.positions.append(0.0)
        mass = FIXED_GEAR_MASS if gear.counter_mass is None else gear.counter_mass
        self._inertial(body, CompositeBody(mass, gear.inertia, np.zeros(2)), np.zeros(2), POINT_GYRATION)

    def _inertial(self, element: Element, body: CompositeBody, origin: Floats, least: float) -> None:
        """A flat body: its inertia about z is the sum of the other two, ``least`` [m2] times its mass or more."""
        inertia = max(body.inertia, least * body.mass, 4 * MUJOCO_LEAST)
        diagonal = _text(inertia / 2, inertia / 2, inertia)
        SubElement(
            element, "inertial", pos=_text(*(body.at - origin), 0.0), mass=_text(body.mass), diaginertia=diagonal
        )

    def _at(self, place: Point) -> Floats:
        return place.at(self.result.values)

    def _pos(self, joint: Joint, body: str) -> str:
        """A joint's place in a body's frame in the model."""
        return _text(*(self._at(joint_place(joint, body)) - self._at(self.tree.origin(body))), 0.0)

    def _position(self, body: str, joint: Joint, axis: Floats = Z_AXIS) -> float:
        """Joint coordinate in the start configuration [rad, m]; ``axis`` in the body's frame."""
        parent = joint.other(body)
        if joint.revolute:
            return self.start.angle[body] - self.start.angle[parent]
        places = (self.start.point(name, self._at(joint_place(joint, name))) for name in (body, parent))
        gap = next(places) - next(places)
        return float(rotated(-self.start.angle[body], gap) @ axis[:2])


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
