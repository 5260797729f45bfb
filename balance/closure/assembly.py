"""Closed configurations found from starts that are far open, and the assembly branches among them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats, Indices
from ..mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from ..mechanism.pinocchio_engine import PinocchioEngine

RANK_LIMIT = 1e-5
"""Size of a constraint row, relative to the largest, below which it is redundant.

Axes of files that drawing programs export are parallel to about 1e-7; rows that hold a linkage are above 1e-3.
"""
CLOSED_LIMIT = 1e-5
"""Residual up to which loops that no step closes better count as closed, relative to the mechanism's length.

With positions rounded like that, redundant loops close to about 1e-7 m only.
"""
_ITERATIONS = 100
_LONGEST_STEP = 0.5
"""Of an iteration [rad, lengths of the mechanism]."""


def nearest_closed(
    engine: "PinocchioEngine", q: Floats, length: float, free: Indices | slice = slice(None)
) -> tuple[Floats, float]:
    """A closed configuration near ``q`` (nv,) [rad, m], and the largest residual there [m, rad]: it tells if it closes.

    Levenberg-Marquardt steps of the coordinates ``free``, damped by the squared residual, so that they end as steps of
    least norm (Yamashita, Fukushima 2001) in rad and lengths; a step counts only if the residual falls.
    """
    gap, damping = engine.constraint_residual(q), 1e-3
    scale = np.where(engine.turning, 1.0, length)
    for _ in range(_ITERATIONS):
        size = float(np.linalg.norm(gap))
        if np.abs(gap).max(initial=0.0) < 1e-15 * length:
            break
        u, values, vt = np.linalg.svd((engine.constraint_jacobian(q) * scale)[:, free], full_matrices=False)
        if not len(values) or not values[0] > 0.0:
            break
        along = (u.T @ gap) * (values > RANK_LIMIT * values[0])
        while damping < 1e12:
            step = np.zeros_like(q)
            step[free] = -vt.T @ (along * values / (values**2 + damping * size**2 + 1e-300))
            longest = float(np.abs(step).max())
            step *= min(1.0, _LONGEST_STEP / max(longest, 1e-300))
            step *= scale
            trial = engine.constraint_residual(q + step)
            if np.linalg.norm(trial) < size:
                q, gap, damping = q + step, trial, damping / 10.0
                break
            damping = np.inf if longest < 1e-14 else max(10.0 * damping, 1e-3)
        else:
            break
    return q, float(np.abs(gap).max(initial=0.0))


def starts(mechanism: Mechanism, length: float, count: int) -> Iterator[Floats]:
    """Configurations (nv,) [rad, m] at random, ever farther from the file's: at last any angle, a length either way."""
    rng = np.random.default_rng(0)
    reach = np.array([np.pi if joint.revolute else length for joint in mechanism.tree.joints])
    for k in range(count):
        yield mechanism.home + (k + 1) / count * reach * rng.uniform(-1.0, 1.0, len(reach))


@dataclass(frozen=True)
class Configuration:
    """A closed configuration."""

    branch: str
    """Which way the mechanism is put together: A is that of the start, the others follow by distance from it."""
    q: Floats
    """Coordinates, (nv,) [rad, m]."""
    residual: float
    """Largest residual of the loops [m, rad]."""
    distance: float
    """Largest difference of a coordinate from branch A [rad, m]."""
