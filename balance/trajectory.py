"""A whole trajectory closed at once.

It is first closed by continuation on a coarse set of its samples, starting from the home configuration, then everywhere
at once from guesses of third order between them: that keeps every sample on the home configuration's assembly branch.
"""

from dataclasses import dataclass

import numpy as np

from . import constraints, kinematics
from .arrays import Floats
from .blocks import in_blocks
from .coarse import Coarse
from .errors import ClosureError
from .loopsystem import RESIDUAL_LIMIT, LoopSystem, inverse_of
from .motion import Samples

SINGULAR_LIMIT = 1e6
"""Condition number of loops and driven coordinates above which a state counts as singular: rates lose as many of their
16 digits as it has, accelerations twice as many."""
POOR_LIMIT = 1e4
"""Condition number above which the rows that were left out are taken in: those chosen at home may serve badly here."""
BRANCH_LIMIT = 0.1
"""How far a configuration may lie from its guess between coarse samples [rad, m]."""


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
    """Largest condition number of loops and driven coordinates over all samples."""
    branch: str
    """The configuration whose assembly branch every sample is on."""

    def is_closed(self, tol: float = RESIDUAL_LIMIT) -> bool:
        """Whether no residual exceeds ``tol`` [m, rad]."""
        return self.residual <= tol


def follow(system: LoopSystem, home: Floats, samples: Samples) -> Trajectory:
    """Close the mechanism at every sample, on the branch of the closed configuration ``home`` (nv,).

    Raises ClosureError, naming the time, where it cannot be closed, is singular, or leaves its branch.
    """
    coarse = Coarse.closed(system, home, samples)
    count, size, dof = len(samples.time), system.mechanism.tree.size, system.drive.size
    q, v, a = np.empty((3, count, size))
    per_drive = np.empty((count, size, dof))

    def close(part: slice) -> tuple[float, float]:
        q[part], v[part], a[part], per_drive[part], gap, number = _solve_block(system, samples, part, coarse)
        return gap, number

    found = list(in_blocks(count, close))
    worst, condition = (max(values) for values in zip(*found, strict=True))
    name, branch = system.mechanism.name, system.mechanism.branch
    return Trajectory(name, samples.time, q, v, a, per_drive, worst, condition, branch)


def _solve_block(
    system: LoopSystem, samples: Samples, part: slice, coarse: Coarse
) -> tuple[Floats, Floats, Floats, Floats, float, float]:
    mechanism = system.mechanism
    target, rate, rate_of_rate = (x[part].T for x in (samples.position, samples.velocity, samples.acceleration))
    guess = coarse.guess(samples.position[part], part)
    try:
        q = system.newton(guess, target)
        at, loops, driven = system.evaluate(q, target)
        matrix = system.matrix(at)
        inverse = inverse_of(matrix)
    except np.linalg.LinAlgError as error:
        if system.redundant:
            return _solve_block(system.with_all_rows(), samples, part, coarse)
        time = samples.time[part]
        raise ClosureError(
            f"{mechanism.name} is singular between t = {time[0]:.6g} s and {time[-1]:.6g} s of this motion"
        ) from error
    number = np.linalg.norm(matrix, axis=(1, 2)) * np.linalg.norm(inverse, axis=(1, 2))
    if system.redundant and not number.max() < POOR_LIMIT:
        return _solve_block(system.with_all_rows(), samples, part, coarse)
    worst = _checked(system, samples, part, loops, driven)
    _same_branch(system, samples, part, q - guess)
    condition = _condition(system, samples, part, number)
    per_drive = inverse[:, :, -system.drive.size :]
    v = np.einsum("nij,jn->in", per_drive, rate)
    still = kinematics.motion(mechanism.tree, at, v)
    bias = constraints.bias(mechanism.loops, at, still)[system.rows]
    demand = np.concatenate([-bias, rate_of_rate - system.drive.bias(at, still)])
    a = np.einsum("nij,jn->in", inverse, demand)
    return q.T, v.T, a.T, per_drive, worst, condition


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


def _condition(system: LoopSystem, samples: Samples, part: slice, number: Floats) -> float:
    """Largest condition number (Frobenius). Raises ClosureError where a state is singular."""
    worst = int(np.argmax(number))
    if not number[worst] < SINGULAR_LIMIT:
        raise ClosureError(
            f"{system.mechanism.name} is singular at t = {samples.time[part][worst]:.6g} s of this motion "
            f"(condition number {number[worst]:.3g}): the driven coordinates do not determine it there"
        )
    return float(number[worst])
