"""Joints without a motor that yield across their axis, with clearance, and links that bend: coordinates more.

A pin lies in its bearing at (x, y) across the axis, in the axes of the body that the bearing is on. Of a joint of the
tree these are two slides before it; of a loop, two after its first anchor, with a massless body. Loads, momentum and
weight are then those of any mechanism, and what the bearing carries is a spring's force (``drive_trains``).

A link that bends is two bodies with a joint that turns between them, and a spring.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from balance.arrays import Floats
from balance.mechanism.forward_kinematics import Joint, Tree, plane_axes, poses
from balance.mechanism.loop_constraints import Anchor, Constraint, Loop
from balance.mechanism.mechanism import Mechanism, pseudo_inertia

from ..errors import RigError
from ..rig.bench import ElasticLink
from .added_bodies import inertial_parameters, moved_frame

_ACROSS = (" across, 1", " across, 2")
_BEYOND = " beyond its hinge"


def across(joint: str) -> tuple[str, str]:
    """Names of the two coordinates of a joint's pin across its axis."""
    return joint + _ACROSS[0], joint + _ACROSS[1]


def is_across(coordinate: str) -> bool:
    """Whether a coordinate is one of a pin across its axis."""
    return coordinate.endswith(_ACROSS)


def beyond_hinge(body: str) -> str:
    """Name of the part of a link beyond its hinge, and of the coordinate by which it turns."""
    return body + _BEYOND


def is_elastic(coordinate: str) -> bool:
    """Whether a coordinate is one of a pin across its axis, or of a link that bends."""
    return is_across(coordinate) or coordinate.endswith(_BEYOND)


def with_elastic_joints(mechanism: Mechanism, joints: Iterable[str]) -> Mechanism:
    """The mechanism with two coordinates more, driven, for each of ``joints``: joints without a motor, or loops.

    Raises RigError for another joint, and for a loop that welds, or may turn about more than one axis.
    """
    for name in joints:
        loop = next((x for x in mechanism.loops if isinstance(x, Loop) and not x.weld and x.name == name), None)
        if name in mechanism.coordinates and name not in mechanism.driven:
            mechanism = _at_joint(mechanism, name)
        elif loop is not None:
            mechanism = _at_loop(mechanism, loop)
        else:
            turning = [x for x in mechanism.coordinates if x not in mechanism.driven and _turns(mechanism, x)]
            known = [*turning, *(x.name for x in mechanism.closed_loops if not x.weld)]
            motor = f"; what a motor drives yields by bench.drives.{name}.transmission" * (name in mechanism.driven)
            raise RigError(
                f"bench.joints: {mechanism.name} has no joint {name!r} without a motor: "
                f"there are {', '.join(known) or 'none'}{motor}"
            )
    return mechanism


def _turns(mechanism: Mechanism, joint: str) -> bool:
    return mechanism.tree.joints[mechanism.coordinate_index(joint)].revolute


def _at_joint(mechanism: Mechanism, name: str) -> Mechanism:
    at = mechanism.coordinate_index(name)
    if not _turns(mechanism, name):
        raise RigError(f"bench.joints.{name}: expected a joint that turns: this one slides")
    tree = _before_joint(mechanism.tree, at)

    def moved(joint: int) -> int:
        return joint + 2 if joint >= at else joint

    loops = _tied_anew(mechanism.loops, moved, lambda end: replace(end, joint=moved(end.joint)))
    return _with_coordinates(replace(mechanism, tree=tree, loops=loops), at, across(name))


def _tied_anew(
    loops: Iterable[Constraint], moved: Callable[[int], int], anchored: Callable[[Anchor], Anchor]
) -> tuple[Constraint, ...]:
    found: list[Constraint] = []
    for loop in loops:
        if isinstance(loop, Loop):
            found.append(replace(loop, first=anchored(loop.first), second=anchored(loop.second)))
        else:
            second = None if loop.second is None else moved(loop.second)
            found.append(replace(loop, first=moved(loop.first), second=second))
    return tuple(found)


@lru_cache(maxsize=64)
def _before_joint(tree: Tree, at: int) -> Tree:
    """The tree with two slides before a joint; the same for the same tree, since it keeps programs written for it."""
    own = tree.joints[at]
    x, y, _ = plane_axes(own.axis)
    slides = (
        Joint(own.parent, own.rotation, own.position, x, revolute=False),
        Joint(at, np.eye(3), np.zeros(3), y, revolute=False),
        replace(own, parent=at + 1, rotation=np.eye(3), position=np.zeros(3)),
    )
    after = [replace(x, parent=x.parent + 2 if x.parent >= at else x.parent) for x in tree.joints[at + 1 :]]
    return Tree((*tree.joints[:at], *slides, *after), tuple(k + 2 if k >= at else k for k in tree.bodies))


def _at_loop(mechanism: Mechanism, loop: Loop) -> Mechanism:
    tree, end, body = mechanism.tree, loop.first, f"{loop.name} pin"
    pose = poses(tree, mechanism.home[None])
    turned = [k for k, joint in enumerate(tree.joints) if joint.revolute]
    axes = pose.axis[0, turned]
    if not len(axes) or np.abs(np.abs(axes @ axes[0]) - 1.0).max() > 1e-9:
        raise RigError(f"bench.joints.{loop.name}: expected a planar mechanism, so that its pin has one axis")
    axis = pose.rotation[0, end.joint].T @ axes[0]
    longer = _after_anchor(tree, end.joint, tuple(end.position), tuple(np.round(axis, 12)))
    loops = tuple(
        replace(x, first=Anchor(tree.size + 1, end.rotation, np.zeros(3))) if x is loop else x for x in mechanism.loops
    )
    row = len(mechanism.bodies)
    longer_by_pin = replace(
        mechanism,
        tree=longer,
        loops=loops,
        bodies=(*mechanism.bodies, body),
        parameters=np.vstack([mechanism.parameters, np.zeros(10)]),
        own_mass={**mechanism.own_mass, body: (row, np.zeros(10))},
    )
    return _with_coordinates(longer_by_pin, tree.size, across(loop.name))


@lru_cache(maxsize=64)
def _after_anchor(tree: Tree, parent: int, position: tuple[float, ...], axis: tuple[float, ...]) -> Tree:
    x, y, _ = plane_axes(np.array(axis))
    slides = (
        Joint(parent, np.eye(3), np.array(position), x, revolute=False),
        Joint(tree.size, np.eye(3), np.zeros(3), y, revolute=False),
    )
    return Tree((*tree.joints, *slides), (*tree.bodies, tree.size + 1))


def with_elastic_links(
    mechanism: Mechanism, links: Mapping[str, ElasticLink], planes: Mapping[str, float]
) -> Mechanism:
    """The mechanism with each of ``links`` in two parts; ``planes`` [m] are those that its bodies were moved by.

    Raises RigError for another body, for a hinge at a joint, and for a part that a body of that mass cannot have.
    """
    for body, link in links.items():
        if body not in mechanism.own_mass:
            raise RigError(
                f"bench.links: {mechanism.name} has no body {body!r}: there are {', '.join(mechanism.own_mass)}"
            )
        if (holder := mechanism.bodies[mechanism.own_mass[body][0]]) != body and is_elastic(holder):
            raise RigError(
                f"bench.links.{body}: is fixed to {holder.removesuffix(_BEYOND)}: expected one hinge of both"
            )
        if not mechanism.anchor(body, np.array(link.at)).position.any():
            raise RigError(f"bench.links.{body}.at: expected a place off the body's joint: that of its hinge")
        mechanism = _bent(mechanism, body, link, planes.get(body, 0.0))
    return mechanism


def _bent(mechanism: Mechanism, body: str, link: ElasticLink, plane: float) -> Mechanism:
    row, own = mechanism.own_mass[body]
    joint, axes = mechanism.tree.bodies[row], mechanism.anchor(body, np.zeros(3)).rotation
    at, centre = (mechanism.anchor(body, np.array(place)).position for place in (link.at, link.centre))
    part = inertial_parameters(link.mass, centre + plane * axes[:, 2], axes @ np.diag(link.inertia) @ axes.T)
    if np.linalg.eigvalsh(pseudo_inertia(own - part))[0] < -1e-9 * own[0]:
        raise RigError(
            f"bench.links.{body}: of its {own[0]:.4g} kg no body is left on the joint's side of the hinge: expected "
            "mass, centre and inertia of a part of it; state less mass, or less inertia"
        )
    new, beyond, farther = beyond_hinge(body), moved_frame(part, -at), part.copy()
    others, frames = dict[str, tuple[int, Floats]](), dict(mechanism.frames)
    for name, (index, mass) in mechanism.own_mass.items():
        others[name] = index + (index > row), mass
        if index == row and name != body and mass[0] > 0.0 and _is_beyond(mass[1:4] / mass[0], at):  # fixed to it
            others[name] = row + 1, moved_frame(mass, -at)
            frames[name] = frames[name][0], frames[name][1] - at
            farther += mass
    parameters = np.insert(mechanism.parameters, row + 1, moved_frame(farther, -at), axis=0)  # in order of the joints
    parameters[row] -= farther

    def moved(index: int) -> int:
        return index + 1 if index > joint else index

    def anchored(end: Anchor) -> Anchor:
        return _on_part(end, joint + 1, at) if end.joint == joint else replace(end, joint=moved(end.joint))

    sites = {
        name: replace(site, body=row + 1, position=site.position - at)
        if site.body == row and _is_beyond(site.position, at)
        else replace(site, body=site.body + (site.body > row))
        for name, site in mechanism.sites.items()
    }
    split = replace(
        mechanism,
        tree=_beyond_joint(mechanism.tree, joint, tuple(at), tuple(axes @ link.axis)),
        loops=_tied_anew(mechanism.loops, moved, anchored),
        bodies=(*mechanism.bodies[: row + 1], new, *mechanism.bodies[row + 1 :]),
        parameters=parameters,
        own_mass={**others, body: (row, own - part), new: (row + 1, beyond)},
        sites=sites,
        frames=frames,
    )
    return _with_coordinates(split, joint + 1, (new,))


def part_at(mechanism: Mechanism, body: str, place: Floats) -> Anchor:
    """A frame at a ``place`` (3,) [m] in the file's frame of a body, on the part of it that is there."""
    found, beyond = mechanism.anchor(body, place), beyond_hinge(mechanism.bodies[mechanism.body_index(body)])
    if beyond in mechanism.own_mass:
        joint = mechanism.tree.bodies[mechanism.body_index(beyond)]
        return _on_part(found, joint, mechanism.tree.joints[joint].position)
    return found


def _on_part(found: Anchor, beyond: int, at: Floats) -> Anchor:
    """An anchor on a body in two parts, on that ``beyond`` its hinge ``at`` (3,) [m] where it is farther out."""
    return replace(found, joint=beyond, position=found.position - at) if _is_beyond(found.position, at) else found


def _is_beyond(place: Floats, at: Floats) -> bool:
    """Whether a ``place`` (3,) [m] of a body is farther from its joint, along the way to its hinge, than that."""
    return bool(place @ at > at @ at)


@lru_cache(maxsize=64)
def _beyond_joint(tree: Tree, joint: int, at: tuple[float, ...], axis: tuple[float, ...]) -> Tree:
    """The tree with a joint that turns after another, and on it what is beyond; the same for the same tree."""
    place, along = np.array(at), np.array(axis) / np.linalg.norm(axis)
    after = []
    for x in tree.joints[joint + 1 :]:
        if x.parent == joint and _is_beyond(x.position, place):
            after.append(replace(x, parent=joint + 1, position=x.position - place))
        else:
            after.append(replace(x, parent=x.parent + 1 if x.parent > joint else x.parent))
    hinge = Joint(joint, np.eye(3), place, along, revolute=True)
    bodies = sorted((*(k + 1 if k > joint else k for k in tree.bodies), joint + 1))
    return Tree((*tree.joints[: joint + 1], hinge, *after), tuple(bodies))


def _with_coordinates(mechanism: Mechanism, at: int, added: tuple[str, ...]) -> Mechanism:
    """With driven coordinates ``added`` before the one at a place; the tree has them already."""
    places = [at] * len(added)

    def longer(values: Floats) -> Floats:
        return np.insert(values, places, 0.0)

    names = list(mechanism.coordinates)
    names[at:at] = added
    return replace(
        mechanism,
        coordinates=tuple(names),
        home=longer(mechanism.home),
        driven=(*mechanism.driven, *added),
        armature=longer(mechanism.armature),
        viscous=longer(mechanism.viscous),
        coulomb=longer(mechanism.coulomb),
        limits=np.insert(mechanism.limits, places, [-np.inf, np.inf], axis=0),
    )
