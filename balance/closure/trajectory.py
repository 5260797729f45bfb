"""A whole trajectory closed at once, on the assembly branch of the home configuration.

Continuation from home closes a coarse set of its samples. All samples are then solved by Newton's method from guesses
of third order between the coarse ones, which keeps each on the branch; rates and accelerations follow from the factors.
"""

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Indices, parallel_blocks
from ..errors import ClosureError, ModelError
from ..mechanism.pinocchio_engine import AGREEMENT
from ..motion import Samples
from ..results import Brief
from .newton import RESIDUAL_LIMIT, LoopProgram, LoopSystem, Order

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
        step, last = COARSE_STEP * system.drive.scale(system.length), len(samples.time) - 1
        travel = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(samples.position, axis=0), axis=1))]
        marks = np.searchsorted(travel, np.arange(0.0, travel[-1] + step, step)).clip(max=last)
        nodes = np.unique([*marks, 0, last])
        targets = np.concatenate([system.drive.value(system.engine, home)[None], samples.position[nodes]])
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
        rates, last = self.rates, len(self.nodes) - 1
        before = np.searchsorted(self.nodes, np.arange(part.start, part.stop), side="right") - 1
        left = before.clip(0, max(last - 1, 0))  # the same one twice where there is only one
        right = np.minimum(left + 1, last)
        chord = self.u[right] - self.u[left]
        squared = np.maximum((chord**2).sum(axis=1), 1e-300)
        t = (((u - self.u[left]) * chord).sum(axis=1) / squared).clip(0.0, 1.0)[:, None]
        off = u - (1 - t) * self.u[left] - t * self.u[right]
        middle = 0.5 * (rates[left] + rates[right])
        straight = (1 - t) * self.q[left] + t * self.q[right] + np.einsum("nij,nj->ni", middle, off)
        from_left = self.q[left] + np.einsum("nij,nj->ni", rates[left], u - self.u[left])
        from_right = self.q[right] + np.einsum("nij,nj->ni", rates[right], u - self.u[right])
        return np.ascontiguousarray((0.5 * straight + 0.5 * ((1 - t) * from_left + t * from_right)).T)


def _refuse_singular_between(system: LoopSystem, q: Floats, start: Floats, end: Floats, time: float) -> None:
    """Raise ClosureError if the mechanism is singular between two driven positions: branches may meet there.

    The determinant changed its sign. Among redundant rows it may be only the chosen ones that depend on each other, so
    bisection finds the place, and all rows decide.
    """
    side = system.determinant_sign(q)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (start + end)
        trial = system.continue_to(q, start, middle, time)
        if system.determinant_sign(trial) == side:
            q, start = trial, middle
        else:
            end = middle
    sizes = np.linalg.svd(system.all_rows(q), compute_uv=False)
    if sizes[-1] < _SINGULAR_CROSSING * sizes[0]:
        at = ", ".join(f"{name} = {value:.6g}" for name, value in zip(system.drive.names, start, strict=True))
        raise ClosureError(
            f"{system.mechanism.name} passes a singular position at {at}, shortly before t = {time:.6g} s: the driven "
            "coordinates do not determine on which branch it continues; begin elsewhere (a keyframe "
            "'home'; of a URDF home in its YAML file), or drive the joints"
        )


SINGULAR_LIMIT = 1e6
"""Condition number of loops and driven coordinates above which a state counts as singular: rates lose as many of their
16 digits as it has, accelerations twice as many."""
POOR_LIMIT = 1e4
"""Growth of elimination above which a block of samples is halved: its order of pivots is poor for some of it."""
BRANCH_LIMIT = 0.1
"""How far a configuration may lie from its guess between coarse samples [rad, m]."""


@dataclass(frozen=True)
class Trajectory(Brief):
    """Loop-consistent motion of all coordinates.

    >>> import balance
    >>> trajectory = balance.follow("four-bar", "four-bar", rate="1 kHz")
    >>> trajectory.q.shape == trajectory.a.shape
    True
    """

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
    idle: tuple[str, ...] = ()
    """Coordinates of idle freedoms, which nothing drives: they stay as at home (``Closure.idle``)."""
    coarse: tuple[str, ...] = ()
    """What is said of samples of a file whose acceleration is that of rounding or noise."""

    def is_closed(self, tol: float = RESIDUAL_LIMIT) -> bool:
        """Whether no residual exceeds ``tol`` [m, rad]."""
        return self.residual <= tol


def follow(system: LoopSystem, home: Floats, samples: Samples, near: Trajectory | None = None) -> Trajectory:
    """Close the mechanism at every sample, on the branch of the configuration ``home`` (nv,) [rad, m] or of ``near``.

    Raises ClosureError, naming the time, where it cannot be closed, is singular, or changes its branch.
    """
    found = _Following(system, samples)
    if near is None:
        coarse = Continuation.closed(system, home, samples)
        order = found.program.order(coarse.q.T)

        def close(part: slice) -> float:
            return found.close(part, coarse.guess(samples.position[part], part), order)

    else:
        closed, order = near.q, found.program.order(near.q.T)

        def close(part: slice) -> float:
            return found.close(part, np.ascontiguousarray(closed[part].T), order)

    condition = max(parallel_blocks(len(samples.time), close))
    found.refuse_other_than_pinocchio()
    per_drive = found.per_drive.reshape(system.drive.size, -1, len(samples.time)).transpose(2, 1, 0)
    worst, mechanism = float(found.gap.max(initial=0.0)), system.mechanism
    return Trajectory(
        mechanism.name, samples.time, found.q.T, found.v.T, found.a.T, per_drive, worst, condition, mechanism.branch
    )


class _Following:
    """Samples being closed, block by block; rows are coordinates, columns samples."""

    def __init__(self, system: LoopSystem, samples: Samples) -> None:
        mechanism, dof = system.mechanism, system.drive.size
        self.system, self.samples = system, samples
        self.program = LoopProgram(mechanism.tree, mechanism.loops, system.drive)
        self.driven = [np.ascontiguousarray(x.T) for x in (samples.position, samples.velocity, samples.acceleration)]
        count, size = len(samples.time), mechanism.tree.size
        self.q, self.v, self.a = np.empty((3, size, count))
        self.per_drive = np.empty((dof * size, count))
        self.gap, self.inverse_pivot = np.empty((2, 1, count))

    def close(self, part: slice, guess: Floats, order: Order, chosen_here: bool = False) -> float:
        """Close a block of samples, and return its condition number where elimination did worst.

        Where the order of pivots is poor for some samples, it is chosen anew for these, then the block is halved.
        """
        length, name, time = self.system.length, self.system.mechanism.name, self.samples.time[part]
        driven = [x[:, part] for x in self.driven]
        with np.errstate(all="ignore"):  # a pivot may vanish: the checks below find the infinite values
            q = self.program.closed(guess, driven[0], order)
            out = [x[:, part] for x in (self.v, self.a, self.per_drive, self.gap, self.inverse_pivot)]
            self.program.rates(order).run([q, *driven], out)
        self.q[:, part] = q
        growth = self.inverse_pivot[0, part] * max(1.0, length)
        if not growth.max() < POOR_LIMIT and not chosen_here:
            return self.close(part, guess, self.program.order(guess), True)
        if not growth.max() < POOR_LIMIT and q.shape[1] > 1:
            middle = (part.start + part.stop) // 2
            halves = map(np.ascontiguousarray, np.split(guess, [middle - part.start], axis=1))
            parts = (slice(part.start, middle), slice(middle, part.stop))
            return max(
                self.close(half, its, self.program.order(its), True) for half, its in zip(parts, halves, strict=True)
            )
        gap, far, worst = self.gap[0, part], np.abs(q - guess).max(axis=0), int(np.argmax(growth))
        if not gap.max() < RESIDUAL_LIMIT * length:  # of the redundant rows too
            k = int(np.argmax(~(gap < RESIDUAL_LIMIT * length)))
            raise ClosureError(f"{name} cannot be closed at t = {time[k]:.6g} s: {gap[k]:.3g} m stays open")
        if not far.max() < BRANCH_LIMIT * max(1.0, length):
            raise ClosureError(
                f"{name} leaves the branch of {self.system.mechanism.branch!r} at t = {time[int(np.argmax(far))]:.6g} "
                "s: a singular position is near"
            )
        size = np.linalg.svd(self.system.all_rows(q[:, worst]), compute_uv=False)
        condition = float(size[0] / max(float(size[-1]), 1e-300))
        if not condition < SINGULAR_LIMIT:
            raise ClosureError(
                f"{name} is singular at t = {time[worst]:.6g} s of this motion (condition number {condition:.3g}): the "
                "driven coordinates do not determine it there"
            )
        return condition

    def refuse_other_than_pinocchio(self) -> None:
        """Raise ModelError where Pinocchio finds loops open, or rates that open them, that were closed here."""
        for k in np.unique(np.linspace(0, len(self.samples.time) - 1, 5).astype(int)):
            q, v = self.q[:, k], self.v[:, k]
            gap = np.abs(self.system.gaps(q, self.samples.position[k])).max()
            matrix = self.system.all_rows(q)
            rate = np.abs(matrix @ v - np.r_[np.zeros(len(matrix) - len(self.driven[1])), self.driven[1][:, k]])
            if not (gap < RESIDUAL_LIMIT * self.system.length and rate.max() <= AGREEMENT * max(1.0, np.abs(v).max())):
                raise ModelError(
                    f"{self.system.mechanism.name}: at t = {self.samples.time[k]:.6g} s Pinocchio finds the loops "
                    f"{gap:.3g} m or rad open where they were closed to {self.gap.max():.3g}: the two engines differ, "
                    "so no answer is given; please report the file"
                )
