"""A whole trajectory closed at once.

It is first closed by continuation on a coarse set of its samples, starting from the home configuration, then everywhere
at once from guesses of third order between them: that keeps every sample on the home configuration's assembly branch.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import constraints, kinematics
from ..arrays import Floats
from ..blocks import in_blocks
from ..components import Entry, Rows
from ..errors import ClosureError
from ..motion import Samples
from .coarse import Coarse
from .elimination import Elimination, at_samples, dense_columns
from .loopsystem import RESIDUAL_LIMIT, LoopSystem

SINGULAR_LIMIT = 1e6
"""Condition number of loops and driven coordinates above which a state counts as singular: rates lose as many of their
16 digits as it has, accelerations twice as many."""
POOR_LIMIT = 1e4
"""Growth of elimination above which a block of samples is halved: its order of pivots serves some of it badly."""
BRANCH_LIMIT = 0.1
"""How far a configuration may lie from its guess between coarse samples [rad, m]."""

_Closed = tuple[Floats, Floats, Floats, Floats, float, float]
"""Positions, velocities, accelerations, rates per drive, largest residual and condition number of a block."""


@dataclass(frozen=True)
class Trajectory:
    """Loop-consistent motion of all coordinates."""

    mechanism: str
    time: Floats
    """Time, (n,) [s]."""
    q: Floats
    """Positions, (n, nv) [rad, m]."""
    v: Floats
    """Velocities, (n, nv) [rad/s, m/s]."""
    a: Floats
    """Accelerations, (n, nv) [rad/s2, m/s2]."""
    per_drive: Floats
    """Rates of all coordinates per rate of the driven ones, (n, nv, dof)."""
    residual: float
    """Largest loop and drive residual over all samples, all rows [m, rad]."""
    condition: float
    """Condition number of loops and driven coordinates where elimination did worst, the largest of all blocks."""
    branch: str
    """The configuration whose assembly branch every sample is on."""

    def is_closed(self, tol: float = RESIDUAL_LIMIT) -> bool:
        """Whether no residual exceeds ``tol`` [m, rad]."""
        return self.residual <= tol


def follow(system: LoopSystem, home: Floats, samples: Samples, near: Trajectory | None = None) -> Trajectory:
    """Close the mechanism at every sample, on the branch of the closed configuration ``home`` (nv,), or of ``near``.

    Raises ClosureError, naming the time, where it cannot be closed, is singular, or leaves its branch.
    """
    guess_of = _guesses(system, home, samples, near)
    count, size, dof = len(samples.time), system.mechanism.tree.size, system.drive.size
    q, v, a = np.empty((3, size, count)).transpose(0, 2, 1)
    per_drive = np.empty((dof, size, count)).transpose(2, 1, 0)

    def close(part: slice) -> tuple[float, float]:
        guess = guess_of(part)
        q[part], v[part], a[part], per_drive[part], gap, number = _solve_block(system, samples, part, guess)
        return gap, number

    found = list(in_blocks(count, close))
    worst, condition = (max(values) for values in zip(*found, strict=True))
    name, branch = system.mechanism.name, system.mechanism.branch
    return Trajectory(name, samples.time, q, v, a, per_drive, worst, condition, branch)


def _guesses(system: LoopSystem, home: Floats, samples: Samples, near: Trajectory | None) -> Callable[[slice], Floats]:
    """Where Newton's method starts, (nv, n) [rad, m]: from a trajectory near by, else from coarse samples."""
    if near is not None:
        return lambda part: np.ascontiguousarray(near.q[part].T)
    coarse = Coarse.closed(system, home, samples)
    return lambda part: coarse.guess(samples.position[part], part)


def _solve_block(system: LoopSystem, samples: Samples, part: slice, guess: Floats) -> _Closed:
    """Close a block of samples in one order of pivots; where that serves badly, its halves each in their own."""
    order = system.order(guess)
    target, rate, rate_of_rate = (x[part].T for x in (samples.position, samples.velocity, samples.acceleration))
    with np.errstate(all="ignore"):  # a pivot may vanish: what comes of it is not finite, and told by the checks
        q = system.newton_from_near(guess, target, order)
        at, loops, driven = system.evaluate(q, target)
        rows = system.equations(at)
        factors = Elimination.of(rows, order)
        growth = factors.growth(at.count)
    if at.count > 1 and not growth.max() < POOR_LIMIT:
        return _solve_halves(system, samples, part, guess)
    worst = _checked(system, samples, part, loops, driven)
    _same_branch(system, samples, part, q - guess)
    condition = _condition(system, samples, part, rows, int(np.argmax(growth)))
    per_drive = _rates(factors, len(rows), system.drive.size, at.count)
    v = np.einsum("jin,jn->in", per_drive, rate)
    still = kinematics.motion(system.mechanism.tree, at, v)
    bias = constraints.bias(system.mechanism.loops, at, still)
    a = factors.solve([*(-bias), *(rate_of_rate - system.drive.bias(at, still))])
    return q.T, v.T, dense_columns(a, at.count).T, per_drive.transpose(2, 1, 0), worst, condition


def _solve_halves(system: LoopSystem, samples: Samples, part: slice, guess: Floats) -> _Closed:
    cut = (part.stop - part.start) // 2
    middle = part.start + cut
    q, v, a, per_drive, worst, condition = _solve_block(system, samples, slice(part.start, middle), guess[:, :cut])
    others = _solve_block(system, samples, slice(middle, part.stop), guess[:, cut:])
    joined = (np.concatenate(pair) for pair in zip((q, v, a, per_drive), others[:4], strict=True))
    q, v, a, per_drive = joined
    return q, v, a, per_drive, max(worst, others[4]), max(condition, others[5])


def _rates(factors: Elimination, rows: int, dof: int, count: int) -> Floats:
    """Rates of all coordinates per rate of the driven ones, (dof, nv, n)."""
    loops: list[Entry] = [0.0] * (rows - dof)
    columns = [factors.solve([*loops, *(float(i == j) for i in range(dof))]) for j in range(dof)]
    return np.stack([dense_columns(column, count) for column in columns])


def _checked(system: LoopSystem, samples: Samples, part: slice, loops: Floats, driven: Floats) -> float:
    """Largest residual over all rows, the redundant ones too. Raises ClosureError where one stays open."""
    gap = np.maximum(np.abs(loops).max(axis=0, initial=0.0), np.abs(driven).max(axis=0, initial=0.0))
    worst = float(np.max(gap))
    if not worst < RESIDUAL_LIMIT * system.length:
        k = int(np.argmax(~(gap < RESIDUAL_LIMIT * system.length)))
        raise ClosureError(
            f"{system.mechanism.name} cannot be closed at t = {samples.time[part][k]:.6g} s: {gap[k]:.3g} m stays open"
        )
    return worst


def _same_branch(system: LoopSystem, samples: Samples, part: slice, moved: Floats) -> None:
    """Raise ClosureError where Newton's method went far from its guess: another branch, or a singularity near by."""
    far = np.abs(moved).max(axis=0)
    if not far.max() < BRANCH_LIMIT * max(1.0, system.length):
        raise ClosureError(
            f"{system.mechanism.name} leaves the branch of {system.mechanism.branch!r} at "
            f"t = {samples.time[part][int(np.argmax(far))]:.6g} s: a singular position is near"
        )


def _condition(system: LoopSystem, samples: Samples, part: slice, rows: Rows, worst: int) -> float:
    """Condition number where elimination did worst. Raises ClosureError if the state is singular there."""
    size = np.linalg.svd(at_samples(rows, np.array([worst]))[0], compute_uv=False)
    number = float(size[0] / max(float(size[-1]), 1e-300))
    if not number < SINGULAR_LIMIT:
        raise ClosureError(
            f"{system.mechanism.name} is singular at t = {samples.time[part][worst]:.6g} s of this motion "
            f"(condition number {number:.3g}): the driven coordinates do not determine it there"
        )
    return number
