"""Springs with play and feet on the floor, stepped from sample to sample; compiled where numba is installed.

It imports numba, and is imported only where there is something to step.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.compiled_kernels import compiled_by
from balance.dynamics.moving_base import propagator, times

try:
    from numba import njit
except ImportError:  # without the extra ``compiled``: the same, twenty times slower
    njit = None


@compiled_by(njit, "void(f8[::1], f8[::1], f8[::1], i8, f8, f8[::1], b1, f8[::1])")
def released(
    seen: NDArray[Any], play: NDArray[Any], preload: NDArray[Any], upright: int, friction: float,
    relieved: NDArray[Any], keeps: bool, out: NDArray[Any],
) -> None:  # fmt: skip
    """What springs and feet carry otherwise than without play and bonded to the floor, ``out`` (2 s + 3 f,).

    ``seen`` has two deflections of each spring [rad, m]: of these it lacks what lies within a radius ``play`` (s,).
    Then the force on each bonded foot (f, 3) [N]. A foot presses with ``preload`` (f,) [N] and that force along
    ``upright`` or not at all; across, it is dragged by no more than ``friction`` times this. ``relieved`` (3 f,) [N] is
    what its sliding so far took off; ``keeps`` says whether it slides on now.
    """
    for s in range(len(play)):
        x, y = seen[2 * s], seen[2 * s + 1]
        far = (x * x + y * y) ** 0.5
        share = play[s] / far if far > play[s] else 1.0
        out[2 * s], out[2 * s + 1] = share * x, share * y
    for foot in range(len(preload)):
        at = 2 * len(play) + 3 * foot
        pressure, dragged = max(preload[foot] + seen[at + upright], 0.0), 0.0
        for k in range(3):
            if k != upright:
                dragged += (seen[at + k] + relieved[3 * foot + k]) ** 2
        dragged = dragged**0.5
        share = friction * pressure / dragged if dragged > friction * pressure else 1.0
        for k in range(3):
            if k == upright:
                out[at + k] = pressure - preload[foot] - seen[at + k]
            else:
                out[at + k] = share * (seen[at + k] + relieved[3 * foot + k]) - seen[at + k]
                if keeps:
                    relieved[3 * foot + k] = out[at + k]


def _by_entries(total: NDArray[Any], columns: NDArray[Any], x: NDArray[Any]) -> None:
    for j in range(len(x)):
        for i in range(len(total)):
            total[i] += columns[j, i] * x[j]


def _at_once(total: NDArray[Any], columns: NDArray[Any], x: NDArray[Any]) -> None:
    total += np.dot(x, columns)


add_product = compiled_by(njit, "void(f8[::1], f8[:,::1], f8[::1])")(_by_entries if njit else _at_once)
"""Adds to a vector (n,) the columns (k, n) of a matrix times a vector (k,); in place, since small ones cost most."""


@compiled_by(
    njit,
    "void(f8[:,::1], f8[:,::1], f8[:,::1], f8[:,:,::1], f8[:,:,::1], f8[:,:,::1], f8[:,:,::1], i8,"
    "f8[::1], f8[::1], i8, f8, f8[::1], f8[:,::1], f8[:,::1])",
)
def step_through(
    whole: NDArray[Any], pushes: NDArray[Any], after: NDArray[Any], opposes: NDArray[Any], into: NDArray[Any],
    felt: NDArray[Any], yields: NDArray[Any], every: int, play: NDArray[Any], preload: NDArray[Any], upright: int,
    friction: float, seen: NDArray[Any], states: NDArray[Any], added: NDArray[Any],
) -> None:  # fmt: skip
    """Fill ``states`` (n, k) from the first on, as ``Stepped`` has them, in SI; and ``added`` (n, m), S known at first.

    ``whole`` (k + s + m, k + m) gives y without v[i+1], what is read of it and its accelerations, from y[i] and v[i];
    ``pushes`` (n, k + s + m) is what the loads add. The other matrices are transposed, and those of (b, ...) hold for
    ``every`` samples each: v per acceleration ``opposes`` (b, m, m) and per g ``into`` (b, s, m); what is read per g
    ``felt`` (b, s, s); y and what is read per v ``after`` (m, k + s) and per g ``yields`` (b, s, k + s).
    """
    k, read = states.shape[1], states.shape[1] + len(seen)
    relieved, g, at, y = np.zeros(3 * len(preload)), np.zeros(len(seen)), np.empty(whole.shape[1]), np.empty(read)
    released(seen, play, preload, upright, friction, relieved, True, g)
    for i in range(len(states) - 1):
        block = (i + 1) // every
        at[:k], at[k:] = states[i], added[i]
        without = np.dot(whole, at) + pushes[i]
        add_product(added[i + 1], opposes[block], without[read:])
        y[:] = without[:read]
        add_product(y, after, added[i + 1])
        seen[:] = y[k:]
        add_product(seen, felt[block], g)
        released(seen, play, preload, upright, friction, relieved, False, g)
        add_product(y, yields[block], g)
        states[i + 1] = y[:k]
        released(y[k:], play, preload, upright, friction, relieved, True, g)
        add_product(added[i + 1], into[block], g)


@dataclass(frozen=True)
class Stepped:
    """y' = A y + B (w + v), in SI, v from play and feet: y[i+1] = phi y[i] + push[i] + now v[i] + after v[i+1].

    v = into g + D (known accelerations - those found), g = ``released`` of what is read of y, forecast from the last.
    """

    a: Floats
    """(k, k), in SI."""
    b: Floats
    """(k, m), in SI: what a load adds to y' in each coordinate."""
    step: float
    """[s]"""
    positions: int
    """Coordinates, of which y has the displacements first, then the velocities; v acts on them."""
    read: Floats
    """Deflections of springs and forces on bonded feet per state, (s, k)."""
    into: Floats
    """Loads per g, (positions, s)."""
    play: Floats
    """Of the springs, (springs,) [rad, m]."""
    pressed: tuple[Floats, int, float]
    """Pressure of the feet at rest (feet,) [N], the axis along which, and the coefficient of friction."""
    beyond: Floats
    """Inertia D beyond that of A, each for ``every`` samples, (b, positions, positions) [kg, kg m, kg m2]."""
    every: int

    @cached_property
    def _matrices(self) -> list[Floats]:
        """As ``step_through`` has them, S = 1 / (1 + D times the accelerations per load at the end of a step) first."""
        n = self.positions
        phi, now, after = propagator(self.a, self.b, self.step)
        rates, now, after = self.a[n : 2 * n], now[:, :n], after[:, :n]
        solved = np.linalg.inv(np.eye(n) + self.beyond @ (rates @ after + self.b[n : 2 * n, :n]))
        both, into = np.vstack([after, self.read @ after]), solved @ self.into
        whole = np.vstack([np.eye(len(phi)), self.read, rates]) @ np.hstack([phi, now])
        transposed = (both, -solved @ self.beyond, into, self.read @ after @ into, both @ into)
        return [solved, whole, *(np.ascontiguousarray(x.swapaxes(-1, -2)) for x in transposed)]

    def through(self, driven: Floats, rest: Floats, before: Floats) -> tuple[Floats, Floats]:
        """States (n, k) under loads ``driven`` (n, m), and v (n, positions), from rest at the stops of the springs.

        ``rest`` (k,) is where they would be without play, ``before`` (n, positions) the known accelerations.
        """
        n, count, turns = self.positions, len(driven), 2 * len(self.play)
        turned = (self.read[:turns] @ rest).reshape(-1, 2)
        towards = turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-300)
        lacking = self.into[:, :turns] @ (self.play[:, None] * towards).ravel()
        states, known = np.empty((count, len(rest))), np.zeros((len(self.beyond) * self.every, n))
        solved, whole, *matrices = self._matrices
        known[:count] = before - times(self.b[n : 2 * n], driven)
        known = np.matmul(known.reshape(-1, self.every, n), (solved @ self.beyond).transpose(0, 2, 1))
        added = known.reshape(-1, n)[:count]
        states[0], added[0] = rest + np.linalg.solve(-self.a, self.b[:, :n] @ lacking), lacking
        _, now, after = propagator(self.a, self.b, self.step)
        shown = np.vstack([np.eye(len(rest)), self.read, self.a[n : 2 * n]])
        pushes = times(shown @ now, driven[:-1]) + times(shown @ after, driven[1:])
        seen = self.read @ states[0]
        step_through(whole, pushes, *matrices, self.every, self.play, *self.pressed, seen, states, added)
        return states, added
