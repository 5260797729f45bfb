"""Reactions of a motion: force and moment in every joint and loop closure, by Newton and Euler on the bodies beyond it.

Loop closures carry the forces that leave their torque to the motors and none to the other joints. Where closures are
redundant, rigid bodies do not determine all of them: the least-squares ones are taken.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import BLOCK, Floats, root_mean_square
from ..closure import Trajectory
from ..errors import ModelError
from ..mechanism.forward_kinematics import Pose, motion, pose, poses
from ..mechanism.loop_constraints import Loop, constraints_at
from ..mechanism.mechanism import Mechanism
from ..mechanism.tape import Program, Tape, numbers
from .inverse_dynamics import Response, body_force, body_weight

_RANK = 1e-9
"""Singular value of the loops, relative to the largest, below which a direction counts as redundant."""
_OPEN = 1e-6
"""Part of a load on the closures alone that reaches a component, below which that is determined [-, m]."""
COMPONENTS = ("Fx_N", "Fy_N", "Fz_N", "Mx_Nm", "My_Nm", "Mz_Nm")


@dataclass(frozen=True)
class Reactions:
    """Wrenches over a motion, in base axes, weight and the motors' torque included; (n, 6) [N, N m] each."""

    joints: Mapping[str, Floats]
    """By coordinate: of its joint on the bodies beyond it, about the joint's origin."""
    loops: Mapping[str, Floats]
    """By closure: on the body of its first end, about that end; a connect carries no moment."""
    couplings: Mapping[str, Floats]
    """By coupling: torque or force on its first coordinate, (n,) [N m, N]."""
    redundant: int
    """Constraint rows beyond those that are independent."""
    undetermined: tuple[str, ...]
    """Names of ``columns`` that they leave open: rigid bodies do not determine these, least squares are given."""

    def columns(self) -> dict[str, Floats]:
        """Components (n,) [N, N m] by name, such as ``reaction_A0_Fx_N``."""
        wrenches = self.joints | self.loops  # type: ignore[operator]
        parts = {
            f"reaction_{name}_{component}": values
            for name, wrench in wrenches.items()
            for component, values in zip(COMPONENTS, wrench.T, strict=True)
        }
        return parts | {f"reaction_{name}": values for name, values in self.couplings.items()}

    def summary(self) -> dict[str, dict[str, dict[str, float]]]:
        """Root mean square and peak of the size of each force and moment, and of components [N, N m], by joint."""
        found = {}
        for name, wrench in {**self.joints, **self.loops}.items():
            sizes = np.linalg.norm(wrench.reshape(-1, 2, 3), axis=2).T
            of_each = map(_rms_and_peak, (*sizes, *wrench.T))
            found[name] = dict(zip(("force_N", "moment_Nm", *COMPONENTS), of_each, strict=True))
        return found | {name: {"along_coordinate": _rms_and_peak(x)} for name, x in self.couplings.items()}


def _rms_and_peak(values: Floats) -> dict[str, float]:
    return {"rms": root_mean_square(values), "peak": float(np.abs(values).max())}


def find_reactions(mechanism: Mechanism, trajectory: Trajectory, response: Response) -> Reactions:
    """Reactions along a trajectory with the motor torques of its ``response``.

    Raises ModelError where the file names no motors that drive the loops.
    """
    if mechanism.loops and not response.torque:
        raise ModelError(
            f"{mechanism.name}: reactions depend on which joints have motors, and the file names none: add "
            "<actuator><motor joint='...'/></actuator>"
        )
    blocks = [
        _reactions_of_block(mechanism, trajectory, response, slice(start, start + BLOCK))
        for start in range(0, len(trajectory.time), BLOCK)
    ]
    joints, closures, redundant, opens = zip(*blocks, strict=True)
    found = _named(mechanism, np.concatenate(joints), np.concatenate(closures), max(redundant))
    wrenches, forces = (np.concatenate(one) for one in zip(*opens, strict=True))
    left_open = _named(mechanism, wrenches, forces, 0).columns()
    undetermined = [name for name, shares in left_open.items() if np.abs(shares).max(initial=0.0) > _OPEN]
    return replace(found, undetermined=tuple(undetermined))


def _named(mechanism: Mechanism, wrenches: Floats, forces: Floats, redundant: int) -> Reactions:
    """Wrenches of the joints (n, nv, 6) and forces of the constraint rows (n, rows), by name."""
    loops: dict[str, Floats] = {}
    couplings: dict[str, Floats] = {}
    row = 0
    for loop in mechanism.loops:
        own = forces[:, row : row + loop.size]
        name = loop.name if loop.name not in mechanism.coordinates else f"loop {loop.name}"
        if isinstance(loop, Loop):
            loops[name] = np.pad(own, ((0, 0), (0, 6 - loop.size)))
        else:
            couplings[name] = own[:, 0]
        row += loop.size
    by_joint = dict(zip(mechanism.coordinates, wrenches.transpose(1, 0, 2), strict=True))
    return Reactions(by_joint, loops, couplings, redundant, ())


def _reactions_of_block(
    mechanism: Mechanism, trajectory: Trajectory, response: Response, part: slice
) -> tuple[Floats, Floats, int, tuple[Floats, Floats]]:
    """Wrenches of the joints (n, nv, 6), forces of the constraint rows (n, rows), how many rows are redundant.

    Last, wrenches and forces of the same shapes, but of two of the samples, that are in equilibrium by themselves.
    """
    tree, q, v, a = mechanism.tree, trajectory.q[part], trajectory.v[part], trajectory.a[part]
    at, count = poses(tree, q), len(q)
    loads = _about_joints(at, _summed(mechanism, body_loads(mechanism, q, v, a)))
    about = np.where([joint.revolute for joint in tree.joints], 3, 0)[:, None] + np.arange(3)
    along = np.take_along_axis(loads, about[None], axis=2)
    needed = (at.axis[:, :-1] * along).sum(axis=2)
    needed += mechanism.armature * a + mechanism.viscous * v + mechanism.coulomb * np.sign(v)
    for name, torque in response.torque.items():
        needed[:, mechanism.coordinate_index(name)] -= torque[part]
    rows = constraints_at(tree, mechanism.loops, q)[1]
    forces = np.empty((count, 0))
    redundant, picked, open_forces = 0, [0, count // 2], np.empty((2, 0))
    if size_of := rows.shape[1]:
        u, size, vt = np.linalg.svd(rows.transpose(0, 2, 1), full_matrices=False)
        kept = size > _RANK * size[:, :1]
        shares = np.where(kept, np.einsum("nji,nj->ni", u, needed) / np.where(kept, size, 1.0), 0.0)
        forces = np.einsum("nij,ni->nj", vt, shares)
        redundant = size_of - int(kept.sum(axis=1).max())
        ways = [vt[k, kept[k]] for k in picked]
        open_forces = np.concatenate([np.eye(size_of) - one.T @ one for one in ways])
    open_at = poses(tree, np.repeat(q[picked], max(size_of, 1), axis=0))
    open_wrenches = _about_joints(open_at, _summed(mechanism, _by_loops(mechanism, open_at, open_forces)))
    carried = _about_joints(at, _summed(mechanism, _by_loops(mechanism, at, forces)))
    return loads - carried, forces, redundant, (open_wrenches, open_forces)


def body_loads(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> Floats:
    """Force and moment about the base's origin that move and carry each body, by its joint, (n, nv, 6) [N, N m].

    ``q``, ``v``, ``a`` are (n, nv).
    """
    tree = mechanism.tree

    def write() -> Program:
        tape = Tape()
        at = pose(tree, tape.rows(tree.size))
        moving = motion(tree, at, tape.rows(tree.size), tape.rows(tree.size))
        gravity = tape.parameters(mechanism.gravity)
        loads = numbers(np.zeros((tree.size, 6)))
        for row, joint in zip(tape.parameters(mechanism.parameters), tree.bodies, strict=True):
            loads[joint] = body_force(row, at, moving, joint) - body_weight(row, at, gravity, joint)
        return tape.program(loads.ravel())

    parameters = np.concatenate([mechanism.gravity, mechanism.pi])
    program = tree.once(("body loads", (parameters != 0.0).tobytes()), write)
    return program.values(q.T, v.T, a.T, parameters=parameters).T.reshape(len(q), tree.size, 6)


def _summed(mechanism: Mechanism, loads: Floats) -> Floats:
    """Of each joint, the loads (n, nv, 6) of all that it carries."""
    total = loads.copy()
    for i, joint in reversed(list(enumerate(mechanism.tree.joints))):
        if joint.parent >= 0:
            total[:, joint.parent] += total[:, i]
    return total


def _by_loops(mechanism: Mechanism, at: Pose, forces: Floats) -> Floats:
    """What the closures exert on the bodies, about the base's origin: a force at one end, its opposite at the other."""
    loads, row = np.zeros((len(at.q), mechanism.tree.size, 6)), 0
    for loop in mechanism.loops:
        own, row = forces[:, row : row + loop.size], row + loop.size
        if isinstance(loop, Loop):
            force, moment = own[:, :3], own[:, 3:] if loop.weld else 0.0
            for end, sign in ((loop.first, 1.0), (loop.second, -1.0)):
                if end.joint >= 0:
                    about = np.cross(at.point(end.joint, end.position), force) + moment
                    loads[:, end.joint] += sign * np.hstack([force, about])
    return loads


def _about_joints(at: Pose, loads: Floats) -> Floats:
    """Loads (n, nv, 6) [N, N m], each about its joint's origin in place of the base's."""
    force, moment = loads[..., :3], loads[..., 3:]
    return np.concatenate([force, moment - np.cross(at.position[:, :-1], force)], axis=2) + 0.0  # no zero has a sign
