"""Pinocchio on a mechanism, a state at a time: loop constraints, and momentum, wrench and torque regressors.

The engine of whatever needs tens of states. Many samples at once go through ``forward_kinematics`` and what stands on
it, which are compared with this one.
"""

from collections.abc import Callable, Hashable
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..errors import ModelError
from .loop_constraints import Anchor, Coupling, Loop
from .mechanism import Mechanism

if TYPE_CHECKING:
    import pinocchio

AGREEMENT = 1e-10
"""Largest difference from Pinocchio, relative to the sum of the sizes of what is added up."""
_COMPARED_STATES = 3


class PinocchioEngine:
    """A mechanism's Pinocchio model with its loop constraints, and the data in which a state is computed.

    Configurations and rates are those of the mechanism: one coordinate an elementary joint, (nv,) [rad, m]. The six
    rows of a momentum or wrench are linear first, then angular, about the base frame's origin and in its axes.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        try:
            import pinocchio  # late: closed forms do without it
        except ImportError as missing:
            raise ModelError(
                "evaluating a mechanism needs Pinocchio: install 'pin' with pip (Linux, macOS) or 'pinocchio' from "
                "conda-forge; without it, balance size parallelogram-6bar --closed-form works"
            ) from missing
        self._pin = pinocchio
        self.model = mechanism.pinocchio_model()
        self.data = self.model.createData()
        self.turning = np.array([joint.revolute for joint in mechanism.tree.joints])
        """Whether a coordinate is an angle, (nv,)."""
        self._bodies = mechanism.tree.bodies
        self._constraints = self._pin.StdVec_RigidConstraintModel()
        self._constraint_data = self._pin.StdVec_RigidConstraintData()
        self._couplings = [loop for loop in mechanism.loops if isinstance(loop, Coupling)]
        for loop in mechanism.closed_loops:
            constraint = self._constraint_model(mechanism, loop)
            self._constraints.append(constraint)
            self._constraint_data.append(constraint.createData())
        self._each = [(*each, loop.weld) for *each, loop in zip(
            self._constraints, self._constraint_data, mechanism.closed_loops, strict=True
        )]  # fmt: skip
        """The elements of both, which are slow to come by, and whether each is a weld."""

    def constraint_residual(self, q: Floats) -> Floats:
        """First anchor less the second of all loops: origins [m], of a weld also the rotation vector [rad], (rows,).

        Those of couplings come last [rad, m], as in ``mechanism.loops``.
        """
        self._place_loops(q)
        parts = [np.empty(0)]
        for _, data, weld in self._each:
            first, second = data.oMc1, data.oMc2
            parts.append(first.translation - second.translation)
            if weld:
                parts.append(self._pin.log3(first.rotation @ second.rotation.T))
        return np.concatenate([*parts, [coupling.gap(q) for coupling in self._couplings]])

    def constraint_jacobian(self, q: Floats) -> Floats:
        """Rates of the residuals per joint rate, base axes, (rows, nv) [-, m]."""
        couplings = np.array([coupling.row(q) for coupling in self._couplings]).reshape(-1, self.model.nv)
        if not len(self._constraints):
            return couplings
        self._place_loops(q)
        loops = self._pin.getConstraintsJacobian(self.model, self.data, self._constraints, self._constraint_data)
        return np.concatenate([loops.reshape(-1, self.model.nv), couplings])

    def momentum_regressor(self, q: Floats, v: Floats) -> Floats:
        """W with ``W @ pi`` = linear [kg m/s] and angular momentum [kg m2/s], (6, 10 nb)."""
        self._pin.forwardKinematics(self.model, self.data, q, v)
        still = self._pin.Motion.Zero()
        return self._in_base([self._pin.bodyRegressor(still, rate) for rate in self.data.v])

    def wrench_regressor(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """W with ``W @ pi`` = shaking force [N] and moment [N m] on the base, weight excluded, (6, 10 nb)."""
        self._pin.forwardKinematics(self.model, self.data, q, v, a)
        return -self._in_base(list(map(self._pin.bodyRegressor, self.data.v, self.data.a)))

    def torque_regressor(self, q: Floats, v: Floats, a: Floats, root: Floats | None = None) -> Floats:
        """W with ``W @ pi`` = torques of the joints of the open tree, gravity included, (nv, 10 nb) [N m, N].

        ``root`` (9,) is the motion of the base: rate of turning, acceleration, angular acceleration.
        """
        turning, pushed, turned = np.zeros((3, 3)) if root is None else root.reshape(3, 3)
        speed = self._pin.Motion(np.zeros(3), turning)
        rate = self._pin.Motion(pushed - self.model.gravity.linear, turned)
        self._pin.forwardKinematics(self.model, self.data, q, v, a)
        self._pin.computeJointJacobians(self.model, self.data, q)
        found = []
        for joint in range(1, self.model.njoints):
            place, own = self.data.oMi[joint], self.data.v[joint]
            base = place.actInv(speed)
            body = self._pin.bodyRegressor(own + base, self.data.a[joint] + place.actInv(rate) + base.cross(own))
            jacobian = self._pin.getJointJacobian(self.model, self.data, joint, self._pin.LOCAL).reshape(6, -1)
            found.append(jacobian.T @ body)
        return np.hstack(found)

    def point(self, q: Floats, joint: int, offset: Floats) -> tuple[Floats, Floats]:
        """Base coordinates (3,) [m] of a point at ``offset`` (3,) [m] in a joint's frame, and its Jacobian (3, nv)."""
        body = self._bodies.index(joint) + 1
        self._pin.computeJointJacobians(self.model, self.data, q)
        place = self.data.oMi[body]
        jacobian = self._pin.getJointJacobian(self.model, self.data, body, self._pin.LOCAL_WORLD_ALIGNED)
        arm = place.rotation @ offset
        return place.translation + arm, jacobian[:3] - self._pin.skew(arm) @ jacobian[3:]

    def _place_loops(self, q: Floats) -> None:
        self._pin.computeJointJacobians(self.model, self.data, q)
        for loop, data, _ in self._each:
            loop.calc(self.model, self.data, data)

    def _in_base(self, by_joint: list[Floats]) -> Floats:
        """Regressors (6, 10) of the bodies in their own frames, that of the base first, as one in the base frame."""
        moved = [place.toDualActionMatrix() @ own for place, own in zip(self.data.oMi[1:], by_joint[1:], strict=True)]
        return np.concatenate(moved, axis=1)

    def _constraint_model(self, mechanism: Mechanism, loop: Loop) -> "pinocchio.RigidConstraintModel":
        kind = self._pin.ContactType.CONTACT_6D if loop.weld else self._pin.ContactType.CONTACT_3D
        ends = [value for end in (loop.first, loop.second) for value in self._anchor(end)]
        return self._pin.RigidConstraintModel(kind, self.model, *ends, self._pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)

    def _anchor(self, end: Anchor) -> "tuple[int, pinocchio.SE3]":
        """Pinocchio's joint that carries an anchor, and its placement there."""
        joint = 0 if end.joint < 0 else self._bodies.index(end.joint) + 1
        return joint, self._pin.SE3(end.rotation, end.position)


def refuse_other_than_pinocchio(
    mechanism: Mechanism,
    what: str,
    key: Hashable,
    states: tuple[Floats, ...],
    found: Callable[[int], Floats],
    expected: Callable[..., tuple[Floats, Floats]],
) -> None:
    """Raise ModelError where ``found`` is not what Pinocchio computes, in a few random ones of n states.

    ``states`` are q, v, ... (n, nv), and ``found`` gets the index of one; ``expected`` gets Pinocchio's engine and a
    state, and gives a result and the size of what is added up in it, in SI. A ``key`` that was found to agree on this
    mechanism is not computed again.
    """
    if key in mechanism.tree.compared:
        return
    finite = np.flatnonzero(np.isfinite(np.hstack(states)).all(axis=1))
    chosen = np.random.default_rng(0).permutation(finite)[:_COMPARED_STATES]
    engine = PinocchioEngine(mechanism)
    for k in chosen:
        value, size = expected(engine, *(np.ascontiguousarray(state[k]) for state in states))
        difference = np.abs(found(int(k)) - value)
        if not (difference <= AGREEMENT * size.max(initial=1e-300)).all():
            raise ModelError(
                f"{mechanism.name}: {what} differs from Pinocchio's by {difference.max():.3g}, relative to "
                f"{size.max():.3g}: expected {AGREEMENT:g} at most. No answer is given; please report the file"
            )
    if len(chosen):
        mechanism.tree.compared.add(key)
