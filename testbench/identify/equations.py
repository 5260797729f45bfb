"""The matrix W of a record, for any motion of its driven joints: what each parameter brings to each row."""

from collections.abc import Sequence

import numpy as np

from balance.arrays import Floats
from balance.closure import Closure, Trajectory
from balance.dynamics.joint_friction import TERMS, joint_terms
from balance.dynamics.regressor import driven_torque_regressor, wrench_regressor
from balance.mechanism import Mechanism
from balance.motion import Samples

from ..motion.derivatives import Rates
from .record import JointRecord


def names_of(mechanism: Mechanism, rows: Sequence[str]) -> tuple[str, ...]:
    """Parameters that rows can tell of: inertial ones of the bodies, terms of the joints, offsets of forces."""
    terms = [f"{term}[{joint}]" for joint in mechanism.driven if joint in rows for term in TERMS]
    return (*mechanism.parameter_names, *terms, *(f"offset[{row}]" for row in rows if row not in mechanism.driven))


def path_of(record: JointRecord, mechanism: Mechanism, motion: Rates, near: Trajectory | None = None) -> Trajectory:
    """The mechanism closed along any motion of the record's driven joints; quicker from a path ``near`` by."""
    samples = Samples(record.grid.time, motion.q, motion.v, motion.a, joints=mechanism.driven)
    return Closure(mechanism).follow(samples, near=near)


def regressor(record: JointRecord, mechanism: Mechanism, motion: Rates, path: Trajectory) -> Floats:
    """W of a record's rows for any motion of its driven joints, (samples, rows, p): columns as ``names_of`` says."""
    bodies: list[Floats] = []
    own: list[Floats] = []
    if record.torque.shape[1]:
        bodies.append(driven_torque_regressor(mechanism, path.q, path.v, path.a, path.per_drive))
        own.append(joint_terms(mechanism.driven, motion.v, motion.a)[0])
    if record.loads is not None:
        bodies.append(record.loads.seen(wrench_regressor(mechanism, path.q, path.v, path.a)))
        own.append(np.broadcast_to(np.eye(len(record.loads.names)), (len(path.q), *[len(record.loads.names)] * 2)))
    return np.concatenate([np.concatenate(bodies, axis=1), _diagonal(own)], axis=2)


def model_torque(mechanism: Mechanism, motion: Rates, path: Trajectory, parameters: Floats) -> Floats:
    """Torques of the driven joints by parameters in the order of ``names_of``, (samples, joints) [N m, N]."""
    count = len(mechanism.parameter_names)
    bodies = driven_torque_regressor(mechanism, path.q, path.v, path.a, path.per_drive) @ parameters[:count]
    terms = joint_terms(mechanism.driven, motion.v, motion.a)[0]
    return np.asarray(bodies + terms @ parameters[count : count + terms.shape[2]])


def _diagonal(blocks: Sequence[Floats]) -> Floats:
    """Blocks (n, rows, columns) side by side, each for its own rows alone."""
    rows, columns = (sum(block.shape[axis] for block in blocks) for axis in (1, 2))
    whole = np.zeros((len(blocks[0]), rows, columns))
    row = column = 0
    for block in blocks:
        whole[:, row : row + block.shape[1], column : column + block.shape[2]] = block
        row, column = row + block.shape[1], column + block.shape[2]
    return whole
