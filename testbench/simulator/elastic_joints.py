"""Joints without a motor that yield across their axis, with clearance: two coordinates more each.

A pin lies in its bearing at (x, y) across the axis, in the axes of the body that the bearing is on. Of a joint of the
tree these are two slides before it; of a loop, two after its first anchor, with a massless body. Loads, momentum and
weight are then those of any mechanism, and what the bearing carries is a spring's force (``drive_trains``).
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from balance.arrays import Floats
from balance.mechanism import forward_kinematics
from balance.mechanism.forward_kinematics import Joint, Tree
from balance.mechanism.loop_constraints import Anchor, Constraint, Loop
from balance.mechanism.mechanism import Mechanism

from ..errors import RigError

_ACROSS = (" across, 1", " across, 2")


def across(joint: str) -> tuple[str, str]:
    """Names of the two coordinates of a joint's pin across its axis."""
    return joint + _ACROSS[0], joint + _ACROSS[1]


def is_across(coordinate: str) -> bool:
    """Whether a coordinate is one of a pin across its axis."""
    return coordinate.endswith(_ACROSS)


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
            raise RigError(
                f"bench.joints: {mechanism.name} has no joint {name!r} without a motor: "
                f"there are {', '.join(known) or 'none'}"
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

    def anchored(end: Anchor) -> Anchor:
        return replace(end, joint=moved(end.joint))

    loops: list[Constraint] = []
    for loop in mechanism.loops:
        if isinstance(loop, Loop):
            loops.append(replace(loop, first=anchored(loop.first), second=anchored(loop.second)))
        else:
            second = None if loop.second is None else moved(loop.second)
            loops.append(replace(loop, first=moved(loop.first), second=second))
    return _with_coordinates(replace(mechanism, tree=tree, loops=tuple(loops)), at, name)


@lru_cache(maxsize=64)
def _before_joint(tree: Tree, at: int) -> Tree:
    """The tree with two slides before a joint; the same for the same tree, since it keeps programs written for it."""
    own = tree.joints[at]
    x, y = _normals(own.axis)
    slides = (
        Joint(own.parent, own.rotation, own.position, x, revolute=False),
        Joint(at, np.eye(3), np.zeros(3), y, revolute=False),
        replace(own, parent=at + 1, rotation=np.eye(3), position=np.zeros(3)),
    )
    after = [replace(x, parent=x.parent + 2 if x.parent >= at else x.parent) for x in tree.joints[at + 1 :]]
    return Tree((*tree.joints[:at], *slides, *after), tuple(k + 2 if k >= at else k for k in tree.bodies))


def _at_loop(mechanism: Mechanism, loop: Loop) -> Mechanism:
    tree, end, body = mechanism.tree, loop.first, f"{loop.name} pin"
    pose = forward_kinematics.pose(tree, mechanism.home[:, None])
    turned = [k for k, joint in enumerate(tree.joints) if joint.revolute]
    axes = np.array([[float(np.squeeze(x)) for x in pose.axis[k]] for k in turned])
    if not len(axes) or np.abs(np.abs(axes @ axes[0]) - 1.0).max() > 1e-9:
        raise RigError(f"bench.joints.{loop.name}: expected a planar mechanism, so that its pin has one axis")
    arms = [pose.arm(end.joint, unit) for unit in np.eye(3)]
    axis = np.array([[float(np.squeeze(x)) for x in arm] for arm in arms]) @ axes[0]
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
    return _with_coordinates(longer_by_pin, tree.size, loop.name)


@lru_cache(maxsize=64)
def _after_anchor(tree: Tree, parent: int, position: tuple[float, ...], axis: tuple[float, ...]) -> Tree:
    x, y = _normals(np.array(axis))
    slides = (
        Joint(parent, np.eye(3), np.array(position), x, revolute=False),
        Joint(tree.size, np.eye(3), np.zeros(3), y, revolute=False),
    )
    return Tree((*tree.joints, *slides), (*tree.bodies, tree.size + 1))


def _normals(axis: Floats) -> Floats:
    """Two unit vectors normal to a unit ``axis`` (3,) and to each other, along the frame's axes where that can be."""
    x = np.roll(np.eye(3)[int(np.argmax(np.abs(axis)))], 1)
    x = x - (x @ axis) * axis
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(axis, x)])


def _with_coordinates(mechanism: Mechanism, at: int, name: str) -> Mechanism:
    """With two coordinates before the one at a place; the tree has them already."""

    def longer(values: Floats) -> Floats:
        return np.insert(values, [at, at], 0.0)

    names = list(mechanism.coordinates)
    names[at:at] = across(name)
    return replace(
        mechanism,
        coordinates=tuple(names),
        home=longer(mechanism.home),
        driven=(*mechanism.driven, *across(name)),
        armature=longer(mechanism.armature),
        viscous=longer(mechanism.viscous),
        coulomb=longer(mechanism.coulomb),
        limits=np.insert(mechanism.limits, [at, at], [-np.inf, np.inf], axis=0),
    )
