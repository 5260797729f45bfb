"""Loops and driven coordinates solved together by Newton's method, one configuration or many at once."""

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats, Indices
from ..errors import ClosureError
from ..mechanism import forward_kinematics, loop_constraints
from ..mechanism.forward_kinematics import Pose
from ..mechanism.mechanism import Mechanism
from ..mechanism.sparse_components import Rows, dense_rows
from ..motion.driven_coordinates import Drive
from .sparse_lu import Order, SparseLU, dense_columns, pivot_order

RESIDUAL_LIMIT = 1e-10
"""Largest loop residual that counts as closed, relative to the mechanism's length."""
ITERATIONS = 30
"""Newton steps after which an iteration counts as lost."""


@dataclass(frozen=True)
class LoopSystem:
    """Independent loop constraints and driven coordinates as one square system of equations."""

    mechanism: Mechanism
    rows: Indices
    """Independent rows of the loop constraints."""
    length: float
    """A length of the mechanism, to which residuals are compared [m]."""
    drive: Drive

    def evaluate(self, q: Floats, target: Floats) -> tuple[Pose, Floats, Floats]:
        """Pose, residual of the loops (rows, n) and of the driven coordinates (dof, n) [m, rad].

        ``q`` (nv, n) [rad, m]; ``target`` (dof, n) are the driven coordinates asked for.
        """
        at = forward_kinematics.pose(self.mechanism.tree, q)
        return at, loop_constraints.constraint_residual(self.mechanism.loops, at), self.drive.position(at, q) - target

    def equations(self, at: Pose) -> Rows:
        """Jacobian of all loop rows and of the driven coordinates, by component."""
        tree = self.mechanism.tree
        return loop_constraints.constraint_jacobian(self.mechanism.loops, tree, at) + self.drive.jacobian(tree, at)

    def matrix(self, at: Pose) -> Floats:
        """Jacobian of independent loop rows and driven coordinates, (n, nv, nv) [-, m]."""
        rows = self.equations(at)
        independent = [rows[i] for i in self.rows] + rows[len(rows) - self.drive.size :]
        return np.ascontiguousarray(dense_rows(independent, self.mechanism.tree.size, at.count).transpose(2, 0, 1))

    def order(self, q: Floats) -> Order:
        """Pivots for the configurations ``q`` (nv, n) [rad, m], chosen on nine of them."""
        few = q[:, np.unique(np.linspace(0, q.shape[1] - 1, 9).astype(int))]
        rows = self.equations(forward_kinematics.pose(self.mechanism.tree, few))
        return pivot_order(dense_rows(rows, self.mechanism.tree.size, few.shape[1]).transpose(2, 0, 1))

    def newton_from_guesses(self, q: Floats, target: Floats, order: Order) -> Floats:
        """Newton's method on many samples from good guesses ``q`` to ``target`` (dof, n), (nv, n) [rad, m]; unchecked.

        Factors are used again while the steps are small: the next error is then the product of the last two.
        """
        before = np.inf
        for _ in range(ITERATIONS):
            at, loops, driven = self.evaluate(q, target)
            if before > 1e-3:
                factors = SparseLU.factorise(self.equations(at), order)
            step = dense_columns(factors.solve([*loops, *driven]), q.shape[1])
            q, size = q - step, float(np.abs(step).max())
            if not size * min(before, 1.0) > 1e-15:
                break
            before = size
        return q

    def with_all_rows(self) -> "LoopSystem":
        """The same with the redundant rows too: more equations than unknowns, all of them met where the loops close."""
        return replace(self, rows=np.arange(sum(loop.size for loop in self.mechanism.loops)))

    def matrix_at(self, q: Floats) -> Floats:
        """The matrix (nv, nv) [-, m] at one configuration ``q`` (nv,) [rad, m]."""
        return self.matrix(forward_kinematics.pose(self.mechanism.tree, q[:, None]))[0]

    def determinant_sign(self, q: Floats) -> float:
        """Sign of the determinant at ``q`` (nv,) [rad, m]; it changes where a singular position is passed."""
        return float(np.linalg.slogdet(self.matrix_at(q))[0])

    def rates_per_drive(self, q: Floats, time: float) -> Floats:
        """Rates of all coordinates per rate of the driven ones, (nv, dof) [-, 1/m, m], at ``q`` (nv,) [rad, m].

        Raises ClosureError, naming ``time`` [s], at a singular configuration.
        """
        try:
            return pseudo_inverse(self.matrix_at(q)[None])[0, :, -self.drive.size :]
        except np.linalg.LinAlgError as error:
            raise ClosureError(
                f"{self.mechanism.name} is singular at t = {time:.6g} s of this motion: {', '.join(self.drive.names)} "
                "do not determine it there"
            ) from error

    def newton(self, q: Floats, target: Floats) -> Floats:
        """Iterate from ``q`` (nv, n) to ``target`` (dof, n) on all samples at once, (nv, n) [rad, m]; unchecked."""
        for _ in range(ITERATIONS):
            at, loops, driven = self.evaluate(q, target)
            residual = np.concatenate([loops[self.rows], driven])
            size = np.abs(residual).max()
            if not size > 1e-14 * self.length:
                break
            change = _solution(self.matrix(at), residual.T[:, :, None])[:, :, 0].T
            q = q - change
            if np.abs(change).max() < 1e-8 * min(1.0, self.length):
                break  # quadratic convergence: the next change is below rounding
        return q

    def continue_to(self, q: Floats, start: Floats, target: Floats, time: float) -> Floats:
        """Continuation of ``q`` (nv,) from driven position ``start`` (dof,) to ``target``, (nv,) [rad, m].

        Steps are halved as needed. Raises ClosureError, naming ``time`` [s] and how far it got, where it is stuck.
        """
        done, step = 0.0, 1.0
        while done < 1.0:
            step = min(step, 1.0 - done)
            trial = self._step(q, start + (done + step) * (target - start))
            if trial is None:
                step /= 2.0
                if step < 1e-4:
                    raise self._stuck(start + done * (target - start), target, time)
                continue
            q, done, step = trial, done + step, step * 2.0
        return q

    def _step(self, q: Floats, target: Floats) -> Floats | None:
        try:
            trial = self.newton(q[:, None], target[:, None])[:, 0]
            _, loops, driven = self.evaluate(trial[:, None], target[:, None])
        except np.linalg.LinAlgError:
            return None
        gap = max(np.abs(loops).max(initial=0.0), np.abs(driven).max(initial=0.0))
        if not gap < RESIDUAL_LIMIT * self.length or np.abs(trial - q).max() > 0.5 * max(1.0, self.length):
            return None
        return trial

    def _stuck(self, reached: Floats, target: Floats, time: float) -> ClosureError:
        at = ", ".join(f"{name} = {value:.6g}" for name, value in zip(self.drive.names, target, strict=True))
        got = ", ".join(f"{value:.6g}" for value in reached)
        return ClosureError(
            f"{self.mechanism.name} cannot be closed at {at} (t = {time:.6g} s): it gets as far as {got} on "
            f"the branch of {self.mechanism.branch!r}; the position is out of reach or singular"
        )


def pseudo_inverse(matrix: Floats) -> Floats:
    """Inverse (n, nv, rows) of each matrix (n, rows, nv) [-, m]; of least squares where rows > nv."""
    if matrix.shape[1] == matrix.shape[2]:
        return np.linalg.inv(matrix)
    u, size, vt = np.linalg.svd(matrix, full_matrices=False)
    return (vt.transpose(0, 2, 1) / np.maximum(size, 1e-300)[:, None, :]) @ u.transpose(0, 2, 1)


def _solution(matrix: Floats, right: Floats) -> Floats:
    if matrix.shape[1] == matrix.shape[2]:
        return np.linalg.solve(matrix, right)
    return pseudo_inverse(matrix) @ right
