"""Reactions of a motion: force and moment in every joint and loop closure, by Newton and Euler on the bodies beyond it.

Loop closures carry the forces that leave their torque to the motors and none to the other joints. Where closures are
redundant, rigid bodies do not determine all of them: the least-squares ones are taken.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import BLOCK, Floats
from ..closure import Trajectory
from ..errors import ModelError
from ..mechanism import forward_kinematics, loop_constraints
from ..mechanism.forward_kinematics import Pose
from ..mechanism.loop_constraints import Loop
from ..mechanism.mechanism import Mechanism
from ..mechanism.sparse_components import ZERO, cross, dense, dense_columns, dense_rows, plus
from .inverse_dynamics import Response, SpatialForce, body_force, body_weight

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
    return {"rms": float(np.sqrt(np.mean(values**2))), "peak": float(np.abs(values).max())}


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
    tree = mechanism.tree
    q, v, a = (np.ascontiguousarray(x[part].T) for x in (trajectory.q, trajectory.v, trajectory.a))
    at = forward_kinematics.pose(tree, q)
    moving = forward_kinematics.motion(tree, at, v, a)
    loads = [SpatialForce()] * tree.size
    for row, joint in zip(mechanism.parameters.tolist(), tree.bodies, strict=True):
        weight = body_weight(row, at, mechanism.gravity.tolist(), joint)
        loads[joint] = body_force(row, at, moving, joint).minus(weight)
    loads = _summed(mechanism, loads)
    open_tree = [load.along(at, i, tree.joints[i].revolute) for i, load in enumerate(loads)]
    losses = mechanism.armature[:, None] * a + mechanism.viscous[:, None] * v
    needed = dense_columns(open_tree, at.count) + losses + mechanism.coulomb[:, None] * np.sign(v)
    for name, torque in response.torque.items():
        needed[mechanism.coordinate_index(name)] -= torque[part]
    rows = loop_constraints.constraint_jacobian(mechanism.loops, tree, at)
    jacobian = dense_rows(rows, tree.size, at.count).transpose(2, 1, 0)
    forces = np.empty((at.count, 0))
    redundant, picked, open_forces = 0, [0, at.count // 2], np.empty((2, 0))
    if rows:
        u, size, vt = np.linalg.svd(jacobian, full_matrices=False)
        kept = size > _RANK * size[:, :1]
        shares = np.where(kept, np.einsum("nji,jn->ni", u, needed) / np.where(kept, size, 1.0), 0.0)
        forces = np.einsum("nij,ni->nj", vt, shares)
        redundant = len(rows) - int(kept.sum(axis=1).max())
        ways = [vt[k, kept[k]] for k in picked]
        open_forces = np.concatenate([np.eye(len(rows)) - one.T @ one for one in ways])
    poses = forward_kinematics.pose(tree, np.repeat(q[:, picked], max(len(rows), 1), axis=1))
    open_wrenches = _wrenches(poses, _summed(mechanism, _by_loops(mechanism, poses, open_forces)))
    carried = _summed(mechanism, _by_loops(mechanism, at, forces))
    joints = [load.minus(loop) for load, loop in zip(loads, carried, strict=True)]
    return _wrenches(at, joints), forces, redundant, (open_wrenches, open_forces)


def _summed(mechanism: Mechanism, loads: list[SpatialForce]) -> list[SpatialForce]:
    """Of each joint, the loads of all that it carries."""
    total = list(loads)
    for i in reversed(range(len(total))):
        parent = mechanism.tree.joints[i].parent
        if parent >= 0:
            total[parent] = total[parent].plus(total[i])
    return total


def _by_loops(mechanism: Mechanism, at: Pose, forces: Floats) -> list[SpatialForce]:
    """What the closures exert on the bodies, about the base's origin: a force at one end, its opposite at the other."""
    loads, row = [SpatialForce()] * mechanism.tree.size, 0
    for loop in mechanism.loops:
        own, row = forces[:, row : row + loop.size].T, row + loop.size
        if isinstance(loop, Loop):
            force = (own[0], own[1], own[2])
            moment = (own[3], own[4], own[5]) if loop.weld else ZERO
            for end, sign in ((loop.first, 1.0), (loop.second, -1.0)):
                if end.joint >= 0:
                    load = SpatialForce(force, plus(cross(at.point(end.joint, end.position), force), moment))
                    loads[end.joint] = loads[end.joint].plus(load) if sign > 0 else loads[end.joint].minus(load)
    return loads


def _wrenches(at: Pose, loads: list[SpatialForce]) -> Floats:
    """Loads of the joints, each about its joint's origin, (n, nv, 6) [N, N m]."""
    found = np.empty((at.count, len(loads), 6))
    for i, load in enumerate(loads):
        force, moment, origin = (dense(x, at.count).T for x in (load.force, load.moment, at.position[i]))
        found[:, i] = np.hstack([force, moment - np.cross(origin, force)])
    return found
