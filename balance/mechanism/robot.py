"""A robot of links and joints, as URDF and SDF describe it, as MuJoCo's MjSpec.

A joint to a link that another joint carries already closes a loop: it moves a massless copy of the link, which is
welded to the link.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import ModelError
from .mjcf_compiler import LOOP_END, MASSLESS, import_mujoco

JOINT_LIMIT = 900
"""Most joints of a robot, fixed ones included: MuJoCo takes about a thousand bodies on each other."""


@dataclass(frozen=True)
class Placement:
    """A frame in another one."""

    position: Floats = field(default_factory=lambda: np.zeros(3))
    rotation: Floats = field(default_factory=lambda: np.eye(3))

    def __matmul__(self, inner: "Placement") -> "Placement":
        """What is at ``inner`` in this frame, in the frame that this one is in."""
        return Placement(self.position + self.rotation @ inner.position, self.rotation @ inner.rotation)

    def inverse(self) -> "Placement":
        """The outer frame in this one."""
        return Placement(-(self.rotation.T @ self.position), self.rotation.T)


@dataclass(frozen=True)
class Link:
    """A rigid body: mass [kg], the frame at its centre, and its inertia tensor there, (3, 3) [kg m2]."""

    mass: float = 0.0
    centre: Placement = field(default_factory=Placement)
    inertia: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    weightless: bool = False
    """Whether the file takes its weight off."""


@dataclass(frozen=True)
class RobotJoint:
    """A joint: its frame in its parent link and in its child link, and its axes in that frame."""

    kind: str
    parent: str
    child: str
    in_parent: Placement
    in_child: Placement = field(default_factory=Placement)
    axes: Mapping[str, Floats] = field(default_factory=dict)
    """Axes (3,) by what is added to the joint's name: nothing where there is one."""
    limits: tuple[float, float] = (-math.inf, math.inf)
    damping: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    armature: float = 0.0
    follows: tuple[str, float, float] | None = None
    """The joint that leads, the ratio, and the offset [rad, m]."""


@dataclass(frozen=True)
class Robot:
    """What a file says, by the names in it; ``world`` is the base where it is no link."""

    file: str
    links: dict[str, Link]
    joints: dict[str, RobotJoint]
    base: Placement = field(default_factory=Placement)
    """Of the link that no joint carries, in the world."""
    gravity: Floats = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    loops: tuple[tuple[str, str, bool], ...] = ()
    """Two links or joints whose frames coincide, and whether their axes do."""
    motors: tuple[str, ...] = ()
    home: Mapping[str, float] = field(default_factory=dict)
    """Of joints that do not start at zero, [rad, m]."""
    of_no_body: dict[str, Floats] = field(default_factory=dict)
    """Principal moments (3,) [kg m2] that MuJoCo refuses, being too small or of no body: others stand in the spec."""

    @property
    def roots(self) -> list[str]:
        """Links that no joint carries."""
        carried = {joint.child for joint in self.joints.values()}
        return [name for name in self.links if name not in carried and name != "world"]

    def restore(self, model: Any) -> None:  # noqa: ANN401
        """Put the principal moments and ``home`` into MuJoCo's ``model``. Raises ModelError for a joint of ``home``."""
        for name, size in self.of_no_body.items():
            model.body(name).inertia[:] = size
        known = {f"{name}{axis}" for name, joint in self.joints.items() for axis in joint.axes}
        for name, value in self.home.items():
            if name not in known:
                there = ", ".join(sorted(known))
                raise ModelError(
                    f"{self.file}: home in its YAML file names {name!r}: expected joints that turn or slide: {there}"
                )
            model.key_qpos[0, model.joint(name).qposadr] = value

    def spec(self) -> Any:  # noqa: ANN401
        """As MuJoCo's MjSpec. Raises ModelError for a link that is joined to nothing, and for unknown names."""
        return _SpecOfRobot(self).spec


class _SpecOfRobot:
    """An MjSpec from links and joints."""

    def __init__(self, robot: Robot) -> None:
        if len(robot.joints) > JOINT_LIMIT:
            raise ModelError(f"{robot.file}: has {len(robot.joints)} joints; at most {JOINT_LIMIT} are read")
        self.robot, self.mujoco = robot, import_mujoco()
        self.spec = self.mujoco.MjSpec()
        self.spec.compiler.degree = False
        self.spec.option.gravity = robot.gravity
        self.bodies = {"world": self.spec.worldbody}
        self._place_all()
        for first, second, weld in robot.loops:
            self._tie(self._site(first), self._site(second), f"{first}-{second}", weld)
        for name, joint in robot.joints.items():
            if joint.follows:
                leader, ratio, offset = joint.follows
                kind = self.mujoco.mjtEq.mjEQ_JOINT
                loop = self.spec.add_equality(name=name, type=kind, name1=name, name2=leader)
                loop.data[:5] = [offset, ratio, 0.0, 0.0, 0.0]
        for name in robot.motors:
            if len(robot.joints[name].axes) == 1:
                self.spec.add_actuator(name=name, target=name, trntype=self.mujoco.mjtTrn.mjTRN_JOINT)
        if robot.home:
            self.spec.add_key(name="home")

    def _place_all(self) -> None:
        """Bodies from the base outwards; a joint whose child is placed already closes a loop."""
        links, joints, file = self.robot.links, self.robot.joints, self.robot.file
        for name, joint in joints.items():
            for link in (joint.parent, joint.child):
                if link not in links and link != "world":
                    raise ModelError(f"{file}: joint {name!r} joins link {link!r}: there are {', '.join(links)}")
            if joint.parent == joint.child:
                raise ModelError(f"{file}: joint {name!r} joins link {joint.child!r} to itself: expected two links")
        roots = self.robot.roots
        if len(roots) > (1 if "world" not in {j.parent for j in joints.values()} else 0):
            raise ModelError(f"{file}: links {', '.join(roots)} are joined to nothing; join all but the base by joints")
        for root in roots:
            self._add_body(root, self.spec.worldbody, self.robot.base, root)
        waiting = list(joints)
        while waiting:
            name = next((name for name in waiting if joints[name].parent in self.bodies), "")
            if not name:
                raise ModelError(f"{file}: joints {', '.join(waiting)} go round without the base; fix a link to it")
            waiting.remove(name)
            self._add_joint(name, joints[name])

    def _add_joint(self, name: str, joint: RobotJoint) -> None:
        placed = joint.child in self.bodies
        label = f"{joint.child} of {name}" if placed else joint.child
        at = joint.in_parent @ joint.in_child.inverse()
        body = self._add_body(label, self.bodies[joint.parent], at, "" if placed else joint.child)
        kinds, point, turn = self.mujoco.mjtJoint, joint.in_child.position, joint.in_child.rotation
        if joint.kind in ("ball", "spherical"):
            body.add_joint(name=name, type=kinds.mjJNT_BALL, pos=point, damping=[joint.damping, 0, 0])
        elif joint.kind != "fixed":
            kind = kinds.mjJNT_SLIDE if joint.kind == "prismatic" else kinds.mjJNT_HINGE
            for suffix, axis in joint.axes.items():
                added = body.add_joint(name=f"{name}{suffix}", type=kind, pos=point, axis=turn @ axis)
                added.damping[0], added.stiffness[0] = joint.damping, joint.stiffness
                added.frictionloss, added.armature = joint.friction, joint.armature
                if max(map(abs, joint.limits)) < math.inf:
                    added.range, added.limited = joint.limits, 1
        if placed:
            self._tie(self._add_site(body), self._add_site(self.bodies[joint.child]), name, True)

    def _add_body(self, name: str, parent: Any, at: Placement, link: str) -> Any:  # noqa: ANN401
        """A body with the mass of a ``link``, none if it is empty; a link fixed without mass is also a site."""
        body = parent.add_body(name=name, pos=at.position, quat=self._quaternion(at.rotation))
        own = self.robot.links[link] if link else Link()
        size, axes = np.linalg.eigh(own.inertia)
        axes = axes * np.sign(np.linalg.det(axes))
        if size[0] < 0.0 or size[0] + size[1] < size[2] or 0.0 < size[2] < MASSLESS:
            self.robot.of_no_body[name], size = size, np.full(3, max(np.abs(size).max(), 2.0 * MASSLESS))
        body.gravcomp, body.mass = float(own.weightless), own.mass
        body.inertia, body.explicitinertial = size, True
        body.ipos, body.iquat = own.centre.position, self._quaternion(own.centre.rotation @ axes)
        if link:
            self.bodies[link] = body
            if own.mass == 0.0:
                body.add_site(name=link)
        return body

    def _site(self, name: str) -> str:
        """A site at the frame of a link or joint."""
        joint = self.robot.joints.get(name)
        link = joint.child if joint else name
        if link not in self.bodies:
            raise ModelError(f"{self.robot.file}: closed_loop names {name!r}, which is no link and no joint of it")
        return self._add_site(self.bodies[link], joint.in_child if joint else Placement())

    def _add_site(self, body: Any, at: Placement | None = None) -> str:  # noqa: ANN401
        at, name = at or Placement(), f"{LOOP_END} {len(self.spec.sites) + 1} on {body.name}"
        body.add_site(name=name, pos=at.position, quat=self._quaternion(at.rotation))
        return name

    def _tie(self, first: str, second: str, name: str, weld: bool) -> None:
        kinds = self.mujoco.mjtEq
        loop = self.spec.add_equality(name=name, type=kinds.mjEQ_WELD if weld else kinds.mjEQ_CONNECT)
        loop.name1, loop.name2, loop.objtype = first, second, self.mujoco.mjtObj.mjOBJ_SITE

    def _quaternion(self, rotation: Floats) -> Floats:
        quaternion = np.empty(4)
        self.mujoco.mju_mat2Quat(quaternion, rotation.ravel())
        return quaternion
