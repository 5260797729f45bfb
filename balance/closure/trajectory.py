"""A whole trajectory closed at once, on the assembly branch of the home configuration.

Continuation from home closes a coarse set of its samples. All samples are then solved by Newton's method from guesses
of third order between the coarse ones, which keeps each on the branch; rates and accelerations follow from the factors.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..arrays import Floats, Indices, parallel_blocks
from ..errors import ClosureError, ModelError
from ..mechanism.pinocchio_engine import AGREEMENT
from ..motion import Samples
from ..results import Brief
from .newton import RESIDUAL_LIMIT, SINGULAR_LIMIT, LoopProgram, LoopSystem, Order

COARSE_STEP = 0.1
"""Travel of the driven coordinates between two steps of continuation [rad, or lengths of the mechanism]."""


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
    def closed(cls, system: LoopSystem, samples: Samples) -> "Continuation":
        """Close coarse samples one after the other, the first from home.

        Between two of them that have others in between one step of continuation suffices, which keeps all of these on
        the branch. Raises ClosureError, naming the time, where that is not possible or a singular position is met.
        """
        u, last = samples.position / system.row_scales[-system.drive.size :], len(samples.time) - 1
        travel = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(u, axis=0), axis=1))]
        marks = np.searchsorted(travel, np.arange(0.0, travel[-1] + COARSE_STEP, COARSE_STEP)).clip(max=last)
        marks = np.unique([*marks, 0, last])
        between = [(i, u[i : j + 1]) for i, j in pairwise(marks)]  # where it may turn back: farthest from either end
        turns = [i + np.linalg.norm(at - at[k], axis=1).argmax() for i, at in between for k in (0, -1)]
        ahead, q = np.unique([*marks, *turns])[::-1].tolist(), system.home
        nodes, found = list[int](), list[Floats]()
        while ahead:
            end, target = ahead[-1], samples.position[ahead[-1]]
            near = system.step(q, target)
            if near is None and nodes and end - nodes[-1] > 1:
                ahead.append((nodes[-1] + end) // 2)
                continue
            q = system.continue_to(q, target, float(samples.time[end])) if near is None else near
            nodes.append(ahead.pop())
            found.append(q)
        rates = np.array([system.rates_per_drive(q) for q in found])
        return cls(np.array(nodes), samples.position[nodes], np.array(found), rates)

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


POOR_LIMIT = 1e4
"""Growth of elimination above which a block of samples is halved: its order of pivots is poor for some of it."""
BRANCH_LIMIT = 0.1
"""How far a configuration may lie from its guess [rad, lengths of the mechanism]."""


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
    samples: Samples | None = None
    """The motion of the driven coordinates that it follows; None where none is known."""

    def is_closed(self, tol: float = RESIDUAL_LIMIT) -> bool:
        """Whether no residual exceeds ``tol`` [m, rad]."""
        return self.residual <= tol


def follow(system: LoopSystem, samples: Samples, near: Trajectory | None = None) -> Trajectory:
    """Close the mechanism at every sample, on the branch of home or of ``near``.

    Raises ClosureError, naming the time, where it cannot be closed, is singular, or changes its branch.
    """
    found = _Following(system, samples)
    if near is None:
        coarse = Continuation.closed(system, samples)
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
        gap, worst = self.gap[0, part], int(np.argmax(growth))
        far = np.abs((q - guess) / self.system.scales[:, None]).max(axis=0)
        if not gap.max() < RESIDUAL_LIMIT * length:  # of the redundant rows too
            k = int(np.argmax(~(gap < RESIDUAL_LIMIT * length)))
            raise ClosureError(f"{name} cannot be closed at t = {time[k]:.6g} s: {gap[k]:.3g} m stays open")
        if not far.max() < BRANCH_LIMIT:
            k = int(np.argmax(far))
            raise ClosureError(
                f"{name} leaves the branch of {self.system.mechanism.branch!r} at t = {time[k]:.6g} s: it lies "
                f"{far[k]:.2g} rad or lengths off its neighbours; {self.system.singularity(q[:, k])}"
            )
        condition = self.system.condition(q[:, worst])
        if not condition < SINGULAR_LIMIT:
            raise ClosureError(
                f"{name} is singular at t = {time[worst]:.6g} s of this motion: {self.system.singularity(q[:, worst])}"
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
