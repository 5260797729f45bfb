"""Base and drives together: the base on its mounts, joints and motors on their transmissions and controls.

Unknown are the base's motion x and the deviations e of joints and motors from the command. With everything constant
that is nearly so (an inertia in the middle of all, springs, dampers, controls) they are one linear system,

    M0 (x'', e'') + C (x', e') + K (x, e) = p,   p = exact loads - those of M0,

whose response is exact between samples. The exact loads (shaking wrench and inverse dynamics of the mechanism as it
moves, to first order in the base's motion) depend on the motion that is sought, so rounds follow until nothing changes:
first with every fourth sample, then with all. Play and feet that lift or slide are stepped from sample to sample.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.closure import Closure, Trajectory
from balance.dynamics.inverse_dynamics import Response, simulate
from balance.dynamics.moving_base import (
    BaseMotion,
    ElasticBase,
    Mount,
    apparent_gravity,
    displacement_at,
    linear_response,
    times,
)
from balance.errors import ClosureError
from balance.mechanism.mechanism import Mechanism

from ..errors import RigError
from ..rig.bench import Rotor
from .added_bodies import rotor_momentum
from .drive_trains import Deviation, DriveTrains, Spring, every
from .moving_base_coupling import Coupling, base_motion_loads, base_motion_torque, weight_wrench_change

if TYPE_CHECKING:
    from .stepping import Stepped

ROUNDS = 150
TOLERANCE = 1e-6
"""Change of the accelerations in a round over their largest, at which base and drives agree."""
_COARSE_TOLERANCE = 1e-4
COARSE = 4
"""Samples of a run per sample in which a solution is sought first."""
_COARSE_FROM = 3000
"""Samples from which that is worth while."""
_INERTIA_EVERY = 16
"""Samples of a run per sample of its inertia: rounds end where that of the loads is, whatever this one is."""


@dataclass(frozen=True)
class Contact:
    """Feet that carry pressure only and slide by dry friction."""

    at: Floats
    """Displacement of each foot per displacement of the base, (feet, 3, 6)."""
    stiffness: Floats
    """Along each axis, (feet, 3) [N/m]."""
    damping: Floats
    """Along each axis, (feet, 3) [N s/m]."""
    preload: Floats
    """Pressure at rest, (feet,) [N]."""
    upright: int
    """Axis along which they press."""
    friction: float

    @classmethod
    def of(cls, mounts: Sequence[Mount], base: ElasticBase, gravity: Floats, friction: float) -> "Contact":
        """Of mounts under a base with what it carries. Raises RigError where a foot carries no weight at rest."""
        upright = int(np.argmax(np.abs(gravity)))
        if not np.abs(gravity[upright]) > 0.99 * np.linalg.norm(gravity) > 0.0:
            raise RigError(
                f"bench.contact: feet stand along an axis of the base: expected gravity there, found {gravity}"
            )
        at = np.array([displacement_at(np.array(mount.position)) for mount in mounts])
        stiffness = np.array([mount.stiffness for mount in mounts])
        weight = base.mass[:, :3] @ gravity
        pressed = -(stiffness * (at @ np.linalg.solve(base.stiffness, weight)))[:, upright]
        preload = pressed * -np.sign(gravity[upright])
        if not preload.min() > 0.0:
            at_foot = int(np.argmin(preload))
            raise RigError(
                f"bench.contact: the foot bench.mounts.{at_foot} carries {preload.min():.3g} N at rest: expected "
                "pressure on each; move the mounts apart, or the centre of mass between them"
            )
        damping = np.array([mount.damping for mount in mounts])
        return cls(at, stiffness, damping, preload, upright, friction)

    @property
    def pressed(self) -> tuple[Floats, int, float]:
        """Pressure at rest (feet,) [N], along which axis, and the coefficient of friction [-]."""
        return self.preload, self.upright, self.friction

    @property
    def bonded(self) -> Floats:
        """Force on each foot per displacement, then velocity, were it bonded, (3 feet, 12) [N/m, N s/m]."""
        return -np.hstack([(k[:, :, None] * self.at).reshape(-1, 6) for k in (self.stiffness, self.damping)])


@dataclass(frozen=True)
class _Core:
    """y' = A y + B w: y = (x, e, x', e', integrals of control, torques of current loops), w = (p, torques ahead)."""

    a: Floats
    b: Floats
    positions: int
    """Of x and e, 6 + nf."""
    mass: Floats
    """M0, (6 + nf, 6 + nf)."""
    ahead: Floats
    """Torques of the rigid mechanism that current loops are given, (n, loops) [N m]."""
    at_once: Floats
    """The same without a current loop, on x and e, (n, 6 + nf) [N m]."""
    drives: DriveTrains | None
    contact: Contact | None

    @classmethod
    def of(
        cls, base: ElasticBase, drives: DriveTrains | None, inertia: tuple[Floats, Floats], count: int,
        contact: Contact | None,
    ) -> "_Core":  # fmt: skip
        """Of base and drives with ``inertia``, as ``DriveTrains.inertia`` has it, for ``count`` samples."""
        own, shared = inertia
        n = 6 + len(own)
        mass, force = np.block([[base.mass, shared], [shared.T, own]]), np.zeros((n, 2 * n))
        force[:6, :6], force[:6, n : n + 6] = -base.stiffness, -base.damping
        for spring in drives.springs if drives else ():
            force[6:, 6:n] -= spring.stiffness * spring.along.T @ spring.along
            force[6:, n + 6 :] -= spring.damping * spring.along.T @ spring.along
        controls = drives.controls if drives else []
        size = 2 * n + sum((c.integral_time is not None) + (c.bandwidth is not None) for _, c, _ in controls)
        loops = [torque * c.feedforward for _, c, torque in controls if c.bandwidth is not None]
        a, b, at_once = np.zeros((size, size)), np.zeros((size, n + len(loops))), np.zeros((count, n))
        force = np.hstack([force, np.zeros((n, size - 2 * n))])
        i, loop = 2 * n, n
        for k, control, torque in controls:
            wanted = np.zeros(size)
            wanted[6 + k], wanted[n + 6 + k] = -control.stiffness, -control.damping
            if control.integral_time is not None:
                wanted[i], a[i, 6 + k] = -control.stiffness / control.integral_time, 1.0
                i += 1
            if control.bandwidth is None:
                force[6 + k] += wanted
                at_once[:, 6 + k] += control.feedforward * torque
                continue
            rate = 2.0 * np.pi * control.bandwidth
            a[i], b[i, loop], force[6 + k, i] = rate * wanted, rate, 1.0
            a[i, i] -= rate
            i, loop = i + 1, loop + 1
        a[:n, n : 2 * n] = np.eye(n)
        a[n : 2 * n], b[n : 2 * n, :n] = np.linalg.solve(mass, force), np.linalg.inv(mass)
        return cls(a, b, n, mass, np.array(loops).reshape(len(loops), count).T, at_once, drives, contact)

    def respond(
        self, push: Floats, step: float, stepped: "Stepped | None" = None, before: Floats | None = None
    ) -> Floats:
        """From equilibrium under ``push`` (n, 6 + nf) [N, N m] in steps of ``step`` [s]; the base's from rest.

        Where something is ``stepped``, ``push`` has its inertia beyond the constant one at the accelerations ``before``
        (n, 6 + nf), and that becomes what it is at those found.

        Displacements, velocities and accelerations of base and deviations, (3, n, 6 + nf).
        """
        n, driven = self.positions, np.hstack([push + self.at_once, self.ahead])
        rest = np.linalg.solve(-self.a, self.b @ driven[0])
        if stepped is not None:
            state, released = stepped.through(driven, rest, np.zeros_like(push) if before is None else before)
            driven[:, :n] += released
        else:
            state = rest + linear_response(self.a, self.b, driven - driven[0], step)
        rates = times(self.a[n : 2 * n], state) + times(self.b[n : 2 * n], driven)
        return np.stack([state[:, :n], state[:, n : 2 * n], rates])

    def bounces(self) -> list[tuple[float, Spring]]:
        """Natural frequency of each pin on its spring, the rest free [rad/s], and its spring."""
        inverse = np.linalg.inv(self.mass)[6:, 6:]
        pins = [spring for spring in self._from_step_to_step if len(spring.along) > 1]
        mobility = [np.linalg.norm(spring.along @ inverse @ spring.along.T, 2) for spring in pins]
        return [(float(np.sqrt(s.stiffness * m)), s) for s, m in zip(pins, mobility, strict=True)]

    @property
    def _from_step_to_step(self) -> list[Spring]:
        """Springs with play, pins and links: they ring too fast for rounds from a constant inertia."""
        drives = () if self.drives is None else self.drives.springs
        return [spring for spring in drives if spring.play or not spring.name.startswith("bench.drives.")]

    def stepped(self, step: float, beyond: Floats, every: int) -> "Stepped":
        """In steps of ``step`` [s] with inertia ``beyond`` the constant one, for ``every`` samples each."""
        from .stepping import Stepped

        n, springs, contact = self.positions, self._from_step_to_step, self.contact
        turns, feet = 2 * len(springs), 0 if contact is None else 3 * len(contact.at)
        read, into = np.zeros((turns + feet, len(self.a))), np.zeros((n, turns + feet))
        for k, spring in enumerate(springs):
            rows = slice(2 * k, 2 * k + len(spring.along))
            read[rows, 6:n], into[6:, rows] = spring.along, spring.stiffness * spring.along.T
        if contact is not None:
            read[turns:, :6], read[turns:, n : n + 6] = np.hsplit(contact.bonded, 2)
            into[:6, turns:] = contact.at.reshape(-1, 6).T
        play = np.array([spring.play for spring in springs])
        pressed = (np.zeros(0), 0, 0.0) if contact is None else contact.pressed
        return Stepped(self.a, self.b, step, n, read, into, play, pressed, beyond, every)


@dataclass(frozen=True)
class Solution:
    """Base and mechanism in motion."""

    trajectory: Trajectory
    response: Response
    """Rotors included."""
    motion: BaseMotion
    deviation: Deviation
    """Of joints and motors from the command; nothing where all follow it."""


@dataclass(frozen=True)
class BenchDynamics:
    """Base and drives along one command."""

    mechanism: Mechanism
    command: Trajectory
    """Of the mechanism, motor sides too."""
    rotors: Mapping[str, Rotor]
    base: ElasticBase
    carried: Floats
    """What ``base`` contains of the mechanism, locked at its start, (6, 6) [kg, kg m, kg m2]."""
    gravity: Floats
    """As it acts on what the base tilts, (3,) [m/s2]; zero where it is neglected."""
    drives: DriveTrains | None
    coupling: Coupling | None
    """Of the command; None for a mechanism that is locked to its base."""
    contact: Contact | None

    def solved(self, sought: Floats | None = None, tolerance: float = TOLERANCE) -> Solution:
        """The motion, ``sought`` from one as ``_Core.respond`` gives it. Raises RigError if rounds do not converge."""
        time = self.command.time
        resolved = self.resolved(float(time[1] - time[0]))
        if sought is None:
            direct = len(time) <= _COARSE_FROM or resolved < COARSE
            sought = np.zeros((3, len(time), self._core.positions)) if direct else self._sought_coarsely()
        trajectory, largest = self.command, np.ones(self._core.positions)
        if self.drives:
            largest[6:] = self.drives.sizes
        for _ in range(ROUNDS):
            motion, deviation = _parted(sought)
            try:
                trajectory = self.drives.follow(deviation, trajectory, self._closure) if self.drives else trajectory
            except ClosureError as error:
                raise RigError(
                    f"bench.drives, bench.joints, bench.links: what yields takes the mechanism apart ({error}): state "
                    "more stiffness or damping, or less clearance"
                ) from error
            response = shaking(self.mechanism, trajectory, self.rotors)
            push = self._push(response, motion, deviation)
            found = self._core.respond(push, float(time[1] - time[0]), self._stepped, sought[2])
            largest[:6] = max(np.abs(found[2, :, :6]).max(), 1e-12)
            change = float((np.abs(found[2] - sought[2]) / largest).max())
            if change <= tolerance:
                return Solution(trajectory, response, *_parted(found))
            sought = found
        raise RigError(
            f"bench.coupling, bench.drives, bench.joints, bench.links: accelerations still change by {change:.2g} of "
            f"the largest after {ROUNDS} rounds: the base is too light for what moves on it, or a drive, joint or link "
            "too soft; state another mass, stiffness or damping"
        )

    def _push(self, response: Response, motion: BaseMotion, deviation: Deviation) -> Floats:
        """Exact loads less those of the core's inertia, (n, 6 + nf) [N, N m]."""
        wrench = np.hstack([response.force, response.moment])
        push = wrench.copy()
        if np.any(self.gravity):
            push += weight_wrench_change(response.weight_moment)
        if self.coupling is not None:
            push += self.coupling.turned(motion, wrench, self.gravity)
            push -= self.coupling.reaction(motion) - times(self.carried, motion.acceleration)
        if self.drives is None:
            return push
        loads = self.drives.projected(response.torque)
        if self.coupling is not None:
            field = motion.acceleration.copy()
            field[:, :3] += apparent_gravity(self.gravity, motion.displacement)
            loads = loads + base_motion_torque(self._base_loads, field, motion.velocity[:, 3:])
        both = np.hstack([push, self.drives.ripple(deviation) - loads])
        mass = self._core.mass.copy()
        mass[:6, :6] = 0.0
        return both + times(mass, np.hstack([motion.acceleration, deviation.acceleration]))

    @cached_property
    def _base_loads(self) -> tuple[Floats, Floats]:
        assert self.drives is not None
        rates = self.command.per_drive @ self.drives.free
        return base_motion_loads(self.mechanism, self.command, self.rotors, rates)

    @cached_property
    def _stepped(self) -> "Stepped | None":
        """What is stepped, with the inertia along the command less the constant one: the same each round."""
        if not (self._core.contact is not None or bool(self._core._from_step_to_step)):
            return None
        command = every(self.command, _INERTIA_EVERY)
        found = np.zeros((len(command.time), *self._core.mass.shape))
        if self.drives is not None:
            found[:, 6:, 6:] = self.drives.along(command).inertias - self._core.mass[6:, 6:]
        if self.coupling is not None:
            found[:, :6, :6] = self.coupling.inertia[::_INERTIA_EVERY] - self.carried
        if self.coupling is not None and self.drives is not None:
            found[:, 6:, :6] = self._base_loads[0][::_INERTIA_EVERY] - self._core.mass[6:, :6]
            found[:, :6, 6:] = found[:, 6:, :6].transpose(0, 2, 1)
        return self._core.stepped(float(self.command.time[1] - self.command.time[0]), found, _INERTIA_EVERY)

    @cached_property
    def _closure(self) -> Closure:
        return Closure(self.mechanism)

    @cached_property
    def _core(self) -> _Core:
        inertia: tuple[Floats, Floats] = np.zeros((0, 0)), np.zeros((6, 0))
        if self.drives is not None:
            shared = self._base_loads[0][0].T if self.coupling is not None else np.zeros((6, self.drives.free.shape[1]))
            inertia = self.drives.inertia, shared
        return _Core.of(self.base, self.drives, inertia, len(self.command.time), self.contact)

    def resolved(self, step: float) -> float:
        """How many times ``step`` [s] resolves the fastest pin with clearance. Raises RigError for less than once."""
        loose = [(frequency, spring) for frequency, spring in self._core.bounces() if spring.play]
        for frequency, spring in loose:
            if (share := frequency * step) > 1.0:
                raise RigError(
                    f"{spring.name}: with clearance its pin bounces at {frequency / 2.0 / np.pi:.0f} Hz, too fast for "
                    f"steps of {step:.3g} s: state a stiffness of at most "
                    f"{spring.stiffness / share**2 / 1e6:.2g} MN/m, or no clearance"
                )
        return 1.0 / max((frequency * step for frequency, _ in loose), default=1e-9)

    def _sought_coarsely(self) -> Floats:
        from scipy.interpolate import CubicSpline

        found = self._thinned(COARSE).solved(tolerance=_COARSE_TOLERANCE)
        whole = np.concatenate([[*vars(found.motion).values()], [*vars(found.deviation).values()]], axis=2)
        return np.asarray(CubicSpline(found.trajectory.time, whole, axis=1)(self.command.time))

    def _thinned(self, stride: int) -> "BenchDynamics":
        """With every ``stride``-th sample."""
        command = every(self.command, stride)
        drives = None if self.drives is None else self.drives.along(command)
        coupling = None if self.coupling is None else self.coupling.every(stride)
        return replace(self, command=command, drives=drives, coupling=coupling)


def shaking(mechanism: Mechanism, trajectory: Trajectory, rotors: Mapping[str, Rotor]) -> Response:
    """Shaking wrench and torques along a trajectory, with the moment of ``rotors`` by the coordinate they turn with."""
    response = simulate(mechanism, trajectory)
    if not rotors:
        return response
    return replace(response, moment=response.moment - rotor_momentum(mechanism, rotors, trajectory.a))


def _parted(found: Floats) -> tuple[BaseMotion, Deviation]:
    return BaseMotion(*found[:, :, :6]), Deviation(*found[:, :, 6:])
