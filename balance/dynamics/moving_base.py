"""Rigid bodies on an elastic base: its inertia, natural frequencies and response, and accelerations on the bodies.

Small motions x = (u, phi): translation of the base frame's origin [m], rotation [rad], base axes, from equilibrium.
With the mechanism locked to the base and w its shaking wrench about the same origin:

    (M_base + M_mechanism) x'' + C x' + K x = w
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..arrays import Floats
from ..closure import Trajectory
from ..errors import DataError
from ..input_files import OneForAll, Quantity, Table
from ..mechanism.forward_kinematics import Pose, motions, point_acceleration, pose, poses
from ..mechanism.loop_constraints import Anchor
from ..mechanism.mechanism import Mechanism, inertia_matrix
from ..mechanism.tape import Program, Symbols, Tape

BLOCK = 128
"""Samples a block: about the square root of the samples of a run."""
_ROWS = 1024
"""Rows in one product, so few that BLAS stays on one thread: more threads cost more here than they bring."""

_EACH_AXIS = OneForAll(3)
Length = Annotated[float, Quantity("length")]
Point = tuple[Length, Length, Length]
Mass = Annotated[float, Quantity("mass", above=0.0)]
Inertia = Annotated[float, Quantity("inertia", above=0.0)]
Stiffness = Annotated[float, Quantity("stiffness", above=0.0)]
Damping = Annotated[float, Quantity("damping", above=0.0)]


def skew(vector: Floats) -> Floats:
    """The matrices S (..., 3, 3) with S b = vector x b, in SI as ``vector`` (..., 3)."""
    x, y, z = np.moveaxis(vector, -1, 0)
    zero = np.zeros_like(x)
    return np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), (0, 1), (-2, -1))


def displacement_at(point: Floats) -> Floats:
    """The matrix J (3, 6) [-, m] with J x = u + phi x point, for a ``point`` (3,) [m] of the base."""
    return np.hstack([np.eye(3), -skew(point)])


def rigid_body(mass: float, first: Floats, inertia: Floats) -> Floats:
    """Mass matrix (6, 6) about the origin, from ``first`` moment of mass (3,) [kg m] and ``inertia`` (3, 3) [kg m2]."""
    return np.block([[mass * np.eye(3), -skew(first)], [skew(first), inertia]])


def first_moment(mass: Floats) -> Floats:
    """First moment of mass (..., 3) [kg m] of mass matrices (..., 6, 6)."""
    return np.stack([mass[..., 5, 1], mass[..., 3, 2], mass[..., 4, 0]], axis=-1)


def locked_inertia(mechanism: Mechanism, q: Floats) -> Floats:
    """Mass matrix of the mechanism, locked at ``q`` (nv,), about the base frame's origin, (6, 6) [kg, kg m, kg m2]."""
    return inertia_along(mechanism, q[None])[0]


def inertia_along(mechanism: Mechanism, q: Floats) -> Floats:
    """Mass matrices at configurations (n, nv) about the base frame's origin, (n, 6, 6) [kg, kg m, kg m2].

    The inertia is tr(S) - S, S being the sum of m rho rho' over all particles.
    """
    tree = mechanism.tree

    def write() -> Program:
        tape = Tape()
        at = pose(tree, tape.rows(tree.size))
        bodies = list(zip(tape.parameters(mechanism.parameters), tree.bodies, strict=True))
        first = np.sum([row[0] * at.position[joint] + at.arm(joint, row[1:4]) for row, joint in bodies], axis=0)
        second = np.sum([second_moment_about(row, at, joint) for row, joint in bodies], axis=0)
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = second
        return tape.program([*first, yy + zz, zz + xx, xx + yy, xy, xz, yz])

    program = tree.once(("inertia", (mechanism.parameters != 0.0).tobytes()), write)
    x, y, z, xx, yy, zz, xy, xz, yz = program.values(q.T, parameters=mechanism.pi)
    found = np.zeros((len(q), 6, 6))
    found[:, :3, :3] = mechanism.total_mass * np.eye(3)
    found[:, 3:, :3] = skew(np.stack([x, y, z], axis=1))
    found[:, :3, 3:] = -found[:, 3:, :3]
    found[:, 3:, 3:] = np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]]).transpose(2, 0, 1)
    return found


def second_moment(row: Symbols | Floats) -> NDArray[Any]:
    """The sum of m r r' from a body's parameters (10,) [kg, kg m, kg m2], (3, 3): S = tr(I) / 2 - I [kg m2]."""
    (xx, _, _), (_, yy, _), (_, _, zz) = inertia = inertia_matrix(row)
    return 0.5 * (xx + yy + zz) * np.eye(3) - inertia


def second_moment_about(row: Symbols, at: Pose, joint: int) -> Symbols:
    """The sum of m rho rho' of a body of parameters ``row`` (10,) about the base frame's origin, (3, 3) [kg m2].

    With first moment h about the joint's origin o, base axes, and R S R' about o, S = tr(I) / 2 - I:
    m o o' + o h' + h o' + R S R'.
    """
    origin, own, rotation = at.position[joint], at.arm(joint, row[1:4]), at.rotation[joint]
    moved = row[0] * origin + own
    return np.outer(moved, origin) + np.outer(origin, own) + rotation @ second_moment(row) @ rotation.T


def acceleration_in_body(mechanism: Mechanism, trajectory: Trajectory, base: Floats, sensor: Anchor) -> Floats:
    """Acceleration of a frame on a body, in that frame's axes, (n, 3) [m/s2]: R' (a + u'' + phi'' x p).

    ``base`` (n, 6) are the base's u'', phi'' [m/s2, rad/s2].
    """
    tree, joint, position = mechanism.tree, sensor.joint, sensor.position
    at, moving = poses(tree, trajectory.q), motions(tree, trajectory.q, trajectory.v, trajectory.a)
    relative = point_acceleration(at, moving, joint, position)
    absolute = relative + base[:, :3] + np.cross(base[:, 3:], at.point(joint, position))
    return np.einsum("nji,nj->ni", at.rotation[:, joint] @ sensor.rotation, absolute)


@dataclass(frozen=True)
class BaseMotion:
    """Motion of the base frame, translations first, base axes: (n, ..., 6) each."""

    displacement: Floats
    """[m, rad]"""
    velocity: Floats
    """[m/s, rad/s]"""
    acceleration: Floats
    """[m/s2, rad/s2]"""

    def plus(self, other: "BaseMotion") -> "BaseMotion":
        """This motion and another: the base is linear."""
        return BaseMotion(
            self.displacement + other.displacement,
            self.velocity + other.velocity,
            self.acceleration + other.acceleration,
        )

    def acceleration_at(self, point: Floats) -> Floats:
        """Acceleration of a ``point`` (3,) [m] of the base, base axes, (n, 3) [m/s2]; no centripetal part."""
        return self.acceleration @ displacement_at(point).T


@dataclass(frozen=True)
class ElasticBase:
    """Mass, damping and stiffness about the base frame's origin, (6, 6) each, SI."""

    mass: Floats
    damping: Floats
    stiffness: Floats

    @property
    def frequencies_hz(self) -> Floats:
        """Undamped natural frequencies, rising, (6,) [Hz]."""
        from scipy.linalg import eigh

        return np.sqrt(eigh(self.stiffness, self.mass, eigvals_only=True)) / (2.0 * np.pi)

    def state_space(self) -> tuple[Floats, Floats]:
        """A (12, 12) and B (12, 6), in SI, of y' = A y + B w with y = (x, x')."""
        a, b = np.zeros((12, 12)), np.zeros((12, 6))
        a[:6, 6:] = np.eye(6)
        a[6:, :6], a[6:, 6:] = (-np.linalg.solve(self.mass, matrix) for matrix in (self.stiffness, self.damping))
        b[6:] = np.linalg.inv(self.mass)
        return a, b

    def respond(self, wrench: Floats, step: float) -> BaseMotion:
        """Motion from rest under wrenches (n, ..., 6) [N, N m] every ``step`` [s]; exact where linear between."""
        a, b = self.state_space()
        state = linear_response(a, b, wrench, step)
        return BaseMotion(state[..., :6], state[..., 6:], times(a[6:], state) + times(b[6:], wrench))


def linear_response(a: Floats, b: Floats, driven: Floats, step: float) -> Floats:
    """States (n, ..., k), in SI, of y' = A y + B w from rest, exact where w is linear between samples.

    A (k, k), B (k, m); ``driven`` is w, (n, ..., m), sampled every ``step`` [s].
    y[i+1] = P y[i] + Q0 w[i] + Q1 w[i+1], from the exponential of the system with w and its slope appended.
    """
    phi, now, after = propagator(a, b, step)
    state = np.zeros((*driven.shape[:-1], len(a)))
    state[1:] = times(now, driven[:-1]) + times(after, driven[1:])
    return _accumulated(phi, state)


def times(matrix: Floats, vectors: Floats) -> Floats:
    """``matrix`` (j, k) times each of ``vectors`` (..., k), in SI: (..., j)."""
    rows = np.ascontiguousarray(vectors).reshape(-1, matrix.shape[1])
    found, across = np.empty((len(rows), len(matrix))), np.ascontiguousarray(matrix.T)
    for begin in range(0, len(rows), _ROWS):
        np.matmul(rows[begin : begin + _ROWS], across, out=found[begin : begin + _ROWS])
    return found.reshape(*vectors.shape[:-1], len(matrix))


def _accumulated(phi: Floats, pushes: Floats) -> Floats:
    """y[i] = P y[i-1] + push[i] for all i: within all blocks at once, then from block to block."""
    size, blocks = phi.shape[0], -(-len(pushes) // BLOCK)
    states = np.zeros((blocks * BLOCK, pushes.size // (len(pushes) * size), size))
    states[: len(pushes)] = pushes.reshape(len(pushes), -1, size)
    states = states.reshape(blocks, BLOCK, -1, size)
    powers = [phi]
    for i in range(1, BLOCK):
        states[:, i] += times(phi, states[:, i - 1])
        powers.append(powers[-1] @ phi)
    carried = states[:, -1].copy()
    for k in range(1, blocks):
        carried[k] += carried[k - 1] @ powers[-1].T
    for i, power in enumerate(powers):
        states[1:, i] += times(power, carried[:-1])
    return states.reshape(-1, *pushes.shape[1:])[: len(pushes)]


def propagator(a: Floats, b: Floats, step: float) -> tuple[Floats, Floats, Floats]:
    """P (k, k), Q0 and Q1 (k, m), in SI, with y[i+1] = P y[i] + Q0 w[i] + Q1 w[i+1], as in ``linear_response``."""
    return _propagator(a.tobytes(), b.tobytes(), len(a), step)


@lru_cache(maxsize=64)
def _propagator(a_bytes: bytes, b_bytes: bytes, size: int, step: float) -> tuple[Floats, Floats, Floats]:
    """P, Q0 and Q1 of A (size, size) and B (size, m), given as bytes so that repeated systems are cached."""
    from scipy.linalg import expm

    a, b = np.frombuffer(a_bytes).reshape(size, size), np.frombuffer(b_bytes).reshape(size, -1)
    inputs = b.shape[1]
    system = np.zeros((size + 2 * inputs,) * 2)
    system[:size, :size], system[:size, size : size + inputs] = a * step, b * step
    system[size : size + inputs, size + inputs :] = np.eye(inputs)
    full = expm(system)
    slope = np.ascontiguousarray(full[:size, size + inputs :])
    return np.ascontiguousarray(full[:size, :size]), full[:size, size : size + inputs] - slope, slope


def gravity_in_tilted_axes(gravity: Floats, rotation_vector: Floats) -> Floats:
    """Gravity (3,) [m/s2] in the axes of a base at rest, turned by a rotation vector (3,) [rad]: R' g, (3,) [m/s2]."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(rotation_vector).as_matrix().T @ gravity)


def apparent_gravity(gravity: Floats, displacement: Floats) -> Floats:
    """What accelerometers show of gravity (3,) [m/s2] on a base displaced by (u, phi), (..., 6) [m, rad].

    R' (-g) + g = phi x g, (..., 3) [m/s2].
    """
    return np.cross(displacement[..., 3:], gravity)


class Mount(Table):
    """A spring and a damper along each axis of the base, at a point of it."""

    position: Point
    """Point of the base in its own frame [m]."""
    stiffness: Annotated[tuple[Stiffness, Stiffness, Stiffness], _EACH_AXIS]
    """Along each axis of the base [N/m]."""
    damping: Annotated[tuple[Damping, Damping, Damping], _EACH_AXIS]
    """Along each axis of the base [N s/m]."""


def _feet() -> tuple[Mount, ...]:
    """Rubber feet under the corners of a frame 0.8 m wide and 0.5 m deep, stiffer upright (y) than sideways."""
    return tuple(
        Mount.model_validate(
            {
                "position": (f"{x} m", "-0.5 m", f"{z} m"),
                "stiffness": ("250 kN/m", "400 kN/m", "250 kN/m"),
                "damping": ("400 N s/m", "600 N s/m", "400 N s/m"),
            }
        )
        for x in (-0.4, 0.4)
        for z in (-0.4, 0.1)
    )


class MountedBase(Table):
    """The base as a rigid body on mounts, without the mechanism; the defaults are a steel frame on four feet."""

    mass: Mass = 150.0
    """Mass of the base [kg]."""
    centre: Point = (0.03, -0.2, -0.12)
    """Centre of mass in the base frame [m]: below and behind the mechanism, its cabinet to one side."""
    inertia: Annotated[tuple[Inertia, Inertia, Inertia], _EACH_AXIS] = (13.0, 11.0, 18.0)
    """Inertia about the centre of mass, principal axes along the base frame's [kg m2]: a box of 0.8 x 0.9 x 0.5 m."""
    mounts: tuple[Mount, ...] = Field(default_factory=_feet, min_length=1)
    """What the base stands on."""

    def elastic(self, carried: Floats | None = None, gravity: Floats | None = None) -> ElasticBase:
        """With the inertia ``carried`` (6, 6) [kg, kg m, kg m2] of what it carries, turning in ``gravity`` (3,) [m/s2].

        Raises DataError if the mounts do not fix it in all six degrees of freedom.
        """
        centre = np.array(self.centre)
        inertia = np.diag(self.inertia) - self.mass * skew(centre) @ skew(centre)
        mass = rigid_body(self.mass, self.mass * centre, inertia)
        stiffness, damping = np.zeros((2, 6, 6))
        for mount in self.mounts:
            at = displacement_at(np.array(mount.position))
            stiffness += at.T @ np.diag(mount.stiffness) @ at
            damping += at.T @ np.diag(mount.damping) @ at
        if np.linalg.cond(stiffness) > 1e12:
            raise DataError(
                f"bench.mounts: {len(self.mounts)} mounts do not fix the base in all six degrees of freedom: "
                "expected at least three that are not in line"
            )
        mass = mass if carried is None else mass + carried
        return ElasticBase(mass, damping, stiffness if gravity is None else self._in_gravity(stiffness, mass, gravity))

    def _in_gravity(self, elastic: Floats, mass: Floats, gravity: Floats) -> Floats:
        """Stiffness with the geometric one of weight and mount preload.

        A force f at p of the base, constant in space, has the moment (p + phi x p) x f about the base's origin, so it
        adds -S(f) S(p); here the weight at the centre of mass, and what each mount carries of it at rest.
        """
        first, stiffness = first_moment(mass), elastic.copy()
        sag = np.linalg.solve(elastic, np.concatenate([mass[0, 0] * gravity, np.cross(first, gravity)]))
        stiffness[3:, 3:] -= skew(gravity) @ skew(first)
        for mount in self.mounts:
            at = np.array(mount.position)
            stiffness[3:, 3:] += skew(np.array(mount.stiffness) * (displacement_at(at) @ sag)) @ skew(at)
        return stiffness
