"""Regressors W: first moment, momentum, shaking wrench, joint torque and potential energy as ``W @ pi``.

All are linear in the inertial parameters of the bodies: columns are the mechanism's ``parameter_names``. States need
not be closed: the projection on loops comes after. Drives have linear parameters of their own: friction, rotor, offset.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ..arrays import Floats
from ..mechanism import forward_kinematics
from ..mechanism.forward_kinematics import Motion, Pose
from ..mechanism.mechanism import PARAMETERS, Mechanism
from ..mechanism.pinocchio_engine import PinocchioEngine, refuse_other_than_pinocchio
from ..mechanism.sparse_components import Entry, dense, sub
from ..mechanism.tape import Program, Tape
from .inverse_dynamics import Parameters, body_force, body_momentum, body_weight

COULOMB_SPEED = 0.05
"""Speed at which dry friction has reached 76 % of its value [rad/s, m/s]: noise about zero has no sign."""
JOINT_TERMS = ("coulomb", "viscous", "offset", "armature")
"""Dry friction [N m], viscous friction [N m s], offset [N m], inertia of the drive [kg m2]; for slides in [N] ..."""


def momentum_regressor(mechanism: Mechanism, q: Floats, v: Floats) -> Floats:
    """W with ``W @ pi`` = linear [kg m/s] and angular momentum about the base frame's origin [kg m2/s], (n, 6, 10 nb).

    ``q`` and ``v`` are (n, nv).
    """
    return _columns(mechanism, "momentum", (q, v), 6, _momentum, PinocchioEngine.momentum_regressor)


def wrench_regressor(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> Floats:
    """W with ``W @ pi`` = shaking force [N] and moment about the base frame's origin [N m], (n, 6, 10 nb).

    What the mechanism exerts on its base, weight excluded, base axes; ``q``, ``v``, ``a`` are (n, nv).
    """
    return _columns(mechanism, "wrench", (q, v, a), 6, _wrench, PinocchioEngine.wrench_regressor)


def torque_regressor(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> Floats:
    """W with ``W @ pi`` = torques of the joints of the open tree, gravity included, (n, nv, 10 nb) [N m, N].

    ``q``, ``v``, ``a`` are (n, nv). Torques of the driven joints of a closed loop are ``driven_rates.T @ W @ pi``.
    Armature and friction are not in it.
    """
    tree, gravity = mechanism.tree, mechanism.gravity.tolist()

    def torques(row: Parameters, at: Pose, moving: Motion, joint: int) -> list[Entry]:
        load = body_force(row, at, moving, joint).minus(body_weight(row, at, gravity, joint))
        path = tree.path(joint)
        return [load.along(at, i, tree.joints[i].revolute) if i in path else 0.0 for i in range(tree.size)]

    return _columns(mechanism, f"torque {gravity}", (q, v, a), tree.size, torques, PinocchioEngine.torque_regressor)


def _momentum(row: Parameters, at: Pose, moving: Motion, joint: int) -> list[Entry]:
    load = body_momentum(row, at, moving, joint)
    return [*load.force, *load.moment]


def _wrench(row: Parameters, at: Pose, moving: Motion, joint: int) -> list[Entry]:
    load = body_force(row, at, moving, joint)
    return [sub(0.0, entry) for entry in (*load.force, *load.moment)]


def _columns(
    mechanism: Mechanism,
    name: str,
    states: tuple[Floats, ...],
    rows: int,
    load_of: Callable[[Parameters, Pose, Motion, int], list[Entry]],
    engine_of: Callable[..., Floats],
) -> Floats:
    """A regressor (n, rows, 10 nb) [SI]: the load of each body for each of its parameters at one, all others zero."""

    def expected(engine: PinocchioEngine, *state: Floats) -> tuple[Floats, Floats]:
        found = engine_of(engine, *state)
        return found, np.abs(found)

    tree, count = mechanism.tree, len(states[0])

    def write() -> Program:
        tape = Tape()
        q, *rates = (tape.rows(tree.size) for _ in states)
        at = forward_kinematics.pose(tree, q)
        moving = forward_kinematics.motion(tree, at, *rates)
        units = [(row, joint) for joint in tree.bodies for row in np.eye(len(PARAMETERS)).tolist()]
        return tape.program([entry for row, joint in units for entry in load_of(row, at, moving, joint)])

    columns = np.empty((len(mechanism.bodies) * len(PARAMETERS) * rows, count))
    key = f"regressor of {name}"
    tree.once(key, write).run([np.ascontiguousarray(x.T) for x in states], [columns])
    found = np.ascontiguousarray(columns.reshape(-1, rows, count).transpose(2, 1, 0))
    refuse_other_than_pinocchio(mechanism, key, key, states, found.__getitem__, expected)
    return found


def driven_torque_regressor(mechanism: Mechanism, q: Floats, v: Floats, a: Floats, rates: Floats) -> Floats:
    """W with ``W @ pi`` = torques of the driven joints, (n, dof, 10 nb) [N m, N].

    ``q``, ``v``, ``a`` are (n, nv), ``rates`` (n, nv, dof) those of all coordinates per rate of the driven joints.
    """
    return np.einsum("nij,nik->njk", rates, torque_regressor(mechanism, q, v, a))


def first_moment_regressor(mechanism: Mechanism, q: Floats) -> Floats:
    """W with ``W @ pi`` = first moment of mass about the base frame's origin [kg m], (n, 3, 10 nb), for (n, nv) states.

    A body at o turned by R has m o + R h: columns o and those of R.
    """
    at = forward_kinematics.pose(mechanism.tree, np.ascontiguousarray(q.T))
    columns = np.zeros((len(q), 3, len(mechanism.bodies), len(PARAMETERS)))
    for body, joint in enumerate(mechanism.tree.bodies):
        columns[:, :, body, 0] = dense(at.position[joint], at.count).T
        for axis in range(3):
            columns[:, :, body, 1 + axis] = dense(at.arm(joint, np.eye(3)[axis]), at.count).T
    return columns.reshape(len(q), 3, -1)


def first_moment(mechanism: Mechanism, q: Floats) -> Floats:
    """First moment of mass about the base frame's origin, (n, 3) [kg m], for (n, nv) states."""
    return first_moment_regressor(mechanism, q) @ mechanism.pi


def potential_regressor(mechanism: Mechanism, q: Floats) -> Floats:
    """W with ``W @ pi`` = potential energy of weight [J], (n, 10 nb), for (n, nv) states: V = -g . first moment."""
    return np.einsum("i,nik->nk", -mechanism.gravity, first_moment_regressor(mechanism, q))


def potential(mechanism: Mechanism, q: Floats) -> Floats:
    """Potential energy of weight, (n,) [J], for (n, nv) states; zero with all mass at the base origin's height."""
    return -first_moment(mechanism, q) @ mechanism.gravity


def joint_friction_regressor(joints: Sequence[str], v: Floats, a: Floats) -> tuple[Floats, tuple[str, ...]]:
    """W (n, joints, 4 joints) of the JOINT_TERMS of each joint, and their names, such as ``coulomb[J1]``.

    tau = ... + coulomb sign(v) + viscous v + offset + armature a, with the joints' rates ``v`` and ``a`` (n, joints)
    [rad/s, m/s; rad/s2, m/s2]. ``W @ terms`` is in [N m, N].
    """
    count, size = v.shape
    columns = np.zeros((count, size, size, len(JOINT_TERMS)))
    diagonal = np.arange(size)
    terms = np.stack([np.tanh(v / COULOMB_SPEED), v, np.ones_like(v), a], axis=2)
    columns[:, diagonal, diagonal] = terms
    names = tuple(f"{term}[{joint}]" for joint in joints for term in JOINT_TERMS)
    return columns.reshape(count, size, -1), names
