"""Forward dynamics of an open chain, many motions at once: motion under given torques from given states.

M(q) q'' = tau - h(q, q'): both sides of the inverse dynamics W(q, q', q'') pi = tau, which is linear in q''. So M and h
come from W itself, for whatever combinations of parameters W's columns belong to.
"""

from collections.abc import Callable

import numpy as np

from ..arrays import Floats
from ..errors import ModelError
from ..mechanism.mechanism import Mechanism

InverseDynamics = Callable[[Floats, Floats, Floats], Floats]
"""Torques (n, nv) [N m, N] of the states q, v, a (n, nv)."""


def simulate_forward(inverse: InverseDynamics, q: Floats, v: Floats, torque: Floats, step: float) -> Floats:
    """Positions (n, samples, nv) of n motions from ``q``, ``v`` (n, nv) under ``torque`` (n, samples, nv) [N m, N].

    ``inverse`` gets n states at a time, one of each motion, several times over. A Runge-Kutta step of fourth order
    spans two samples, which are ``step`` [s] apart, so (samples + 1) / 2 positions are returned. A motion that diverges
    is NaN from there on.
    """
    motion = [q]
    for i in range(0, torque.shape[1] - 2, 2):
        q, v = _stepped(inverse, q, v, torque[:, i : i + 3], 2.0 * step)
        motion.append(q)
    return np.stack(motion, axis=1)


def refuse_loops(mechanism: Mechanism) -> None:
    """Raise ModelError where a mechanism has loops: its joints are no free coordinates."""
    if mechanism.loops or tuple(mechanism.driven) != tuple(mechanism.coordinates):
        raise ModelError(
            f"{mechanism.name} has loops or joints without a drive: only open chains are simulated forward"
        )


def acceleration(inverse: InverseDynamics, q: Floats, v: Floats, torque: Floats) -> Floats:
    """Accelerations (n, nv) [rad/s2, m/s2] of states ``q``, ``v`` under ``torque`` [N m, N], all (n, nv).

    NaN where the inertia matrix is singular or a state is not finite.
    """
    n, joints = q.shape
    units = np.repeat(np.eye(joints + 1, joints, -1), n, axis=0)  # none, then one of each joint
    bias, *columns = inverse(np.tile(q, (joints + 1, 1)), np.tile(v, (joints + 1, 1)), units).reshape(-1, n, joints)
    inertia = np.stack(columns, axis=2) - bias[:, :, None]
    regular = np.isfinite(inertia).all(axis=(1, 2)) & (np.abs(np.linalg.det(np.nan_to_num(inertia))) > 0.0)
    found = np.full_like(q, np.nan)
    found[regular] = np.linalg.solve(inertia[regular], (torque - bias)[regular][:, :, None])[:, :, 0]
    return found


def _stepped(inverse: InverseDynamics, q: Floats, v: Floats, torque: Floats, h: float) -> tuple[Floats, Floats]:
    first = acceleration(inverse, q, v, torque[:, 0])
    v2 = v + 0.5 * h * first
    second = acceleration(inverse, q + 0.5 * h * v, v2, torque[:, 1])
    v3 = v + 0.5 * h * second
    third = acceleration(inverse, q + 0.5 * h * v2, v3, torque[:, 1])
    v4 = v + h * third
    fourth = acceleration(inverse, q + h * v3, v4, torque[:, 2])
    q = q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
    v = v + h / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
    return np.where(np.abs(q) < _DIVERGED, q, np.nan), v


_DIVERGED = 1e3
"""A coordinate beyond any motion of a mechanism [rad, m]."""
