"""A whole trajectory closed at once, on the assembly branch of the home configuration.

Continuation from home closes a coarse set of its samples. All samples are then solved by Newton's method from guesses
of third order between the coarse ones, which keeps each on the branch; rates and accelerations follow from the factors.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Indices, parallel_blocks
from ..errors import ClosureError
from ..mechanism import forward_kinematics, loop_constraints
from ..mechanism.sparse_components import Entry, Rows
from ..motion import Samples
from .newton import RESIDUAL_LIMIT, LoopSystem
from .sparse_lu import SparseLU, dense_at_samples, dense_columns

COARSE_STEP = 0.1
"""Travel of the driven coordinates between two steps of continuation [rad, or lengths of the mechanism]."""
_BISECTIONS = 25
_SINGULAR_CROSSING = 1e-6
"""Smallest singular value, relative to the largest, that counts as zero after so many bisections."""


@dataclass(frozen=True)
class Continuation:
    """Coarse samples, each closed from the one before."""

    nodes: Indices
    """Which samples they are, (k,)."""
    u: Floats
    """Driven coordinates, (k, dof) [rad, m]."""
    q: Floats
    """Closed configurations, (k, nv) [rad, m]."""
    rates: Floats
    """Rates of all coordinates per rate of the driven ones, (k, nv, dof)."""

    @classmethod
    def closed(cls, system: LoopSystem, home: Floats, samples: Samples) -> "Continuation":
        """Close coarse samples one after the other, the first from the closed configuration ``home`` (nv,) [rad, m].

        Raises ClosureError, naming the time, where that is not possible or a singular position is passed.
        """
        nodes = _nodes(samples.position, COARSE_STEP * system.drive.scale(system.length))
        targets = np.concatenate([system.drive.value(system.mechanism, home)[None], samples.position[nodes]])
        q, side, solved, rates = home, system.determinant_sign(home), [], []
        for previous, target, node in zip(targets, targets[1:], nodes, strict=False):
            before, q = q, system.continue_to(q, previous, target, float(samples.time[node]))
            if system.determinant_sign(q) != side:
                _refuse_singular_between(system, before, previous, target, float(samples.time[node]))
                side = system.determinant_sign(q)
            solved.append(q)
            rates.append(system.rates_per_drive(q, float(samples.time[node])))
        return cls(nodes, samples.position[nodes], np.array(solved), np.array(rates))

    def guess(self, u: Floats, part: slice) -> Floats:
        """Configurations (nv, n) [rad, m] at samples ``part`` with driven coordinates ``u`` (n, dof), to third order.

        The mean of the chord and of the two tangents: their errors, +h2 t (1 - t) / 2 of the second derivative, cancel.
        """
        rates = self.rates
        left, right = self._around(part)
        t = self._share(u, left, right)[:, None]
        off = u - (1 - t) * self.u[left] - t * self.u[right]
        middle = 0.5 * (rates[left] + rates[right])
        straight = (1 - t) * self.q[left] + t * self.q[right] + np.einsum("nij,nj->ni", middle, off)
        from_left = self.q[left] + np.einsum("nij,nj->ni", rates[left], u - self.u[left])
        from_right = self.q[right] + np.einsum("nij,nj->ni", rates[right], u - self.u[right])
        return np.ascontiguousarray((0.5 * straight + 0.5 * ((1 - t) * from_left + t * from_right)).T)

    def _around(self, part: slice) -> tuple[Indices, Indices]:
        """Coarse samples before and after each of the samples ``part``; the same one where there is only one."""
        last = len(self.nodes) - 1
        before = np.searchsorted(self.nodes, np.arange(part.start, part.stop), side="right") - 1
        left = before.clip(0, max(last - 1, 0))
        return left, np.minimum(left + 1, last)

    def _share(self, u: Floats, left: Indices, right: Indices) -> Floats:
        """How far between the coarse samples around it a sample lies, 0 to 1, (n,)."""
        chord = self.u[right] - self.u[left]
        squared = np.maximum((chord**2).sum(axis=1), 1e-300)
        return (((u - self.u[left]) * chord).sum(axis=1) / squared).clip(0.0, 1.0)


def _nodes(position: Floats, step: float) -> Indices:
    """Indices of samples at most about ``step`` of travel apart, the first and the last among them."""
    travel = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    marks = np.arange(0.0, travel[-1] + step, step)
    nodes = np.searchsorted(travel, marks).clip(max=len(position) - 1)
    return np.unique(np.concatenate([nodes, [0, len(position) - 1]]))


def _refuse_singular_between(system: LoopSystem, q: Floats, start: Floats, end: Floats, time: float) -> None:
    """Raise ClosureError if the mechanism is singular between two driven positions: branches may meet there.

    The determinant changed its sign. Among redundant rows it may be only the chosen ones that depend on each other, so
    bisection finds the place, and all rows decide.
    """
    whole, side = system.with_all_rows(), system.determinant_sign(q)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (start + end)
        trial = whole.continue_to(q, start, middle, time)
        if system.determinant_sign(trial) == side:
            q, start = trial, middle
        else:
            end = middle
    sizes = np.linalg.svd(whole.matrix_at(q), compute_uv=False)
    if sizes[-1] < _SINGULAR_CROSSING * sizes[0]:
        at = ", ".join(f"{name} = {value:.6g}" for name, value in zip(system.drive.names, start, strict=True))
        raise ClosureError(
            f"{system.mechanism.name} passes a singular position at {at}, shortly before t = {time:.6g} s: the driven "
            "coordinates do not determine on which branch it continues"
        )


SINGULAR_LIMIT = 1e6
"""Condition number of loops and driven coordinates above which a state counts as singular: rates lose as many of their
16 digits as it has, accelerations twice as many."""
POOR_LIMIT = 1e4
"""Growth of elimination above which a block of samples is halved: its order of pivots is poor for some of it."""
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
    """Close the mechanism at every sample, on the branch of the configuration ``home`` (nv,) [rad, m] or of ``near``.

    Raises ClosureError, naming the time, where it cannot be closed, is singular, or changes its branch.
    """
    guess_of = _guesses(system, home, samples, near)
    count, size, dof = len(samples.time), system.mechanism.tree.size, system.drive.size
    q, v, a = np.empty((3, size, count)).transpose(0, 2, 1)
    per_drive = np.empty((dof, size, count)).transpose(2, 1, 0)

    def close(part: slice) -> tuple[float, float]:
        guess = guess_of(part)
        q[part], v[part], a[part], per_drive[part], gap, number = _solve_block(system, samples, part, guess)
        return gap, number

    found = list(parallel_blocks(count, close))
    worst, condition = (max(values) for values in zip(*found, strict=True))
    name, branch = system.mechanism.name, system.mechanism.branch
    return Trajectory(name, samples.time, q, v, a, per_drive, worst, condition, branch)


def _guesses(system: LoopSystem, home: Floats, samples: Samples, near: Trajectory | None) -> Callable[[slice], Floats]:
    """Where Newton's method starts, (nv, n) [rad, m]: on a trajectory close by, else between coarse samples."""
    if near is not None:
        return lambda part: np.ascontiguousarray(near.q[part].T)
    coarse = Continuation.closed(system, home, samples)
    return lambda part: coarse.guess(samples.position[part], part)


def _solve_block(system: LoopSystem, samples: Samples, part: slice, guess: Floats) -> _Closed:
    """Close a block of samples in one order of pivots; where that is poor for some, halve the block."""
    order = system.order(guess)
    target, rate, rate_of_rate = (x[part].T for x in (samples.position, samples.velocity, samples.acceleration))
    with np.errstate(all="ignore"):  # a pivot may vanish: the checks below find the infinite values
        q = system.newton_from_guesses(guess, target, order)
        at, loops, driven = system.evaluate(q, target)
        rows = system.equations(at)
        factors = SparseLU.factorise(rows, order)
        growth = factors.growth(at.count)
    if at.count > 1 and not growth.max() < POOR_LIMIT:
        return _solve_halves(system, samples, part, guess)
    worst = _largest_residual(system, samples, part, loops, driven)
    _refuse_other_branch(system, samples, part, q - guess)
    condition = _condition(system, samples, part, rows, int(np.argmax(growth)))
    per_drive = _rates(factors, len(rows), system.drive.size, at.count)
    v = np.einsum("jin,jn->in", per_drive, rate)
    still = forward_kinematics.motion(system.mechanism.tree, at, v)
    bias = loop_constraints.constraint_bias(system.mechanism.loops, at, still)
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


def _rates(factors: SparseLU, rows: int, dof: int, count: int) -> Floats:
    """Rates of all coordinates per rate of the driven ones, (dof, nv, n)."""
    loops: list[Entry] = [0.0] * (rows - dof)
    columns = [factors.solve([*loops, *(float(i == j) for i in range(dof))]) for j in range(dof)]
    return np.stack([dense_columns(column, count) for column in columns])


def _largest_residual(system: LoopSystem, samples: Samples, part: slice, loops: Floats, driven: Floats) -> float:
    """Largest residual over all rows, the redundant ones too. Raises ClosureError where one stays open."""
    gap = np.maximum(np.abs(loops).max(axis=0, initial=0.0), np.abs(driven).max(axis=0, initial=0.0))
    worst = float(np.max(gap))
    if not worst < RESIDUAL_LIMIT * system.length:
        k = int(np.argmax(~(gap < RESIDUAL_LIMIT * system.length)))
        raise ClosureError(
            f"{system.mechanism.name} cannot be closed at t = {samples.time[part][k]:.6g} s: {gap[k]:.3g} m stays open"
        )
    return worst


def _refuse_other_branch(system: LoopSystem, samples: Samples, part: slice, moved: Floats) -> None:
    """Raise ClosureError where Newton's method went far from its guess: another branch, or a singularity near by."""
    far = np.abs(moved).max(axis=0)
    if not far.max() < BRANCH_LIMIT * max(1.0, system.length):
        raise ClosureError(
            f"{system.mechanism.name} leaves the branch of {system.mechanism.branch!r} at "
            f"t = {samples.time[part][int(np.argmax(far))]:.6g} s: a singular position is near"
        )


def _condition(system: LoopSystem, samples: Samples, part: slice, rows: Rows, worst: int) -> float:
    """Condition number where elimination did worst. Raises ClosureError if the state is singular there."""
    size = np.linalg.svd(dense_at_samples(rows, np.array([worst]))[0], compute_uv=False)
    number = float(size[0] / max(float(size[-1]), 1e-300))
    if not number < SINGULAR_LIMIT:
        raise ClosureError(
            f"{system.mechanism.name} is singular at t = {samples.time[part][worst]:.6g} s of this motion "
            f"(condition number {number:.3g}): the driven coordinates do not determine it there"
        )
    return number
