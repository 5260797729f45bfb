"""Loops and driven coordinates solved together by Newton's method: one configuration by Pinocchio, many by programs.

In a program Gauss's elimination goes in one order of pivots for all samples, chosen on a few of them: among entries
that are not small, the one that fills in least (H. M. Markowitz, 1957). What is zero for all samples costs
nothing then. Rows beyond the number of columns depend on the others: they are not used.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Floats
from ..errors import ClosureError
from ..mechanism.forward_kinematics import Pose, Tree, motion, pose
from ..mechanism.loop_constraints import (
    Constraint,
    Coupling,
    constraint_bias,
    constraint_jacobian,
    constraint_residual,
    loop_key,
)
from ..mechanism.mechanism import Mechanism
from ..mechanism.pinocchio_engine import PinocchioEngine
from ..mechanism.tape import Operand, Program, Symbols, Tape, largest
from ..motion.driven_coordinates import Drive

RESIDUAL_LIMIT = 1e-10
"""Largest loop residual that counts as closed, relative to the mechanism's length."""
ITERATIONS = 30
"""Newton steps after which an iteration counts as lost."""
_CONVERGED = 1e-9
"""Newton step after which the next one is below rounding [rad, m]."""
SINGULAR_LIMIT = 1e6
"""Condition number of loops and driven coordinates, scaled, above which a state counts as singular: rates lose as many
of their 16 digits as it has, accelerations twice as many."""
_ITERATIONS_OF_A_STEP = 8
"""Newton steps after which a step of continuation counts as too long; one of those that are kept needs five."""
_LONGEST_STEP = 0.5
"""Of a coordinate in a step of continuation [rad, lengths of the mechanism]."""
_SHORTEST_STEP = 1e-12
"""Of continuation, as a share of the way, below which it is stuck."""
Order = tuple[tuple[int, int], ...]
"""Pivots in turn: row and column."""


def loop_scales(mechanism: Mechanism, scales: Floats, length: float) -> Floats:
    """Of the loops' rows, (rows,) [rad, m]: a ``length`` [m] of places; of couplings that of the coordinate, (nv,)."""
    loops = [[length] * 3 + [1.0] * (loop.size - 3) for loop in mechanism.closed_loops]
    ties = [scales[[loop.first]] for loop in mechanism.loops if isinstance(loop, Coupling)]
    return np.concatenate([np.empty(0), *loops, *ties])


@dataclass(frozen=True)
class LoopSystem:
    """Loop constraints and driven coordinates as one system of equations, redundant rows among them."""

    mechanism: Mechanism
    engine: PinocchioEngine
    home: Floats
    """The closed configuration whose branch is followed, (nv,) [rad, m]."""
    length: float
    """A length of the mechanism, to which residuals are compared [m]."""
    scales: Floats
    """Of the coordinates, (nv,): 1 rad of what turns, ``length`` [m] of a slide."""
    drive: Drive

    @cached_property
    def row_scales(self) -> Floats:
        """Of all rows, (rows + dof,) [rad, m]: those of the loops, then of the driven coordinates."""
        loops = loop_scales(self.mechanism, self.scales, self.length)
        return np.concatenate([loops, self.drive.scales(self.scales, self.length)])

    def gaps(self, q: Floats, target: Floats) -> Floats:
        """Residuals of all loop rows, then of the driven coordinates to ``target`` (dof,), at ``q`` (nv,) [m, rad]."""
        return np.concatenate([self.engine.constraint_residual(q), self.drive.value(self.engine, q) - target])

    def all_rows(self, q: Floats) -> Floats:
        """Jacobian of all loop rows and of the driven coordinates at ``q`` (nv,), (rows + dof, nv) [-, m]."""
        return np.concatenate([self.engine.constraint_jacobian(q), self.drive.rates(self.engine, q)])

    def scaled_rows(self, q: Floats) -> Floats:
        """``all_rows`` in units of the scales of rows and coordinates: the same in metres and in millimetres."""
        return self.all_rows(q) * self.scales / self.row_scales[:, None]

    def rates_per_drive(self, q: Floats) -> Floats:
        """Rates of all coordinates per rate of the driven ones, (nv, dof) [-, 1/m, m], at ``q`` (nv,) [rad, m]."""
        return np.linalg.pinv(self.all_rows(q))[:, -self.drive.size :]

    def newton(self, q: Floats, target: Floats) -> Floats:
        """Iterate from ``q`` (nv,) to ``target`` (dof,), (nv,) [rad, m]; unchecked."""
        for _ in range(_ITERATIONS_OF_A_STEP):
            gap = self.gaps(q, target)
            if not np.abs(gap).max() > 1e-14 * self.length:
                break
            change = np.linalg.lstsq(self.all_rows(q), gap, rcond=1e-13)[0]
            q = q - change
            if np.abs(change).max() < 1e-8 * min(1.0, self.length):
                break  # quadratic convergence: the next change is below rounding
        return q

    def step(self, q: Floats, target: Floats) -> Floats | None:
        """The closed configuration at driven position ``target`` (dof,), one step from ``q`` (nv,), (nv,) [rad, m].

        None where it is too long: where an eigenvalue of J0^-1 J differs from 1 by half, with J0 the Jacobian at ``q``
        and J that at its end, or an average of the way (the tangent then misses by half of the step). One of them is
        zero where J is singular: steps shorten towards a singular position, and do not pass it.
        """
        left, sizes, right = np.linalg.svd(self.scaled_rows(q), full_matrices=False)
        if sizes[-1] * SINGULAR_LIMIT < sizes[0]:
            return None
        inverse = (right.T / sizes) @ left.T
        ahead = (target - self.drive.value(self.engine, q)) / self.row_scales[-self.drive.size :]
        along = inverse[:, -self.drive.size :] @ ahead
        if not np.abs(along).max() < _LONGEST_STEP:
            return None
        try:
            end = self.newton(q + along * self.scales, target)
            moved, turned = (end - q) / self.scales, np.linalg.eigvals(inverse @ self.scaled_rows(end)) - 1.0
        except np.linalg.LinAlgError:
            return None
        closed = np.abs(self.gaps(end, target)).max() < RESIDUAL_LIMIT * self.length
        bent = np.linalg.norm(moved - along) - _CONVERGED
        return end if closed and np.abs(turned).max() < 0.5 and bent < 0.5 * np.linalg.norm(moved) else None

    def continue_to(self, q: Floats, target: Floats, time: float) -> Floats:
        """Continuation of ``q`` (nv,) to driven position ``target`` (dof,), straight, (nv,) [rad, m].

        Steps are halved as needed. Raises ClosureError, naming ``time`` [s] and how far it got, where it is stuck.
        """
        start, done, step = self.drive.value(self.engine, q), 0.0, 1.0
        while done < 1.0:
            step = min(step, 1.0 - done)
            end = self.step(q, start + (done + step) * (target - start))
            if end is not None:
                q, done, step = end, done + step, step * 2.0
                continue
            step /= 2.0
            if step < _SHORTEST_STEP:
                at, got = (
                    ", ".join(f"{name} = {value:.8g}" for name, value in zip(self.drive.names, values, strict=True))
                    for values in (target, self.drive.value(self.engine, q))
                )
                why = f"it is singular there: {self.singularity(q)}"
                if self.condition(q) < 1e-2 * SINGULAR_LIMIT:
                    why = "no singular position is near: write the places of its loops with more digits"
                raise ClosureError(
                    f"{self.mechanism.name} cannot be closed at {at} (t = {time:.6g} s): it gets as far as {got} on "
                    f"the branch of {self.mechanism.branch!r}; {why}"
                )
        return q

    def condition(self, q: Floats) -> float:
        """Condition number of ``scaled_rows`` at ``q`` (nv,) [rad, m]."""
        sizes = np.linalg.svd(self.scaled_rows(q), compute_uv=False)
        return float(sizes[0] / max(float(sizes[-1]), 1e-300))

    def singularity(self, q: Floats) -> str:
        """What is said of ``q`` (nv,) [rad, m], near which the driven coordinates do not determine the others."""
        loose = np.abs(np.linalg.svd(self.scaled_rows(q))[2][-1])
        free = [self.mechanism.coordinates[k] for k in np.argsort(-loose)[:3] if loose[k] > 0.3 * loose.max()]
        held = ", ".join(self.drive.names)
        return (
            f"with {held} held, {', '.join(free)} can move (condition number {self.condition(q):.3g}, at "
            f"{self.mechanism.branch!r} {self.condition(self.home):.3g}). Keep the motion away from there, drive "
            f"{free[0]} instead, or begin elsewhere (a keyframe 'home'; of a URDF home in its YAML file)"
        )


@dataclass(frozen=True)
class LoopProgram:
    """Loops and driven coordinates of a mechanism, written down for many samples."""

    tree: Tree
    loops: tuple[Constraint, ...]
    drive: Drive

    def order(self, q: Floats) -> Order:
        """Pivots for the configurations ``q`` (nv, n) [rad, m], chosen on nine of them."""

        def write() -> Program:
            tape = Tape()
            return tape.program(self._jacobian(pose(self.tree, tape.rows(self.tree.size))).ravel())

        few = np.ascontiguousarray(q[:, np.unique(np.linspace(0, q.shape[1] - 1, 9).astype(int))])
        found = self.tree.once(("equations", self._key), write).values(few)
        return pivot_order(found.reshape(-1, *few.shape).transpose(2, 0, 1))

    def closed(self, guess: Floats, target: Floats, order: Order) -> Floats:
        """Configurations (nv, n) [rad, m] from good guesses to driven coordinates ``target`` (dof, n); unchecked."""
        program = self.step(order)
        q, moved, size = guess, np.empty_like(guess), np.empty((1, guess.shape[1]))
        for _ in range(ITERATIONS):
            program.run([q, target], [moved, size])
            q, moved = moved, np.empty_like(guess) if q is guess else q
            if not size.max() > _CONVERGED:
                break
        return q

    def step(self, order: Order) -> Program:
        """From configurations and driven coordinates to better ones, and the largest change."""

        def write() -> Program:
            tape = Tape()
            q, target = tape.rows(self.tree.size), tape.rows(self.drive.size)
            at = pose(self.tree, q)
            change = SparseLU.factorise(self._jacobian(at), order).solve(self._residual(at, target))
            return tape.program([*(q - change), largest(change)])

        return self.tree.once(("step", order, self._key), write)

    def rates(self, order: Order) -> Program:
        """From configurations, driven coordinates and their two rates to what a motion has.

        In turn: velocities, accelerations, rates of all coordinates per driven one (dof by nv), largest residual, and
        how near a pivot is to zero, as its inverse.
        """

        def write() -> Program:
            tape, dof = Tape(), self.drive.size
            q, target, rate, rate_of_rate = (tape.rows(k) for k in (self.tree.size, dof, dof, dof))
            at = pose(self.tree, q)
            factors = SparseLU.factorise(self._jacobian(at), order)
            still = [0.0] * sum(loop.size for loop in self.loops)
            per_drive = [factors.solve([*still, *unit]) for unit in np.eye(dof).tolist()]
            v = factors.solve([*still, *rate])
            moving = motion(self.tree, at, v)
            bias = np.concatenate([constraint_bias(self.loops, at, moving), self.drive.bias(at, moving)])
            a = factors.solve(np.r_[still, rate_of_rate] - bias)
            gap = largest(self._residual(at, target))
            return tape.program([*v, *a, *np.ravel(per_drive), gap, largest(factors.inverse_pivots)])

        return self.tree.once(("rates", order, self._key), write)

    @property
    def _key(self) -> Hashable:
        return self.drive.key, loop_key(self.loops)

    def _residual(self, at: Pose, target: Symbols) -> Symbols:
        return np.concatenate([constraint_residual(self.loops, at), self.drive.position(at) - target])

    def _jacobian(self, at: Pose) -> Symbols:
        return np.concatenate([constraint_jacobian(self.loops, self.tree, at), self.drive.jacobian(self.tree, at)])


_THRESHOLD = 0.1
"""A pivot is at least this share of the largest remaining entry of its column, at every sample that it is chosen on."""


def is_zero(entry: Operand) -> bool:
    """Whether an entry is zero for all samples."""
    return isinstance(entry, float) and entry == 0.0


def pivot_order(matrices: Floats) -> Order:
    """Pivots for ``matrices`` (k, rows, columns), in SI: as many as columns, each in a row of its own."""
    reduced, order = matrices.copy(), []
    rows, columns = list(range(reduced.shape[1])), list(range(reduced.shape[2]))
    while columns:
        part = reduced[:, rows][:, :, columns]
        share = np.abs(part) / np.maximum(np.abs(part).max(axis=1, keepdims=True), 1e-300)
        least, filled = share.min(axis=0), (part != 0.0).any(axis=0)
        cost = np.outer(filled.sum(axis=1) - 1, filled.sum(axis=0) - 1).astype(float)
        cost[least < _THRESHOLD] = np.inf
        best = np.argmin(cost - 1e-3 * least) if np.isfinite(cost).any() else np.argmax(least)
        i, j = (int(x) for x in np.unravel_index(best, least.shape))
        row, column = rows.pop(i), columns.pop(j)
        order.append((row, column))
        pivot = reduced[:, row, column]
        factor = reduced[:, :, column] / np.where(pivot == 0.0, np.inf, pivot)[:, None]
        factor[:, [r for r in range(reduced.shape[1]) if r not in rows]] = 0.0
        reduced = reduced - factor[:, :, None] * reduced[:, row, None, :]
        reduced[:, rows, column] = 0.0
    return tuple(order)


@dataclass(frozen=True)
class SparseLU:
    """The triangular factors of a matrix a sample."""

    order: Order
    upper: list[list[Operand]]
    lower: list[list[tuple[int, Operand]]]
    """For each pivot, the rows from which its row was subtracted, and how many times."""
    inverse_pivots: list[Operand]

    @classmethod
    def factorise(cls, matrix: Symbols, order: Order) -> "SparseLU":
        """Eliminate a ``matrix`` (rows, columns) in the given order."""
        upper, waiting = {row: list(matrix[row]) for row, _ in order}, [row for row, _ in order]
        lower: list[list[tuple[int, Operand]]] = []
        pivots: list[Operand] = []
        for row, column in order:
            waiting.remove(row)
            source, inverse = upper[row], 1.0 / upper[row][column]
            taken = [(other, upper[other][column] * inverse) for other in waiting if not is_zero(upper[other][column])]
            ahead = [k for k, entry in enumerate(source) if k != column and not is_zero(entry)]
            for other, times in taken:
                target = upper[other]
                for k in ahead:
                    target[k] = target[k] - times * source[k]
                target[column] = 0.0
            lower.append(taken)
            pivots.append(inverse)
        return cls(order, [upper[row] for row, _ in order], lower, pivots)

    def solve(self, right: Sequence[Operand] | Symbols) -> Symbols:
        """Solution (columns,) for right-hand sides by row of the matrix; rows without a pivot do not count."""
        value = {row: right[row] for row, _ in self.order}
        for (row, _), taken in zip(self.order, self.lower, strict=True):
            if not is_zero(value[row]):
                for other, times in taken:
                    value[other] = value[other] - times * value[row]
        solution = np.full(len(self.order), 0.0, dtype=object)
        for (row, column), entries, inverse in reversed(
            list(zip(self.order, self.upper, self.inverse_pivots, strict=True))
        ):
            rest = value[row]
            for k, entry in enumerate(entries):
                if k != column and not is_zero(entry) and not is_zero(solution[k]):
                    rest = rest - entry * solution[k]
            solution[column] = rest * inverse
        return solution
