"""Continuation along a coarse set of a trajectory's samples, and the guesses between them."""

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Indices
from ..errors import ClosureError
from ..motion import Samples
from .loopsystem import LoopSystem

COARSE_STEP = 0.1
"""Travel of the driven coordinates between two steps of continuation [rad, or lengths of the mechanism]."""
_BISECTIONS = 25
_SINGULAR_CROSSING = 1e-6
"""Smallest singular value, relative to the largest, that counts as zero after so many bisections."""


@dataclass(frozen=True)
class Coarse:
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
    def closed(cls, system: LoopSystem, home: Floats, samples: Samples) -> "Coarse":
        """Close coarse samples one after the other, the first from the closed configuration ``home`` (nv,).

        Raises ClosureError, naming the time, where that is not possible or a singular position is passed.
        """
        nodes = _nodes(samples.position, COARSE_STEP * system.drive.scale(system.length))
        targets = np.concatenate([system.drive.value(system.mechanism, home)[None], samples.position[nodes]])
        q, side, solved, rates = home, system.side(home), [], []
        for previous, target, node in zip(targets, targets[1:], nodes, strict=False):
            before, q = q, system.march(q, previous, target, float(samples.time[node]))
            if system.side(q) != side:
                _refuse_singular_between(system, before, previous, target, float(samples.time[node]))
                side = system.side(q)
            solved.append(q)
            rates.append(system.rates_at(q, float(samples.time[node])))
        return cls(nodes, samples.position[nodes], np.array(solved), np.array(rates))

    def guess(self, u: Floats, part: slice) -> Floats:
        """Configurations at samples ``part`` whose driven coordinates are ``u`` (n, dof), to third order, (nv, n).

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
