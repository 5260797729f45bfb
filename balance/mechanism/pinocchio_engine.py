"""Pinocchio on a mechanism, a state at a time: loop constraints, and momentum, wrench and torque regressors.

The engine of whatever needs tens of states. Many samples at once go through ``forward_kinematics`` and what stands on
it, which are compared with this one.
"""

import numpy as np
import pinocchio

from ..arrays import Floats
from .loop_constraints import Anchor, Coupling, Loop
from .mechanism import PARAMETERS, Mechanism


class PinocchioEngine:
    """A mechanism's Pinocchio model with its loop constraints, and the data in which a state is computed.

    Configurations and rates are those of the mechanism: one coordinate an elementary joint, (nv,) [rad, m]. The six
    rows of a momentum or wrench are linear first, then angular, about the base frame's origin and in its axes.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.model = mechanism.pinocchio_model()
        self.data = self.model.createData()
        self._columns = len(PARAMETERS) * len(mechanism.bodies)
        self._constraints = pinocchio.StdVec_RigidConstraintModel()
        self._constraint_data = pinocchio.StdVec_RigidConstraintData()
        self._couplings = [loop for loop in mechanism.loops if isinstance(loop, Coupling)]
        for loop in mechanism.closed_loops:
            constraint = _constraint_model(self.model, mechanism, loop)
            self._constraints.append(constraint)
            self._constraint_data.append(constraint.createData())

    def constraint_residual(self, q: Floats) -> Floats:
        """First anchor less the second of all loops: origins [m], of a weld also the rotation vector [rad], (rows,).

        Those of couplings come last [rad, m], as in ``mechanism.loops``.
        """
        self._place_loops(q)
        parts = [np.empty(0)]
        for loop, data in zip(self._constraints, self._constraint_data, strict=True):
            first, second = data.oMc1, data.oMc2
            parts.append(first.translation - second.translation)
            if loop.type == pinocchio.ContactType.CONTACT_6D:
                parts.append(pinocchio.log3(first.rotation @ second.rotation.T))
        return np.concatenate([*parts, [coupling.gap(q) for coupling in self._couplings]])

    def constraint_jacobian(self, q: Floats) -> Floats:
        """Rates of the residuals per joint rate, base axes, (rows, nv) [-, m]."""
        couplings = np.array([coupling.row(q) for coupling in self._couplings]).reshape(-1, self.model.nv)
        if not len(self._constraints):
            return couplings
        self._place_loops(q)
        loops = pinocchio.getConstraintsJacobian(self.model, self.data, self._constraints, self._constraint_data)
        return np.concatenate([loops, couplings])

    def momentum_regressor(self, q: Floats, v: Floats) -> Floats:
        """W with ``W @ pi`` = linear [kg m/s] and angular momentum [kg m2/s], (6, 10 nb)."""
        pinocchio.forwardKinematics(self.model, self.data, q, v)
        still = pinocchio.Motion.Zero()
        return self._in_base([pinocchio.bodyRegressor(still, rate) for rate in self.data.v])

    def wrench_regressor(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """W with ``W @ pi`` = shaking force [N] and moment [N m] on the base, weight excluded, (6, 10 nb)."""
        pinocchio.forwardKinematics(self.model, self.data, q, v, a)
        return -self._in_base(list(map(pinocchio.bodyRegressor, self.data.v, self.data.a)))

    def torque_regressor(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """W with ``W @ pi`` = torques of the joints of the open tree, gravity included, (nv, 10 nb) [N m, N]."""
        found = pinocchio.computeJointTorqueRegressor(self.model, self.data, q, v, a)
        return np.array(found).reshape(self.model.nv, self._columns)

    def _place_loops(self, q: Floats) -> None:
        pinocchio.computeJointJacobians(self.model, self.data, q)
        for loop, data in zip(self._constraints, self._constraint_data, strict=True):
            loop.calc(self.model, self.data, data)

    def _in_base(self, by_joint: list[Floats]) -> Floats:
        """Regressors (6, 10) of the bodies in their own frames, that of the base first, as one in the base frame."""
        moved = [place.toDualActionMatrix() @ own for place, own in zip(self.data.oMi[1:], by_joint[1:], strict=True)]
        return np.concatenate(moved, axis=1)


def _constraint_model(model: pinocchio.Model, mechanism: Mechanism, loop: Loop) -> "pinocchio.RigidConstraintModel":
    kind = pinocchio.ContactType.CONTACT_6D if loop.weld else pinocchio.ContactType.CONTACT_3D
    ends = [value for end in (loop.first, loop.second) for value in _anchor(mechanism, end)]
    return pinocchio.RigidConstraintModel(kind, model, *ends, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)


def _anchor(mechanism: Mechanism, end: Anchor) -> tuple[int, pinocchio.SE3]:
    """Pinocchio's joint that carries an anchor, and its placement there."""
    joint = 0 if end.joint < 0 else mechanism.tree.bodies.index(end.joint) + 1
    return joint, pinocchio.SE3(end.rotation, end.position)
