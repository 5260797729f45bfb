"""Springs of zero free length: force in proportion to length, energy k |a - b|^2 / 2, linear in the stiffness."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..mechanism import forward_kinematics
from ..mechanism.forward_kinematics import Pose
from ..mechanism.mechanism import Mechanism
from ..mechanism.sparse_components import dense, dense_rows, zeros


@dataclass(frozen=True)
class End:
    """An end of a spring, fixed in a body or in the base."""

    body: int
    """Index of the body, -1 for the base."""
    position: Floats
    """In the body's frame, (3,) [m]."""

    def joint(self, mechanism: Mechanism) -> int:
        """Elementary joint whose frame it is fixed in, -1 for the base."""
        return -1 if self.body < 0 else mechanism.tree.bodies[self.body]

    def at(self, mechanism: Mechanism, at: Pose) -> Floats:
        """Place in the base frame, (3, n) [m]."""
        return dense(at.point(self.joint(mechanism), self.position), at.count)

    def text(self, mechanism: Mechanism) -> str:
        """The place for people, in the body's frame."""
        where = "base" if self.body < 0 else mechanism.bodies[self.body]
        x, y, z = self.position + 0.0  # -0 is 0
        return f"{where} ({x:.4g}, {y:.4g}{'' if z == 0 else f', {z:.4g}'})"


@dataclass(frozen=True)
class Spring:
    """A spring of zero free length between two ends."""

    first: End
    second: End
    stiffness: float = 1.0
    """[N/m]"""
    name: str = ""


def spring_lengths(mechanism: Mechanism, springs: Sequence[Spring], q: Floats) -> Floats:
    """Lengths at (n, nv) states, (n, springs) [m]."""
    return np.sqrt(2.0 * unit_energies(mechanism, springs, q))


def unit_energies(mechanism: Mechanism, springs: Sequence[Spring], q: Floats) -> Floats:
    """Energies per stiffness, |a - b|^2 / 2, at (n, nv) states, (n, springs) [m2]."""
    at = forward_kinematics.pose(mechanism.tree, np.ascontiguousarray(q.T))
    gaps = [spring.first.at(mechanism, at) - spring.second.at(mechanism, at) for spring in springs]
    return np.array([0.5 * (gap**2).sum(axis=0) for gap in gaps]).reshape(len(springs), len(q)).T


def spring_energy(mechanism: Mechanism, springs: Sequence[Spring], q: Floats) -> Floats:
    """Energy of all springs at (n, nv) states, (n,) [J]."""
    return unit_energies(mechanism, springs, q) @ np.array([spring.stiffness for spring in springs])


def joint_torques(mechanism: Mechanism, springs: Sequence[Spring], q: Floats) -> Floats:
    """Torque that motors of the open tree's joints need against the springs, (n, nv) [N m, N]: dV/dq."""
    at = forward_kinematics.pose(mechanism.tree, np.ascontiguousarray(q.T))
    total = np.zeros((len(q), mechanism.tree.size))
    for spring in springs:
        rows = zeros(3, mechanism.tree.size)
        for end, sign in ((spring.first, 1.0), (spring.second, -1.0)):
            joint = end.joint(mechanism)
            forward_kinematics.add_point_jacobian(mechanism.tree, at, joint, at.point(joint, end.position), rows, sign)
        gap = spring.first.at(mechanism, at) - spring.second.at(mechanism, at)
        total += spring.stiffness * np.einsum("in,ijn->nj", gap, dense_rows(rows, mechanism.tree.size, at.count))
    return total
