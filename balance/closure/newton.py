"""Loops and driven coordinates solved together by Newton's method, one configuration at a time, by Pinocchio."""

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Indices
from ..errors import ClosureError
from ..mechanism.mechanism import Mechanism
from ..mechanism.pinocchio_engine import PinocchioEngine
from ..motion.driven_coordinates import Drive

RESIDUAL_LIMIT = 1e-10
"""Largest loop residual that counts as closed, relative to the mechanism's length."""
ITERATIONS = 30
"""Newton steps after which an iteration counts as lost."""


@dataclass(frozen=True)
class LoopSystem:
    """Loop constraints and driven coordinates as one system of equations, redundant rows among them."""

    mechanism: Mechanism
    engine: PinocchioEngine
    rows: Indices
    """Independent rows of the loop constraints."""
    length: float
    """A length of the mechanism, to which residuals are compared [m]."""
    drive: Drive

    def gaps(self, q: Floats, target: Floats) -> Floats:
        """Residuals of all loop rows, then of the driven coordinates to ``target`` (dof,), at ``q`` (nv,) [m, rad]."""
        return np.concatenate([self.engine.constraint_residual(q), self.drive.value(self.engine, q) - target])

    def all_rows(self, q: Floats) -> Floats:
        """Jacobian of all loop rows and of the driven coordinates at ``q`` (nv,), (rows + dof, nv) [-, m]."""
        return np.concatenate([self.engine.constraint_jacobian(q), self.drive.rates(self.engine, q)])

    def matrix(self, q: Floats) -> Floats:
        """Jacobian of independent loop rows and driven coordinates at ``q`` (nv,) [rad, m], (nv, nv) [-, m]."""
        return np.concatenate([self.engine.constraint_jacobian(q)[self.rows], self.drive.rates(self.engine, q)])

    def determinant_sign(self, q: Floats) -> float:
        """Sign of the determinant at ``q`` (nv,) [rad, m]; it changes where a singular position is passed."""
        return float(np.linalg.slogdet(self.matrix(q))[0])

    def rates_per_drive(self, q: Floats, time: float) -> Floats:
        """Rates of all coordinates per rate of the driven ones, (nv, dof) [-, 1/m, m], at ``q`` (nv,) [rad, m].

        Raises ClosureError, naming ``time`` [s], at a singular configuration.
        """
        try:
            return np.linalg.inv(self.matrix(q))[:, -self.drive.size :]
        except np.linalg.LinAlgError as error:
            raise ClosureError(
                f"{self.mechanism.name} is singular at t = {time:.6g} s of this motion: {', '.join(self.drive.names)} "
                "do not determine it there"
            ) from error

    def newton(self, q: Floats, target: Floats) -> Floats:
        """Iterate from ``q`` (nv,) to ``target`` (dof,), (nv,) [rad, m]; unchecked."""
        for _ in range(ITERATIONS):
            gap = self.gaps(q, target)
            if not np.abs(gap).max() > 1e-14 * self.length:
                break
            change = np.linalg.lstsq(self.all_rows(q), gap, rcond=1e-13)[0]
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
            trial = self.newton(q, target)
        except np.linalg.LinAlgError:
            return None
        gap = np.abs(self.gaps(trial, target)).max()
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
