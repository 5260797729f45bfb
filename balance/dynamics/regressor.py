"""Regressors W: first moment, momentum, shaking wrench, joint torque and potential energy as ``W @ pi``.

All are linear in the inertial parameters of the bodies: columns are the mechanism's ``parameter_names``. States need
not be closed: the projection on loops comes after. Drives have linear parameters of their own: friction, rotor, offset.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ..arrays import Floats
from ..closure import Trajectory
from ..mechanism.forward_kinematics import Motion, Pose, motion, pose, poses
from ..mechanism.mechanism import PARAMETERS, Mechanism
from ..mechanism.pinocchio_engine import PinocchioEngine, refuse_other_than_pinocchio
from ..mechanism.tape import Program, Symbols, Tape, numbers
from .inverse_dynamics import along_axis, body_force, body_momentum, body_weight

Load = Callable[[Floats, Pose, Motion, int], Symbols]
"""Of a body of parameters (10,), on a joint: its entries, (rows,) in SI."""

COULOMB_SPEED = 0.005
"""Speed at which dry friction has reached 76 % of its value [rad/s, m/s]: as good as its sign."""
ROUNDING = 1e-9
"""Share of the largest part of a sum up to which the sum is rounding [-]."""
ROOT = 9
"""Numbers in the motion of a base: rate of turning, acceleration of its origin, angular acceleration."""
JOINT_TERMS = ("coulomb", "viscous", "offset", "armature")
"""Dry friction [N m], viscous friction [N m s], offset [N m], inertia of the drive [kg m2]; for slides in [N] ..."""
FRICTION_LAWS: dict[str, tuple[float, ...]] = {
    "low_speed": (0.017, 0.025, 0.035, 0.05, 0.07, 0.1, 0.17, 0.3),
    "hysteresis": (0.0015, 0.005, 0.015, 0.05),
    "quadratic": (),
    "directional": (),
}
"""Friction beyond Coulomb + viscous, and the parts of a joint's top speed, or of its travel, over which it fades."""


def momentum_regressor(mechanism: Mechanism, q: Floats, v: Floats) -> Floats:
    """W with ``W @ pi`` = linear [kg m/s] and angular momentum about the base frame's origin [kg m2/s], (n, 6, 10 nb).

    ``q`` and ``v`` are (n, nv).
    """
    program = regressor_program(mechanism, "momentum", body_momentum, 2)
    return _checked(mechanism, program, "momentum", (q, v), PinocchioEngine.momentum_regressor)


def wrench_regressor(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> Floats:
    """W with ``W @ pi`` = shaking force [N] and moment about the base frame's origin [N m], (n, 6, 10 nb).

    What the mechanism exerts on its base, weight excluded, base axes; ``q``, ``v``, ``a`` are (n, nv).
    """
    program = regressor_program(mechanism, "wrench", lambda *body: 0.0 - body_force(*body), 3)
    return _checked(mechanism, program, "wrench", (q, v, a), PinocchioEngine.wrench_regressor)


def rounding_of_force(mechanism: Mechanism, trajectory: Trajectory) -> float:
    """Shaking force that is rounding [N]: a share of the largest that a body's mass or first moment alone puts into it,
    at some instants.
    """
    some = slice(None, None, max(len(trajectory.time) // 100, 1))
    regressor = wrench_regressor(mechanism, trajectory.q[some], trajectory.v[some], trajectory.a[some])
    return ROUNDING * float(abs(regressor[:, :3] * mechanism.pi).max(initial=0.0))


def torque_regressor(mechanism: Mechanism, q: Floats, v: Floats, a: Floats, root: Floats | None = None) -> Floats:
    """W with ``W @ pi`` = torques of the joints of the open tree, gravity included, (n, nv, 10 nb) [N m, N].

    ``q``, ``v``, ``a`` are (n, nv). Torques of the driven joints of a closed loop are ``driven_rates.T @ W @ pi``.
    Armature and friction are not in it. ``root`` (n, 9) is the motion of the base in its own axes: rate of turning,
    acceleration of its origin, angular acceleration [rad/s, m/s2, rad/s2], the weight being that of the base at rest:
    an accelerometer's acceleration holds what the weight makes of its tilt. None: it rests.
    """
    tree, gravity = mechanism.tree, mechanism.gravity

    def torques(row: Floats, at: Pose, moving: Motion, joint: int) -> Symbols:
        load = body_force(row, at, moving, joint) - body_weight(row, at, gravity, joint)
        found = numbers(np.zeros(tree.size))
        for i in tree.path(joint):
            found[i] = along_axis(load, at, tree, i)
        return found

    moved = [] if root is None else [root]
    name = f"torque {gravity.tolist()}{' on a moving base' * len(moved)}"
    program = regressor_program(mechanism, name, torques, 3, len(moved))
    return _checked(mechanism, program, name, (q, v, a, *moved), PinocchioEngine.torque_regressor)


def regressor_program(mechanism: Mechanism, name: str, load_of: Load, states: int, roots: int = 0) -> Program:
    """From q and rates, so many ``states``, to the load of each body for each of its parameters at one, others zero.

    With one of ``roots`` the motion of the base is the last state.
    """
    tree = mechanism.tree

    def write() -> Program:
        tape = Tape()
        sizes = [tree.size] * states + [ROOT] * roots
        q, *rates = map(tape.rows, sizes)
        at = pose(tree, q)
        moving = motion(tree, at, *rates)
        units = [(row, joint) for joint in tree.bodies for row in numbers(np.eye(len(PARAMETERS)))]
        return tape.program(np.concatenate([load_of(row, at, moving, joint) for row, joint in units]))

    return tree.once(f"regressor of {name}", write)


def _checked(
    mechanism: Mechanism, program: Program, name: str, states: tuple[Floats, ...], engine_of: Callable[..., Floats]
) -> Floats:
    """A regressor (n, rows, 10 nb) [SI] by its program, some states compared with Pinocchio's."""

    def expected(engine: PinocchioEngine, *state: Floats) -> tuple[Floats, Floats]:
        found = engine_of(engine, *state)
        return found, np.abs(found)

    columns = program.values(*(np.ascontiguousarray(x.T) for x in states))
    by_column = columns.reshape(len(mechanism.pi), -1, len(states[0]))
    found = np.ascontiguousarray(by_column.transpose(2, 1, 0))
    what = f"regressor of {name}"
    refuse_other_than_pinocchio(mechanism, what, what, states, found.__getitem__, expected)
    return found


def driven_torque_regressor(
    mechanism: Mechanism, q: Floats, v: Floats, a: Floats, rates: Floats, root: Floats | None = None
) -> Floats:
    """W with ``W @ pi`` = torques of the driven joints, (n, dof, 10 nb) [N m, N].

    ``q``, ``v``, ``a`` are (n, nv), ``rates`` (n, nv, dof) those of all coordinates per rate of the driven joints,
    ``root`` as of ``torque_regressor``.
    """
    return np.einsum("nij,nik->njk", rates, torque_regressor(mechanism, q, v, a, root))


def first_moment_regressor(mechanism: Mechanism, q: Floats) -> Floats:
    """W with ``W @ pi`` = first moment of mass about the base frame's origin [kg m], (n, 3, 10 nb), for (n, nv) states.

    A body at o turned by R has m o + R h: columns o and those of R.
    """
    at, joints = poses(mechanism.tree, q), list(mechanism.tree.bodies)
    columns = np.zeros((len(q), 3, len(joints), len(PARAMETERS)))
    columns[..., 0] = at.position[:, joints].transpose(0, 2, 1)
    columns[..., 1:4] = at.rotation[:, joints].transpose(0, 2, 1, 3)
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


def joint_friction_regressor(
    joints: Sequence[str], v: Floats, a: Floats, turns: Floats | float = COULOMB_SPEED
) -> tuple[Floats, tuple[str, ...]]:
    """W (n, joints, 4 joints) of the JOINT_TERMS of each joint, and their names, such as ``coulomb[J1]``.

    tau = ... + coulomb sign(v) + viscous v + offset + armature a, with the joints' rates ``v`` and ``a`` (n, joints)
    [rad/s, m/s; rad/s2, m/s2]. ``W @ terms`` is in [N m, N]. Dry friction turns over the speeds ``turns`` (joints,).
    """
    count, size = v.shape
    columns = np.zeros((count, size, size, len(JOINT_TERMS)))
    diagonal = np.arange(size)
    terms = np.stack([np.tanh(v / turns), v, np.ones_like(v), a], axis=2)
    columns[:, diagonal, diagonal] = terms
    names = tuple(f"{term}[{joint}]" for joint in joints for term in JOINT_TERMS)
    return columns.reshape(count, size, -1), names


def friction_law(law: str, size: float, v: Floats, step: float, turns: float = COULOMB_SPEED) -> Floats:
    """What one of the FRICTION_LAWS makes at one N m of it, (n,), of a joint's speed ``v`` (n,) every ``step`` [s].

    ``low_speed``: sign(v) exp(-(v / size)^2); ``hysteresis``: what dry friction lacks until the joint has gone some
    ``size`` after it turned (Dahl); ``quadratic``: v |v|, ``directional``: |v| [N m s2, N m s]. The sign
    turns over the speed ``turns`` [rad/s, m/s].
    """
    sign, speed = np.tanh(v / turns), np.abs(v)
    if law == "low_speed":
        return np.asarray(sign * np.exp(-((v / size) ** 2)))
    if law == "hysteresis":
        lacks, fades = sign.copy(), np.exp(-speed * step / size)
        for i in range(1, len(v)):
            lacks[i] = (sign[i] - sign[i - 1] + lacks[i - 1]) * fades[i]
        return lacks
    return np.asarray(v * speed if law == "quadratic" else speed)
