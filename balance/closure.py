"""Loop-consistent positions, velocities and accelerations of a mechanism along a motion.

Newton's method on loops and driven coordinates together. A trajectory is first closed by continuation on a coarse set
of its samples, starting from the mechanism's home configuration, then everywhere at once from guesses of third order
between them: that keeps every sample on the home configuration's assembly branch. Loops of planar and parallelogram
mechanisms are redundant; a fixed set of independent rows is solved, all rows are checked.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from . import constraints, kinematics
from .arrays import Floats, Indices
from .drive import Drive
from .errors import ClosureError
from .kinematics import Pose
from .mechanism import Mechanism
from .motion import Samples

BLOCK = 2048
"""Samples worked on at once: what stays in the processor's cache."""
COARSE_STEP = 0.1
"""Travel of the driven coordinates between two steps of continuation [rad, or lengths of the mechanism]."""
RESIDUAL_LIMIT = 1e-10
"""Largest loop residual that counts as closed, relative to the mechanism's length."""
SINGULAR_LIMIT = 1e9
"""Condition number of loops and driven coordinates above which a state counts as singular."""
BRANCH_LIMIT = 0.1
"""How far a configuration may lie from its guess between coarse samples [rad, m]."""
RANK_LIMIT = 1e-9
"""Size of a constraint row, relative to the largest, below which it counts as redundant."""
_ITERATIONS = 30


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


class Closure:
    """Closes a mechanism's loops; knows its degrees of freedom and independent constraint rows."""

    def __init__(self, mechanism: Mechanism) -> None:
        """Close the home configuration. Raises ClosureError if that cannot be done."""
        self.mechanism = mechanism
        self.length = _length(mechanism)
        self.home = self._closed(mechanism.home)
        at = kinematics.pose(mechanism.tree, self.home[:, None])
        rows = constraints.jacobian(mechanism.loops, mechanism.tree, at)[:, :, 0]
        self.rows = independent_rows(rows)
        self.dof = mechanism.tree.size - len(self.rows)

    def follow(self, samples: Samples, drive: Drive | None = None) -> Trajectory:
        """Close the mechanism at every sample of a motion of its driven coordinates.

        Raises ClosureError, naming the time, where it cannot be closed, is singular, or leaves its branch.
        """
        drive = drive or samples.drive(self.mechanism)
        if drive.size != self.dof:
            raise ClosureError(
                f"{self.mechanism.name} has {self.dof} degree{'s' * (self.dof != 1)} of freedom, but the motion "
                f"drives {drive.size}: {', '.join(drive.names)}"
            )
        system = _System(self, drive)
        nodes, q_nodes, rates = self._continuation(system, samples)
        return _assemble(system, samples, nodes, q_nodes, rates)

    def states(self, count: int, seed: int = 0, step: float = 0.15) -> Floats:
        """Closed configurations of the home branch, well apart from singular ones, (count, nv) [rad, m].

        A walk over the loops that keeps its heading: tangent steps, each projected back, refused near a singularity.
        """
        rng = np.random.default_rng(seed)
        reach = self._room(self.home)
        q, found, heading = self.home, [self.home], np.zeros_like(self.home)
        for _ in range(40 * count):
            if len(found) == count:
                return np.array(found)
            tangent = _null_space(self._jacobian(q)[self.rows])
            heading = tangent @ (tangent.T @ heading + 0.5 * rng.normal(size=tangent.shape[1]))
            heading /= max(float(np.linalg.norm(heading)), 1e-12)
            trial = self._walked(q, step * heading)
            if trial is None or self._room(trial) < 0.2 * reach:
                heading = -heading
                continue
            q = trial
            found.append(q)
        raise ClosureError(f"{self.mechanism.name} has no room to move about {self.mechanism.branch!r}")

    def _walked(self, q: Floats, step: Floats) -> Floats | None:
        try:
            trial = self._closed(q + step)
        except ClosureError:
            return None
        return trial if np.linalg.norm(trial - q) < 2 * np.linalg.norm(step) else None

    def velocities(self, q: Floats, seed: int = 0) -> Floats:
        """Random velocities that the loops allow at closed configurations ``q``, (n, nv) [rad/s, m/s]."""
        rng = np.random.default_rng(seed)
        spaces = [_null_space(self._jacobian(state)[self.rows]) for state in q]
        return np.array([space @ rng.normal(size=space.shape[1]) for space in spaces])

    def residual(self, q: Floats) -> Floats:
        """Largest loop residual, all rows, at each of the configurations ``q`` (n, nv), (n,) [m, rad]."""
        at = kinematics.pose(self.mechanism.tree, np.ascontiguousarray(q.T))
        return np.abs(constraints.residual(self.mechanism.loops, at)).max(axis=0, initial=0.0)

    def _jacobian(self, q: Floats) -> Floats:
        at = kinematics.pose(self.mechanism.tree, q[:, None])
        return constraints.jacobian(self.mechanism.loops, self.mechanism.tree, at)[:, :, 0]

    def _room(self, q: Floats) -> float:
        """Smallest singular value of the independent rows: the distance to a singular configuration."""
        rows = self._jacobian(q)[self.rows]
        return float(np.linalg.svd(rows, compute_uv=False)[-1]) if len(rows) else np.inf

    def _closed(self, q: Floats) -> Floats:
        """Nearest closed configuration by Gauss-Newton steps of least norm, safe for redundant rows."""
        for _ in range(_ITERATIONS):
            at = kinematics.pose(self.mechanism.tree, q[:, None])
            gap = constraints.residual(self.mechanism.loops, at)[:, 0]
            if np.abs(gap).max(initial=0.0) < 1e-15 * self.length:
                return q
            change = np.linalg.lstsq(self._jacobian(q), gap, rcond=RANK_LIMIT)[0]
            q = q - change
            if np.abs(change).max() < 1e-14 and np.abs(gap).max() < RESIDUAL_LIMIT * self.length:
                return q
        raise ClosureError(
            f"{self.mechanism.name} cannot be closed from {self.mechanism.branch!r}: the loops "
            f"({', '.join(loop.name for loop in self.mechanism.loops)}) stay {np.abs(gap).max():.3g} m apart"
        )

    def _continuation(self, system: "_System", samples: Samples) -> tuple[Indices, Floats, Floats]:
        """Coarse samples, their closed configurations (k, nv) and rates per drive (k, nv, dof)."""
        start = system.drive.value(self.mechanism, self.home)
        nodes = _nodes(samples.position, COARSE_STEP * system.drive.scale(self.length))
        targets = np.concatenate([start[None], samples.position[nodes]])
        q, solved, rates = self.home, [], []
        for previous, target, node in zip(targets, targets[1:], nodes, strict=False):
            q = system.march(q, previous, target, float(samples.time[node]))
            solved.append(q)
            rates.append(system.linearise(q[:, None])[1][0])
        return nodes, np.array(solved), np.array(rates)


@dataclass(frozen=True)
class _System:
    """Loops and driven coordinates as one square system of equations."""

    closure: Closure
    drive: Drive

    def evaluate(self, q: Floats, target: Floats) -> tuple[Pose, Floats, Floats]:
        """Pose, residual of the loops (rows, n) and of the driven coordinates (dof, n)."""
        mechanism = self.closure.mechanism
        at = kinematics.pose(mechanism.tree, q)
        return at, constraints.residual(mechanism.loops, at), self.drive.position(at, q) - target

    def matrix(self, at: Pose, q: Floats) -> Floats:
        """Jacobian of independent loop rows and driven coordinates, (n, nv, nv)."""
        mechanism = self.closure.mechanism
        loops = constraints.jacobian(mechanism.loops, mechanism.tree, at)[self.closure.rows]
        rows = np.concatenate([loops, self.drive.jacobian(mechanism.tree, at)])
        return np.ascontiguousarray(np.broadcast_to(rows, (*rows.shape[:2], q.shape[1])).transpose(2, 0, 1))

    def linearise(self, q: Floats) -> tuple[Floats, Floats]:
        """Inverse of the matrix (n, nv, nv), and its columns that belong to the drive (n, nv, dof)."""
        at = kinematics.pose(self.closure.mechanism.tree, q)
        inverse = np.linalg.inv(self.matrix(at, q))
        return inverse, inverse[:, :, -self.drive.size :]

    def newton(self, q: Floats, target: Floats) -> Floats:
        """Iterate to rounding error on all samples at once; what does not converge is left for the check."""
        limit = 1e-14 * self.closure.length
        for _ in range(_ITERATIONS):
            at, loops, driven = self.evaluate(q, target)
            residual = np.concatenate([loops[self.closure.rows], driven])
            size = np.abs(residual).max()
            if not size > limit:
                break
            change = np.linalg.solve(self.matrix(at, q), residual.T[:, :, None])[:, :, 0].T
            q = q - change
            if size < 1e-7 * self.closure.length:
                break  # quadratic convergence: the next residual is below rounding
        return q

    def march(self, q: Floats, start: Floats, target: Floats, time: float) -> Floats:
        """Continuation of one configuration from one driven position to another, in steps halved as needed."""
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
        if not gap < RESIDUAL_LIMIT * self.closure.length or np.abs(trial - q).max() > self._reach():
            return None
        return trial

    def _reach(self) -> float:
        return 0.5 * max(1.0, self.closure.length)

    def _stuck(self, reached: Floats, target: Floats, time: float) -> ClosureError:
        at = ", ".join(f"{name} = {value:.6g}" for name, value in zip(self.drive.names, target, strict=True))
        got = ", ".join(f"{value:.6g}" for value in reached)
        return ClosureError(
            f"{self.closure.mechanism.name} cannot be closed at {at} (t = {time:.6g} s): it gets as far as {got} on "
            f"the branch of {self.closure.mechanism.branch!r}; the position is out of reach or singular"
        )


def independent_rows(matrix: Floats) -> Indices:
    """Indices of a largest set of independent rows, found by pivoted QR."""
    if not matrix.size:
        return np.empty(0, dtype=np.intp)
    _, triangle, order = qr(matrix.T, mode="economic", pivoting=True)
    size = np.abs(np.diag(triangle))
    return np.sort(order[: int((size > RANK_LIMIT * size[0]).sum())])


def _null_space(rows: Floats) -> Floats:
    """Orthonormal directions that the rows allow, (nv, dof); the rows are independent."""
    if not len(rows):
        return np.eye(rows.shape[1])
    return np.linalg.svd(rows)[2][len(rows) :].T


def _length(mechanism: Mechanism) -> float:
    """A length of the mechanism: the largest distance within a body, between joints, sites and centres [m]."""
    steps = [np.linalg.norm(joint.position) for joint in mechanism.tree.joints]
    steps += [np.linalg.norm(site.position) for site in mechanism.sites.values()]
    return float(max(steps, default=0.0)) or 1.0


def _nodes(position: Floats, step: float) -> Indices:
    """Indices of samples at most about ``step`` of travel apart, the first and the last among them."""
    travel = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    marks = np.arange(0.0, travel[-1] + step, step)
    nodes = np.searchsorted(travel, marks).clip(max=len(position) - 1)
    return np.unique(np.concatenate([nodes, [0, len(position) - 1]]))


def _assemble(system: _System, samples: Samples, nodes: Indices, q_nodes: Floats, rates: Floats) -> Trajectory:
    count, size, dof = len(samples.time), system.closure.mechanism.tree.size, system.drive.size
    q, v, a = np.empty((3, count, size))
    per_drive = np.empty((count, size, dof))
    worst, condition = 0.0, 1.0
    for start in range(0, count, BLOCK):
        part = slice(start, start + BLOCK)
        guess = _guess(samples.position[part], np.arange(count)[part], nodes, q_nodes, rates, samples.position[nodes])
        solved = _solve_block(system, samples, part, guess)
        q[part], v[part], a[part], per_drive[part] = solved[:4]
        worst, condition = max(worst, solved[4]), max(condition, solved[5])
    name, branch = system.closure.mechanism.name, system.closure.mechanism.branch
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
    system: _System, samples: Samples, part: slice, guess: Floats
) -> tuple[Floats, Floats, Floats, Floats, float, float]:
    mechanism = system.closure.mechanism
    target, rate, rate_of_rate = (x[part].T for x in (samples.position, samples.velocity, samples.acceleration))
    try:
        q = system.newton(guess, target)
        at, loops, driven = system.evaluate(q, target)
        matrix = system.matrix(at, q)
        inverse = np.linalg.inv(matrix)
    except np.linalg.LinAlgError as error:
        time = samples.time[part]
        raise ClosureError(
            f"{mechanism.name} is singular between t = {time[0]:.6g} s and {time[-1]:.6g} s of this motion"
        ) from error
    worst = _checked(system, samples, part, loops, driven)
    _same_branch(system, samples, part, q - guess)
    condition = _condition(system, samples, part, matrix, inverse)
    per_drive = inverse[:, :, -system.drive.size :]
    v = np.einsum("nij,jn->in", per_drive, rate)
    still = kinematics.motion(mechanism.tree, at, v, np.zeros_like(v))
    bias = constraints.bias(mechanism.loops, at, still)[system.closure.rows]
    demand = np.concatenate([-bias, rate_of_rate - system.drive.bias(at, still)])
    a = np.einsum("nij,jn->in", inverse, demand)
    return q.T, v.T, a.T, per_drive, worst, condition


def _checked(system: _System, samples: Samples, part: slice, loops: Floats, driven: Floats) -> float:
    """Largest residual over all rows, the redundant ones too. Raises ClosureError where one stays open."""
    gap = np.maximum(np.abs(loops).max(axis=0, initial=0.0), np.abs(driven).max(axis=0, initial=0.0))
    worst = float(np.max(gap))
    if not worst < RESIDUAL_LIMIT * system.closure.length:
        k = int(np.argmax(~(gap < RESIDUAL_LIMIT * system.closure.length)))
        raise ClosureError(
            f"{system.closure.mechanism.name} cannot be closed at t = {samples.time[part][k]:.6g} s: "
            f"{gap[k]:.3g} m stays open"
        )
    return worst


def _same_branch(system: _System, samples: Samples, part: slice, moved: Floats) -> None:
    """Raise ClosureError where Newton's method went far from its guess: another branch, or a singularity near by."""
    far = np.abs(moved).max(axis=0)
    if not far.max() < BRANCH_LIMIT * max(1.0, system.closure.length):
        raise ClosureError(
            f"{system.closure.mechanism.name} leaves the branch of {system.closure.mechanism.branch!r} at "
            f"t = {samples.time[part][int(np.argmax(far))]:.6g} s: a singular position is near"
        )


def _condition(system: _System, samples: Samples, part: slice, matrix: Floats, inverse: Floats) -> float:
    """Largest condition number (Frobenius). Raises ClosureError where a state is singular."""
    number = np.linalg.norm(matrix, axis=(1, 2)) * np.linalg.norm(inverse, axis=(1, 2))
    worst = int(np.argmax(number))
    if not number[worst] < SINGULAR_LIMIT:
        raise ClosureError(
            f"{system.closure.mechanism.name} is singular at t = {samples.time[part][worst]:.6g} s of this motion "
            f"(condition number {number[worst]:.3g}): the driven coordinates do not determine it there"
        )
    return float(number[worst])
