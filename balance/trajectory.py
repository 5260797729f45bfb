"""A whole trajectory closed at once.

It is first closed by continuation on a coarse set of its samples, starting from the home configuration, then everywhere
at once from guesses of third order between them: that keeps every sample on the home configuration's assembly branch.
"""

from dataclasses import dataclass

import numpy as np

from . import constraints, kinematics
from .arrays import Floats, Indices
from .errors import ClosureError
from .loopsystem import RESIDUAL_LIMIT, LoopSystem, inverse_of
from .motion import Samples

BLOCK = 4096
"""Samples worked on at once: what stays in the processor's cache."""
COARSE_STEP = 0.1
"""Travel of the driven coordinates between two steps of continuation [rad, or lengths of the mechanism]."""
SINGULAR_LIMIT = 1e6
"""Condition number of loops and driven coordinates above which a state counts as singular: rates lose as many of their
16 digits as it has, accelerations twice as many."""
POOR_LIMIT = 1e4
"""Condition number above which the rows that were left out are taken in: those chosen at home may serve badly here."""
_BISECTIONS = 25
_SINGULAR_CROSSING = 1e-6
"""Smallest singular value, relative to the largest, that counts as zero after so many bisections."""
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


def _nodes(position: Floats, step: float) -> Indices:
    """Indices of samples at most about ``step`` of travel apart, the first and the last among them."""
    travel = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    marks = np.arange(0.0, travel[-1] + step, step)
    nodes = np.searchsorted(travel, marks).clip(max=len(position) - 1)
    return np.unique(np.concatenate([nodes, [0, len(position) - 1]]))


def follow(system: LoopSystem, home: Floats, samples: Samples) -> Trajectory:
    """Close the mechanism at every sample, on the branch of the closed configuration ``home`` (nv,).

    Raises ClosureError, naming the time, where it cannot be closed, is singular, or leaves its branch.
    """
    nodes, q_nodes, rates = _continuation(system, home, samples)
    count, size, dof = len(samples.time), system.mechanism.tree.size, system.drive.size
    q, v, a = np.empty((3, count, size))
    per_drive = np.empty((count, size, dof))
    worst, condition = 0.0, 1.0
    for start in range(0, count, BLOCK):
        part = slice(start, start + BLOCK)
        guess = _guess(samples.position[part], np.arange(count)[part], nodes, q_nodes, rates, samples.position[nodes])
        solved = _solve_block(system, samples, part, guess)
        q[part], v[part], a[part], per_drive[part] = solved[:4]
        worst, condition = max(worst, solved[4]), max(condition, solved[5])
    name, branch = system.mechanism.name, system.mechanism.branch
    return Trajectory(name, samples.time, q, v, a, per_drive, worst, condition, branch)


def _guess(u: Floats, index: Indices, nodes: Indices, q: Floats, rates: Floats, u_nodes: Floats) -> Floats:
    """Configurations between coarse samples, to third order, (nv, n).

    The mean of the chord and of the two tangents: their errors, +h2 t (1 - t) / 2 of the second derivative, cancel.
    """
    if len(nodes) == 1:
        return np.ascontiguousarray((q[0] + (u - u_nodes[0]) @ rates[0].T).T)
    left = np.searchsorted(nodes, index, side="right").clip(1, len(nodes) - 1) - 1
    right = left + 1
    chord = u_nodes[right] - u_nodes[left]
    squared = np.maximum((chord**2).sum(axis=1), 1e-300)
    t = (((u - u_nodes[left]) * chord).sum(axis=1) / squared).clip(0.0, 1.0)[:, None]
    off = u - (1 - t) * u_nodes[left] - t * u_nodes[right]
    middle = 0.5 * (rates[left] + rates[right])
    straight = (1 - t) * q[left] + t * q[right] + np.einsum("nij,nj->ni", middle, off)
    from_left = q[left] + np.einsum("nij,nj->ni", rates[left], u - u_nodes[left])
    from_right = q[right] + np.einsum("nij,nj->ni", rates[right], u - u_nodes[right])
    return np.ascontiguousarray((0.5 * straight + 0.5 * ((1 - t) * from_left + t * from_right)).T)


def _solve_block(
    system: LoopSystem, samples: Samples, part: slice, guess: Floats
) -> tuple[Floats, Floats, Floats, Floats, float, float]:
    mechanism = system.mechanism
    target, rate, rate_of_rate = (x[part].T for x in (samples.position, samples.velocity, samples.acceleration))
    try:
        q = system.newton(guess, target)
        at, loops, driven = system.evaluate(q, target)
        matrix = system.matrix(at, q)
        inverse = inverse_of(matrix)
    except np.linalg.LinAlgError as error:
        if system.redundant:
            return _solve_block(system.with_all_rows(), samples, part, guess)
        time = samples.time[part]
        raise ClosureError(
            f"{mechanism.name} is singular between t = {time[0]:.6g} s and {time[-1]:.6g} s of this motion"
        ) from error
    number = np.linalg.norm(matrix, axis=(1, 2)) * np.linalg.norm(inverse, axis=(1, 2))
    if system.redundant and not number.max() < POOR_LIMIT:
        return _solve_block(system.with_all_rows(), samples, part, guess)
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


def _continuation(system: LoopSystem, home: Floats, samples: Samples) -> tuple[Indices, Floats, Floats]:
    """Coarse samples, their closed configurations (k, nv) and rates per drive (k, nv, dof)."""
    start = system.drive.value(system.mechanism, home)
    nodes = _nodes(samples.position, COARSE_STEP * system.drive.scale(system.length))
    targets = np.concatenate([start[None], samples.position[nodes]])
    q, side, solved, rates = home, system.side(home), [], []
    for previous, target, node in zip(targets, targets[1:], nodes, strict=False):
        before, q = q, system.march(q, previous, target, float(samples.time[node]))
        if system.side(q) != side:
            _refuse_singular_between(system, before, previous, target, float(samples.time[node]))
            side = system.side(q)
        solved.append(q)
        try:
            rates.append(system.linearise(q[:, None])[1][0])
        except np.linalg.LinAlgError as error:
            raise ClosureError(
                f"{system.mechanism.name} is singular at t = {samples.time[node]:.6g} s of this motion: "
                f"{', '.join(system.drive.names)} do not determine it there"
            ) from error
    return nodes, np.array(solved), np.array(rates)


def _refuse_singular_between(system: LoopSystem, q: Floats, start: Floats, end: Floats, time: float) -> None:
    """Raise ClosureError if the mechanism is singular between two driven positions: branches may meet there.

    The determinant changed its sign. Where rows are left out it may be these alone that depended on each other, so
    the place is sought by bisection and judged by all rows.
    """
    whole, side = system.with_all_rows() if system.redundant else system, system.side(q)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (start + end)
        trial = whole.march(q, start, middle, time)
        if system.side(trial) == side:
            q, start = trial, middle
        else:
            end = middle
    sizes = np.linalg.svd(whole.matrix_at(q), compute_uv=False)
    if sizes[-1] < _SINGULAR_CROSSING * sizes[0]:
        at = ", ".join(f"{name} = {value:.6g}" for name, value in zip(system.drive.names, start, strict=True))
        raise ClosureError(
            f"{system.mechanism.name} passes a singular position at {at}, shortly before t = {time:.6g} s: the driven "
            "coordinates do not say on which branch it goes on"
        )
