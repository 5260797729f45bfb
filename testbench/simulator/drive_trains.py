"""Drives that yield: transmissions with spring, damper and play, and control that follows the command with an error.

Joints and links that yield (``elastic_joints``) are coordinates as the drives are.

A transmission gives the mechanism one coordinate more a drive, the motor side: a body on the joint's own axis that
carries the rotor and the counter-masses of the hub. Its loads, momentum and weight are then those of any mechanism.
With z the angles of joints and motor sides, z_c commanded, their deviations e = z - z_c are found with the base's
motion (``bench_dynamics``), by the closed-loop mechanism's inverse dynamics: inertia, Coriolis forces and gravity,
projected on z.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from types import MappingProxyType

import numpy as np

from balance.arrays import Floats
from balance.closure import Closure, Trajectory
from balance.dynamics.inverse_dynamics import Response, simulate
from balance.mechanism.forward_kinematics import Joint, Tree
from balance.mechanism.mechanism import Mechanism
from balance.motion import Samples

from ..errors import RigError
from ..rig.bench import Control, DriveTrain, ElasticJoint, ElasticLink
from .added_bodies import moved_frame
from .elastic_joints import across, beyond_hinge, is_across, is_elastic

_MOTOR_SIDE = " motor side"
_INERTIAS = 64
"""Samples of a command at which the inertia is looked at."""


def _is_added(coordinate: str) -> bool:
    """Whether the mechanism's file does not have a coordinate."""
    return coordinate.endswith(_MOTOR_SIDE) or is_elastic(coordinate)


def motor_side(joint: str) -> str:
    """Name of the coordinate, and of the body, on the motor's side of a joint's transmission."""
    return f"{joint}{_MOTOR_SIDE}"


def with_motor_sides(mechanism: Mechanism, drives: Mapping[str, DriveTrain]) -> Mechanism:
    """The mechanism with a motor side for each drive that has a transmission; what is mounted there turns with it.

    Raises RigError for a joint that is not driven, does not turn or shares its body, and a site of another body.
    """
    for joint, drive in drives.items():
        if joint not in mechanism.driven:
            known = ", ".join(mechanism.driven) or "none"
            raise RigError(f"bench.drives: {mechanism.name} has no driven joint {joint!r}: there are {known}")
        index = mechanism.coordinate_index(joint)
        own = mechanism.tree.joints[index]
        if not own.revolute or index not in mechanism.tree.bodies:
            raise RigError(f"bench.drives.{joint}: expected a joint that turns, with a body of its own")
        if drive.transmission is not None:
            mechanism = _with_motor_side(mechanism, joint, own, drive.transmission.motor_side)
    return mechanism


def parameters_on_links(mechanism: Mechanism, of: Mechanism) -> Mechanism:
    """The mechanism ``of`` with the inertial parameters of ``mechanism``, motor sides and parts put on their links."""
    rows = [mechanism.bodies.index(body) for body in of.bodies]
    places, parameters = [mechanism.tree.bodies[row] for row in rows], mechanism.parameters[rows]
    for name, joint, own in zip(mechanism.bodies, mechanism.tree.bodies, mechanism.parameters, strict=True):
        if name.endswith(_MOTOR_SIDE):  # it has the joint of its link, and its frame
            parameters[places.index(mechanism.coordinate_index(name.removesuffix(_MOTOR_SIDE)))] += own
        elif is_elastic(name):
            hinge = mechanism.tree.joints[joint]
            parameters[places.index(hinge.parent)] += moved_frame(own, hinge.position)
    return replace(of, parameters=parameters)


def _with_motor_side(mechanism: Mechanism, joint: str, own: Joint, mounted: tuple[str, ...]) -> Mechanism:
    index, name, tree = mechanism.coordinate_index(joint), motor_side(joint), mechanism.tree
    body, sites = mechanism.tree.bodies.index(index), dict(mechanism.sites)
    for site in mounted:
        if site not in sites or sites[site].body != body:
            there = ", ".join(known for known, place in sites.items() if place.body == body) or "none"
            raise RigError(f"bench.drives.{joint}.transmission.motor_side: no site {site!r} there: expected {there}")
        sites[site] = replace(sites[site], body=len(mechanism.bodies))
    if own.parent >= 0 and own.parent not in tree.bodies:
        raise RigError(f"bench.drives.{joint}: its joint stands on one without a body: a transmission needs one")
    armature = np.append(mechanism.armature, mechanism.armature[index])
    armature[index] = 0.0
    return replace(
        mechanism,
        tree=_with_branch(tree, index),
        bodies=(*mechanism.bodies, name),
        coordinates=(*mechanism.coordinates, name),
        parameters=np.vstack([mechanism.parameters, np.zeros(10)]),
        own_mass={**mechanism.own_mass, name: (len(mechanism.bodies), np.zeros(10))},
        sites=sites,
        home=np.append(mechanism.home, mechanism.home[index]),
        driven=(*mechanism.driven, name),
        armature=armature,
        viscous=np.append(mechanism.viscous, 0.0),
        coulomb=np.append(mechanism.coulomb, 0.0),
        limits=np.vstack([mechanism.limits, mechanism.limits[index]]),
    )


@lru_cache(maxsize=16)
def _with_branch(tree: Tree, joint: int) -> Tree:
    """The tree with a joint and its body twice; the same for the same tree, since it keeps programs written for it."""
    return Tree((*tree.joints, tree.joints[joint]), (*tree.bodies, tree.size))


@dataclass(frozen=True)
class Spring:
    """A spring with a damper; what its deflection has within a radius of ``play`` the spring does not feel."""

    name: str
    """Table of the rig that states it."""
    along: Floats
    """Deflection per free coordinate, (1, nf); across the axis of a joint (2, nf)."""
    stiffness: float
    """[N m/rad, N/m]"""
    damping: float
    """[N m s/rad, N s/m]"""
    play: float
    """From the middle to a stop [rad, m]."""


@dataclass(frozen=True)
class DriveTrains:
    """The drives of a mechanism with motor sides along one command.

    Coordinates z are the driven joints and then the motor sides, ``mechanism.driven``; of them ``free`` move by
    themselves, (nz, nf): a joint on a transmission, and a motor with a control, with its joint where that is rigid.
    """

    mechanism: Mechanism
    drives: Mapping[str, DriveTrain]
    joints: Mapping[str, ElasticJoint]
    links: Mapping[str, ElasticLink]
    command: Trajectory
    """As commanded, motor sides like their joints, pins in the middle of their bearings."""
    rigid: Response
    """Of the command followed exactly."""

    @classmethod
    def of(
        cls, mechanism: Mechanism, drives: Mapping[str, DriveTrain], rigid: Trajectory,
        joints: Mapping[str, ElasticJoint] = MappingProxyType({}),
        links: Mapping[str, ElasticLink] = MappingProxyType({}),
    ) -> "DriveTrains":  # fmt: skip
        """For ``mechanism`` with motor sides and pins, along the trajectory of the mechanism without them.

        Raises RigError for a rotor without inertia, and for joints that cannot yield by themselves.
        """
        _refuse_without_inertia(mechanism, drives)
        closure, own = Closure(mechanism).without_idle(), [x for x in mechanism.coordinates if not _is_added(x)]
        if closure.dof != len(mechanism.driven):
            raise RigError(
                f"bench.joints, bench.links: {mechanism.name} has {closure.dof} degrees of freedom for "
                f"{len(mechanism.driven)} coordinates with {', '.join([*joints, *links])}: its loops hold some of "
                "them; leave out joints of redundant links"
            )

        def whole(x: Floats) -> Floats:
            columns = dict(zip(own, x.T, strict=True))
            added = (columns.get(c.removesuffix(_MOTOR_SIDE), np.zeros(len(x))) for c in mechanism.coordinates)
            return np.column_stack(list(added))

        near = replace(rigid, q=whole(rigid.q), v=whole(rigid.v), a=whole(rigid.a))
        at = [mechanism.coordinate_index(name) for name in mechanism.driven]
        samples = Samples(rigid.time, near.q[:, at], near.v[:, at], near.a[:, at], joints=mechanism.driven)
        command = closure.follow(samples, near=near)
        return cls(mechanism, drives, joints, links, command, simulate(mechanism, command))

    @cached_property
    def _indices(self) -> list[int]:
        return [self.mechanism.coordinate_index(name) for name in self.mechanism.driven]

    @cached_property
    def free(self) -> Floats:
        """Motion of all coordinates per free one, (nz, nf)."""
        moved: dict[int, set[str]] = {}
        for joint, (own, motor) in _places(self.drives).items():
            moved[own] = {joint}
            if motor is not None and motor != own:
                moved[motor] = {motor_side(joint)}
        for name in filter(is_elastic, self.mechanism.driven):
            moved[len(moved)] = {name}
        return np.array([[float(name in moved[k]) for k in sorted(moved)] for name in self.mechanism.driven])

    @cached_property
    def inertias(self) -> Floats:
        """Generalised inertia of the free coordinates along the command, (n, nf, nf) [kg m2, kg]."""
        start = self.command
        moved = [replace(start, a=start.a + start.per_drive @ along) for along in self.free.T]
        still = self.projected(self.rigid.torque)
        return np.stack([self._loads(one) - still for one in moved], axis=2)

    @property
    def inertia(self) -> Floats:
        """The same in the middle, (nf, nf) [kg m2, kg].

        Whatever it is on the way is less than twice of this in every direction, so that rounds from it converge.
        """
        some = every(self.command, max(1, len(self.command.time) // _INERTIAS))
        found = self.along(some).inertias
        mean = found.mean(axis=0)
        whitened = np.linalg.inv(np.linalg.cholesky(mean))
        shares = np.linalg.eigvalsh(whitened @ found @ whitened.T)
        return np.asarray(0.5 * (shares.min() + shares.max()) * mean)

    def along(self, command: Trajectory) -> "DriveTrains":
        """The same drives along another command."""
        return replace(self, command=command, rigid=simulate(self.mechanism, command))

    def _loads(self, trajectory: Trajectory) -> Floats:
        return self.projected(simulate(self.mechanism, trajectory).torque)

    def projected(self, torque: Mapping[str, Floats]) -> Floats:
        """Torques (n,) [N m] by driven coordinate on the free ones, (n, nf) [N m]."""
        return np.column_stack([torque[name] for name in self.mechanism.driven]) @ self.free

    def follow(self, deviation: "Deviation", near: Trajectory, closure: Closure) -> Trajectory:
        """The trajectory with a deviation from the command, closed from one that is near."""
        commanded = (self.command.q, self.command.v, self.command.a)
        q, v, a = (x[:, self._indices] + e @ self.free.T for x, e in zip(commanded, deviation.all, strict=True))
        return closure.follow(Samples(near.time, q, v, a, joints=self.mechanism.driven), near=near)

    @property
    def sizes(self) -> Floats:
        """Accelerations that are large for the free coordinates, (nf,) [rad/s2, m/s2]: the largest commanded.

        Of pins, that at 0.1 m from an axis.
        """
        largest = max(float(np.abs(self.command.a[:, self._indices]).max()), 1e-9)
        return largest * np.array([0.1 if is_across(name) else 1.0 for name in self.mechanism.driven]) @ self.free

    @cached_property
    def controls(self) -> list[tuple[int, Control, Floats]]:
        """Of each control: its free coordinate, itself, and the torque of the rigid mechanism, (n,) [N m]."""
        torque = self.motor_torque(self.rigid.torque)
        return [
            (k, drive.control, torque[joint])
            for joint, drive in self.drives.items()
            if drive.control is not None and (k := _places(self.drives)[joint][1]) is not None
        ]

    @cached_property
    def springs(self) -> "list[Spring]":
        """Of each transmission, and of each joint and link that yields."""
        found = []
        for name, drive in self.drives.items():
            if (spring := drive.transmission) is not None:
                own, motor = _places(self.drives)[name]
                along = np.eye(self.free.shape[1])[[own]]
                along -= 0.0 if motor is None else np.eye(along.shape[1])[[motor]]
                found.append(
                    Spring(f"bench.drives.{name}", along, spring.stiffness, spring.damping, spring.backlash / 2.0)
                )
        for name, joint in self.joints.items():
            rows = [self.mechanism.driven.index(coordinate) for coordinate in across(name)]
            found.append(
                Spring(f"bench.joints.{name}", self.free[rows], joint.stiffness, joint.damping, joint.clearance)
            )
        for name, link in self.links.items():
            rows = [self.mechanism.driven.index(beyond_hinge(name))]
            found.append(Spring(f"bench.links.{name}", self.free[rows], link.stiffness, link.damping, 0.0))
        return found

    def ripple(self, deviation: "Deviation") -> Floats:
        """Torque of the motors' cogging on the free coordinates, (n, nf) [N m]."""
        found = np.zeros_like(deviation.position)
        for k, control, _ in self.controls:
            if control.ripple is not None:
                column = int(np.argmax(self.free[:, k]))
                angle = self.command.q[:, self._indices[column]] + deviation.position[:, k]
                found[:, k] = control.ripple.torque * np.sin(control.ripple.order * angle)
        return found

    def motor_torque(self, torque: Mapping[str, Floats]) -> dict[str, Floats]:
        """Torque of each motor, at its joint, (n,) [N m], from the torques of all driven coordinates: it moves both."""
        return {
            joint: values + torque.get(motor_side(joint), 0.0)
            for joint, values in torque.items()
            if not _is_added(joint)
        }


def _refuse_without_inertia(mechanism: Mechanism, drives: Mapping[str, DriveTrain]) -> None:
    for joint, drive in drives.items():
        index = mechanism.coordinate_index(joint)
        if drive.transmission is None or drive.control is None:
            continue
        if not mechanism.armature[mechanism.coordinate_index(motor_side(joint))] > 0.0:
            raise RigError(
                f"bench.drives.{joint}: a motor with transmission and control needs the inertia of its rotor: state "
                f"bench.rotors.{mechanism.coordinates[index]}"
            )


@dataclass(frozen=True)
class Deviation:
    """How far the free coordinates are from the command, (n, nf) each [rad, rad/s, rad/s2]."""

    position: Floats
    velocity: Floats
    acceleration: Floats

    @property
    def all(self) -> tuple[Floats, Floats, Floats]:
        """Position, velocity, acceleration."""
        return self.position, self.velocity, self.acceleration


def _places(drives: Mapping[str, DriveTrain]) -> dict[str, tuple[int, int | None]]:
    """Free coordinates of each drive: its joint's, and its motor's where that is controlled; one where it is rigid."""
    found, count = {}, 0
    for joint, drive in drives.items():
        own, elastic, controlled = count, drive.transmission is not None, drive.control is not None
        count += elastic and controlled
        found[joint] = (own, count if controlled else None)
        count += 1
    return found


def every(trajectory: Trajectory, stride: int) -> Trajectory:
    """Every ``stride``-th sample of a trajectory."""
    parts = {name: getattr(trajectory, name)[::stride] for name in ("time", "q", "v", "a", "per_drive")}
    return replace(trajectory, **parts)
